// modelDescription.xml of FMI 2.0, made from the table of variables.
#pragma once

#include <string>

#include "model.hpp"

namespace mixed_order_game {

/// The same model gives the same bytes.
std::string model_description(const Model& model);

}  // namespace mixed_order_game
