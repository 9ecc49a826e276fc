// The constants that the theorems take, over a box of joint actions: proved by interval evaluation with the box cut
// into parts, with the same figures as found at sample points beside them.
#pragma once

#include <vector>

#include "expression/interval.hpp"
#include "game/game_expressions.hpp"

namespace mixed_order_game {

/// Of a quantity's extreme over the box: a bound that is proved and the extreme of the samples, which lies within it.
struct BoxBound {
  Real proved = 0.0;  ///< infinite where nothing is proved
  Real sampled = 0.0;
};

/// Jacobians of a map with D values for each player, over the box.
struct JacobianBounds {
  std::vector<BoxBound> lipschitz;  ///< by player: the largest norm of its D x n rows
  std::vector<Interval> entries;    ///< at entry(i, l) n + column, n = N D; all numbers where nothing is proved
};

struct BoxConstants {
  BoxBound monotonicity;            ///< the smallest eigenvalue of the symmetric part of dP/dx, from below
  JacobianBounds gradients;         ///< of grad_i f_i
  JacobianBounds dynamics;          ///< of g_i along actions while all are at rest
  JacobianBounds velocities;        ///< of g_i along velocities
  std::vector<Real> dynamics_size;  ///< of |g_il| at rest over the box, at entry(i, l); infinite where none is proved
  std::vector<Real> disturbance_size;  ///< bounds of |d_il(t)| for all t from the game's own, likewise
  std::vector<std::string> open;       ///< why something is not proved, one sentence each
};

/// For all joint actions in the box, whose sides are finite, at entry(i, l), and all velocities of at most a speed in
/// each coordinate. The game has all of its players. Bounds of gradients are proved where the costs are defined, and
/// none of their conditions switches, in all of the box; those of dynamics where they are defined and do not jump. The
/// work is bounded: the box is not cut in games with many actions.
BoxConstants box_constants(const Parameters& parameters, const GameExpressions& expressions,
                           const std::vector<Interval>& box, Real speed);

}  // namespace mixed_order_game
