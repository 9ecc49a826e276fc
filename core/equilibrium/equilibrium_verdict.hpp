// What is known of the point at which all gradients vanish: whether it is a Nash equilibrium, and the only one.
#pragma once

#include <string>
#include <vector>

#include "game/game_expressions.hpp"

namespace mixed_order_game {

struct EquilibriumVerdict {
  enum class Kind {
    nash,        ///< every cost is convex in its player's own action
    local_nash,  ///< no player gains by a small change of its own action
    open,        ///< neither is known: a second derivative is zero at x*
  };
  struct OfPlayer {
    Real curvature;      ///< the smallest eigenvalue of d^2 f_i / dx_i^2 at x*
    Real convex_within;  ///< f_i is convex in x_i where no coordinate is farther from x* than this: infinite where it
                         ///< is convex everywhere, 0 where nothing is proved
    std::string kink;    ///< the text of a condition of f_i that switches at x*; empty without one
  };

  Kind kind = Kind::open;
  std::vector<Real> x_star;
  std::vector<OfPlayer> players;
  Real monotonicity = 0.0;  ///< m at x*, of the symmetric part of the pseudo-gradient's Jacobian
  bool is_affine = false;   ///< so that m holds everywhere, and x* is the only point at which all gradients vanish
  std::vector<std::vector<Real>> others;  ///< equilibria, in the same sense, to which other starts lead
  std::vector<int> undefined_at_start;    ///< players whose gradient is not finite at their first estimates
};

/// Throws GameError as nash_equilibrium().
EquilibriumVerdict judge_equilibrium(const Parameters& parameters,
                                     const std::vector<ExpressionCost::Text>& cost_expressions);

}  // namespace mixed_order_game
