// The Nash equilibrium x* of the game and how strongly monotone its pseudo-gradient is.
#pragma once

#include <vector>

#include "families/cost.hpp"

namespace mixed_order_game {

/// x*, at entry(i, l): the joint action at which every grad_i f_i vanishes and no own Hessian d^2 f_i / dx_i^2 has a
/// negative eigenvalue, reached by steps along which every cost is finite. For quadratic costs the pseudo-gradient
/// P(x) = (grad_1 f_1, ..., grad_N f_N) is affine, Newton's method takes one step and one more against rounding, and x*
/// is a Nash equilibrium; for other costs, which take several steps from the guess and then from other starts, it is
/// one if they are convex in the own action. Throws GameError when x* is not unique, that is when the Jacobian of P is
/// singular whatever the units of its rows and columns; when a player's cost curves downwards along its own action; and
/// when the steps do not converge.
std::vector<Real> nash_equilibrium(const Cost& cost, const Shape& shape, const std::vector<Real>& guess = {});

/// The derivative of x* with respect to the cost's coefficients, along those of a direction. Throws as
/// nash_equilibrium().
std::vector<Real> nash_equilibrium_along(const Cost& cost, const Cost& direction, const Shape& shape,
                                         const Real* x_star);

/// Other points that nash_equilibrium() would accept, to which a fixed list of starts around x* leads; each once.
std::vector<std::vector<Real>> other_equilibria(const Cost& cost, const Shape& shape, const std::vector<Real>& x_star);

/// The smallest eigenvalue of d^2 f_i / dx_i^2 at x, and the largest second derivative in the player's gradient.
struct OwnCurvature {
  Real smallest;
  Real scale;
};
OwnCurvature own_curvature(const Cost& cost, const Shape& shape, int i, const std::vector<Real>& x);

/// The smallest eigenvalue of the symmetric part of the Jacobian of P at x. For quadratic costs that is, everywhere,
/// the largest m with (x - z)'(P(x) - P(z)) >= m |x - z|^2.
Real strong_monotonicity(const Cost& cost, const std::vector<Real>& x);

}  // namespace mixed_order_game
