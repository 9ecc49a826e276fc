// The Jacobian of the loop written out entry by entry, and a dense solver of its Newton systems: the plain way, against
// which the structured one is judged.
#pragma once

#include <memory>
#include <vector>

#include "newton/newton_solver.hpp"

namespace mixed_order_game {

/// One entry of a sparse matrix.
struct MatrixEntry {
  int row;
  int column;
  Real value;
};

/// All entries that may differ from zero, each position once.
std::vector<MatrixEntry> matrix_of(const LoopJacobian& jacobian);

/// Dense LU of the whole matrix, by Eigen.
std::unique_ptr<NewtonSolver> make_dense_newton();

}  // namespace mixed_order_game
