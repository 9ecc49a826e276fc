// KLU (SuiteSparse) on the whole sparse Newton matrix: what a user of CVODE with a sparse solver would have. KLU's
// licence is the LGPL, so it serves benchmarks and tests and is no part of the product.
#pragma once

#include "newton/newton_solver.hpp"

namespace mixed_order_game {

/// KLU orders by itself (the better of AMD and COLAMD), or is told to eliminate weights, then estimates, then the rest.
std::unique_ptr<NewtonSolver> make_klu_newton(bool informed);

}  // namespace mixed_order_game
