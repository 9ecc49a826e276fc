#include "equilibrium.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "errors.hpp"

namespace mixed_order_game {

namespace {

// Entries of a joint action in groups that the Hessian rows do not connect, each ascending. For quadratic costs the
// coordinates are such groups at least.
std::vector<std::vector<int>> independent_groups(const SparseRows& pattern) {
  std::vector<int> parent(at(pattern.rows()));
  std::iota(parent.begin(), parent.end(), 0);
  const auto root_of = [&](int entry) {
    while (parent[at(entry)] != entry) entry = parent[at(entry)] = parent[at(parent[at(entry)])];
    return entry;
  };
  for (int row = 0; row < pattern.rows(); ++row) {
    for (int k = pattern.start[at(row)]; k < pattern.start[at(row + 1)]; ++k) {
      parent[at(root_of(pattern.column[at(k)]))] = root_of(row);
    }
  }
  std::vector<std::vector<int>> of_root(parent.size());
  for (int row = 0; row < pattern.rows(); ++row) of_root[at(root_of(row))].push_back(row);
  std::erase_if(of_root, [](const std::vector<int>& group) { return group.empty(); });
  return of_root;
}

// Rows and columns of a group in the Jacobian of the pseudo-gradient, whose entries lie along the pattern.
Eigen::MatrixXd block_of(const std::vector<int>& group, const SparseRows& pattern, const std::vector<Real>& values) {
  const auto size = static_cast<Eigen::Index>(group.size());
  Eigen::MatrixXd block = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index row = 0; row < size; ++row) {
    const auto entry = at(group[at(row)]);
    for (int k = pattern.start[entry]; k < pattern.start[entry + 1]; ++k) {
      const auto column = std::lower_bound(group.begin(), group.end(), pattern.column[at(k)]) - group.begin();
      block(row, column) += values[at(k)];
    }
  }
  return block;
}

bool is_regular(const Eigen::PartialPivLU<Eigen::MatrixXd>& lu) {
  constexpr Real singular = 1e-13;  // reciprocal condition number
  // the estimate of rcond() is meaningless with a pivot of zero
  const Eigen::ArrayXd pivots = lu.matrixLU().diagonal().array().abs();
  return lu.matrixLU().allFinite() && pivots.minCoeff() > singular * pivots.maxCoeff() && lu.rcond() > singular;
}

}  // namespace

std::vector<Real> nash_equilibrium(const Cost& cost, const Shape& shape) {
  constexpr int most_iterations = 50;
  const std::size_t n = at(shape.actions());
  const SparseRows& pattern = cost.hessian_pattern();
  const std::vector<std::vector<int>> groups = independent_groups(pattern);
  std::vector<Real> hessian(at(pattern.entries()));
  std::vector<Real> gradient(n);
  std::vector<Real> x(n, 0.0);
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    cost.own_gradients(x.data(), 0, gradient.data());
    cost.hessian_rows(x.data(), 0, hessian.data());
    Real largest_step = 0.0;
    Real largest = 0.0;
    for (const std::vector<int>& group : groups) {
      const Eigen::PartialPivLU<Eigen::MatrixXd> lu(block_of(group, pattern, hessian));
      if (!is_regular(lu)) {
        throw GameError(
            "the game has no unique Nash equilibrium: the Jacobian of its pseudo-gradient is singular"
            " (reciprocal condition number below 1e-13), expected cost parameters that make it regular");
      }
      const auto size = static_cast<Eigen::Index>(group.size());
      Eigen::VectorXd step(size);
      for (Eigen::Index k = 0; k < size; ++k) step(k) = gradient[at(group[at(k)])];
      step = lu.solve(step);
      for (Eigen::Index k = 0; k < size; ++k) x[at(group[at(k)])] -= step(k);
      for (const int entry : group) largest = std::max(largest, std::abs(x[at(entry)]));
      largest_step = std::max(largest_step, step.lpNorm<Eigen::Infinity>());
    }
    if (largest_step <= 1e-14 * (1.0 + largest)) return x;
  }
  const bool finite = std::all_of(x.begin(), x.end(), [](Real entry) { return std::isfinite(entry); });
  if (!finite) throw GameError("the search for the Nash equilibrium did not converge, expected costs with one");
  return x;
}

Real strong_monotonicity(const Cost& cost, const Shape& shape) {
  const std::vector<Real> x(at(shape.actions()), 0.0);
  const SparseRows& pattern = cost.hessian_pattern();
  std::vector<Real> hessian(at(pattern.entries()));
  cost.hessian_rows(x.data(), 0, hessian.data());
  Real smallest = std::numeric_limits<Real>::infinity();
  for (const std::vector<int>& group : independent_groups(pattern)) {
    const Eigen::MatrixXd block = block_of(group, pattern, hessian);
    const Eigen::MatrixXd symmetric = 0.5 * (block + block.transpose());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(symmetric, Eigen::EigenvaluesOnly);
    smallest = std::min(smallest, solver.eigenvalues()(0));
  }
  return smallest;
}

}  // namespace mixed_order_game
