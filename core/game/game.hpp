// A game as its definition file states it: names, what to expose, and the parameters and initial state of a run.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "game/parameters.hpp"

namespace mixed_order_game {

/// Which variables an FMU of the game has: everything, or without y, y0, W and with edges and couplings only where
/// they are not zero.
enum class Expose { all, outputs };

struct Game {
  std::string title;
  Expose expose = Expose::all;
  std::vector<std::string> player_names;
  Parameters parameters;
};

/// Reads a game definition (TOML). Throws GameError with one sentence that names the entry, its value and what was
/// expected: syntax, missing and unknown keys, lengths, ranges, a disconnected graph, no unique equilibrium.
Game parse_game(std::string_view toml);

}  // namespace mixed_order_game
