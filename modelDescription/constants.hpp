// The constants of the theorems over a box of joint actions, for the commands of the Python package.
#pragma once

#include <string>
#include <string_view>

namespace mixed_order_game {

/// As JSON, for a game with start values in place of its own. The request is TOML: box = [[lower, upper], ...] for each
/// action, by player, then by coordinate, speed = the largest of a coordinate of a velocity, and settings = { "NAME" =
/// VALUE, ... } by the names of the FMU's variables.
/// Throws GameError as parse_game() and for a request that the game does not take.
std::string constants(std::string_view toml, std::string_view request);

}  // namespace mixed_order_game
