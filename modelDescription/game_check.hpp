// What the host tool answers about a game file: the first problem, and where each entry stands.
#pragma once

#include <string>
#include <string_view>

#include "errors.hpp"

namespace mixed_order_game {

/// {"problem": null} for a valid game, given no error, else
/// {"problem": {"message": "...", "entry": "gains.k1", "line": 5, "column": 1}, "places": {"gains.k1": [5, 1], ...}}.
/// Lines and columns count from one; an entry that is missing stands where what would hold it does. A file that is not
/// TOML has no places.
std::string checked_game(std::string_view text, const GameError* error);

}  // namespace mixed_order_game
