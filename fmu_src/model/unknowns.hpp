// Which variables the model's equations determine and from which, as the model structure lists them: one set of
// equations holds in initialization mode, another one from then on.
#pragma once

#include <string>

#include "model.hpp"

namespace mixed_order_game {

enum class Equations { initial, running };

/// Initial: outputs, calculated parameters, states and their derivatives; running: outputs and derivatives. States and
/// derivatives count only where all of them are variables.
bool is_unknown(const Model& model, int reference, Equations equations);

/// Initial: inputs, parameters and time; running: inputs, states (where all of them are variables) and time.
bool is_known(const Model& model, int reference, Equations equations);

/// Why not, beginning with the variable's name.
std::string why_no_unknown(const Model& model, int reference, Equations equations);
std::string why_no_known(const Model& model, int reference, Equations equations);

}  // namespace mixed_order_game
