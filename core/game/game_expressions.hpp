// The expressions of a game as graphs, which the game's own costs, dynamics and disturbances hold compiled.
#pragma once

#include <string_view>
#include <vector>

#include "families/expression_cost.hpp"
#include "game/game.hpp"

namespace mixed_order_game {

/// Graphs are null where there is no expression.
struct GameExpressions {
  std::vector<ExpressionCost::Text> costs;         ///< by hosted player
  std::vector<ExpressionCost::Text> dynamics;      ///< at own entries
  std::vector<ExpressionCost::Text> disturbances;  ///< at own entries
};

/// As parse_game(toml).
Game parse_game(std::string_view toml, GameExpressions& expressions);

}  // namespace mixed_order_game
