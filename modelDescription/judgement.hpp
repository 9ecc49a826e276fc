// What is known of a game's Nash equilibrium, for the commands of the Python package.
#pragma once

#include <string>
#include <string_view>

namespace mixed_order_game {

/// As JSON; distances that are infinite are null, and all of it where players are elsewhere. Throws GameError as
/// parse_game().
std::string judgement(std::string_view toml);

}  // namespace mixed_order_game
