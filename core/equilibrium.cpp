#include "equilibrium.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "errors.hpp"

namespace mixed_order_game {

namespace {

// Jacobian of the pseudo-gradient at x
Eigen::MatrixXd pseudo_gradient_jacobian(const Cost& cost, const Shape& shape, const Eigen::VectorXd& x) {
  const int n = shape.actions();
  const SparseRows& pattern = cost.hessian_pattern();
  std::vector<Real> values(at(pattern.entries()));
  cost.hessian_rows(x.data(), 0, values.data());
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(n, n);
  for (int row = 0; row < n; ++row) {
    for (int k = pattern.start[at(row)]; k < pattern.start[at(row + 1)]; ++k) {
      jacobian(row, pattern.column[at(k)]) += values[at(k)];
    }
  }
  return jacobian;
}

}  // namespace

std::vector<Real> nash_equilibrium(const Cost& cost, const Shape& shape) {
  constexpr int most_iterations = 50;
  constexpr Real singular = 1e-13;  // reciprocal condition number
  const int n = shape.actions();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd gradient(n);
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    cost.own_gradients(x.data(), 0, gradient.data());
    const Eigen::PartialPivLU<Eigen::MatrixXd> lu(pseudo_gradient_jacobian(cost, shape, x));
    if (!(lu.rcond() > singular)) {
      throw GameError("the game has no unique Nash equilibrium: the Jacobian of its pseudo-gradient is singular"
                      " (reciprocal condition number below 1e-13), expected cost parameters that make it regular");
    }
    const Eigen::VectorXd step = lu.solve(gradient);
    x -= step;
    if (step.lpNorm<Eigen::Infinity>() <= 1e-14 * (1.0 + x.lpNorm<Eigen::Infinity>())) {
      return {x.data(), x.data() + n};
    }
  }
  if (!x.allFinite()) throw GameError("the search for the Nash equilibrium did not converge");
  return {x.data(), x.data() + n};
}

Real strong_monotonicity(const Cost& cost, const Shape& shape) {
  const Eigen::MatrixXd jacobian = pseudo_gradient_jacobian(cost, shape, Eigen::VectorXd::Zero(shape.actions()));
  const Eigen::MatrixXd symmetric = 0.5 * (jacobian + jacobian.transpose());
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric, Eigen::EigenvaluesOnly).eigenvalues()(0);
}

}  // namespace mixed_order_game
