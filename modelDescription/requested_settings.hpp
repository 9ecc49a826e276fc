// Settings of a game's FMU as a request to the host tool names them.
#pragma once

#include <map>
#include <string>

#include "definition/toml_reader.hpp"
#include "model.hpp"
#include "settings.hpp"

namespace mixed_order_game {

/// Value references by the names of the variables.
using References = std::map<std::string, int, std::less<>>;
References references_of(const ModelVariables& variables);

/// The game's settings with { "NAME" = VALUE, ... } in place of its own; an absent table changes nothing. Throws
/// GameError for a name or a value that the FMU does not take.
Settings settings_with(const TomlEntry& table, const Model& model);

}  // namespace mixed_order_game
