// Numbers that say how far a state is from the equilibrium and from consensus.
#pragma once

#include "loop/closed_loop.hpp"

namespace mixed_order_game {

/// 2-norm of x - x*; x and x_star of length N D.
Real nash_error(const Real* x, const Real* x_star, int entries);

/// The derivative of nash_error() along the directions x_along and x_star_along; 0 at x = x*, where it has none.
Real nash_error_along(const Real* x, const Real* x_star, const Real* x_along, const Real* x_star_along, int entries);

/// 2-norm of all y_ij - xbar_j; signals as of this state.
Real consensus_error(const ClosedLoop& loop, const Real* state, const Signals& signals);

/// 2-norm of (grad_1 f_1(x), ..., grad_N f_N(x)).
Real gradient_norm(const ClosedLoop& loop, const Real* x);

}  // namespace mixed_order_game
