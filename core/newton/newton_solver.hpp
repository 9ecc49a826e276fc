// Solver of the Newton systems (I - gamma J) delta = b that an implicit integrator of the closed loop meets.
#pragma once

#include <memory>

#include "loop/loop_jacobian.hpp"

namespace mixed_order_game {

class NewtonSolver {
 public:
  virtual ~NewtonSolver() = default;

  /// Takes over changed parameters and their sparsity patterns.
  virtual void refresh(const LoopJacobian& jacobian) = 0;

  /// Prepares for one gamma > 0 [s]; false when the matrix is numerically singular. The Jacobian must outlive the
  /// calls of solve() that follow.
  virtual bool factor(const LoopJacobian& jacobian, Real gamma) = 0;

  /// Replaces b, of the state's length, by the solution.
  virtual void solve(Real* b) = 0;
};

/// Elimination along the structure of the closed loop; see structured_newton.cpp.
std::unique_ptr<NewtonSolver> make_structured_newton();

}  // namespace mixed_order_game
