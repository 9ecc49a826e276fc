// A game together with its table of variables and the GUID of the interface that they make.
#pragma once

#include <string>
#include <string_view>

#include "game/game.hpp"
#include "model_variables.hpp"

namespace mixed_order_game {

inline constexpr const char* model_identifier = "MixedOrderGame";
inline constexpr Real default_tolerance = 1e-6;
inline constexpr Real default_stop_time = 20.0;  ///< s
inline constexpr Real default_step_size = 0.02;  ///< s
inline constexpr int highest_output_derivative = 1;

struct Model {
  /// Throws GameError when the text is not a valid game.
  explicit Model(std::string_view toml);

  /// Needs all states as variables.
  [[nodiscard]] bool offers_model_exchange() const { return !variables.states().empty(); }

  Game game;
  ModelVariables variables;
  std::string guid;
};

}  // namespace mixed_order_game
