// The gains of the strategy, one of each kind for every player, and their declarations.
//
// The reader of game files, the FMU's table of variables, directional derivatives and the model structure go by the
// declarations.
#pragma once

#include <array>
#include <vector>

#include "types.hpp"

namespace mixed_order_game {

/// Indexed by players.
template <typename Number>
struct GainsAs {
  std::vector<Number> k1;       ///< regulation of first-order players, 1/s
  std::vector<Number> k2;       ///< gradient step
  std::vector<Number> k3;       ///< consensus, 1/s
  std::vector<Number> k4;       ///< velocity feedback of second-order players, 1/s
  std::vector<Number> beta;     ///< adaptation
  std::vector<Number> delta;    ///< amplitude of the robust term
  std::vector<Number> epsilon;  ///< width of the robust term

  /// All of them, in the order of declared_gains.
  static constexpr std::array<std::vector<Number> GainsAs::*, 7> members() {
    return {&GainsAs::k1, &GainsAs::k2, &GainsAs::k3, &GainsAs::k4, &GainsAs::beta, &GainsAs::delta, &GainsAs::epsilon};
  }
};

struct Gains : GainsAs<Real> {
  bool per_player = false;  ///< a player states gains of its own; otherwise all players have the same
};

struct GainDeclaration {
  const char* name;
  int order;  ///< of the players that have it; 0: all
  bool may_be_zero;
  const char* unit;
  const char* description;
};

inline constexpr std::array<GainDeclaration, 7> declared_gains{{
    {"k1", 1, false, "1/s", "Regulation gain of players of order 1"},
    {"k2", 0, false, "1/s", "Gradient gain"},
    {"k3", 0, false, "1/s", "Consensus gain of the estimates"},
    {"k4", 2, false, "1/s", "Velocity feedback gain of players of order 2"},
    {"beta", 0, true, "1/s2", "Adaptation gain of the network weights"},
    {"delta", 0, true, nullptr, "Amplitude of the robust term"},
    {"epsilon", 0, false, nullptr, "Width of the robust term"},
}};

}  // namespace mixed_order_game
