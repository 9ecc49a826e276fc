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

Eigen::Index position_in(const std::vector<int>& group, int entry) {
  return std::lower_bound(group.begin(), group.end(), entry) - group.begin();
}

// Rows and columns of a group in the Jacobian of the pseudo-gradient, whose entries lie along the pattern.
Eigen::MatrixXd block_of(const std::vector<int>& group, const SparseRows& pattern, const std::vector<Real>& values) {
  const auto size = static_cast<Eigen::Index>(group.size());
  Eigen::MatrixXd block = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index row = 0; row < size; ++row) {
    const auto entry = at(group[at(row)]);
    for (int k = pattern.start[entry]; k < pattern.start[entry + 1]; ++k) {
      block(row, position_in(group, pattern.column[at(k)])) += values[at(k)];
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

/// Entries of a joint action in groups that depend on each other, each ascending and after those that it depends on:
/// the strongly connected components of the pattern's graph from rows to columns, by Tarjan's algorithm.
class DependentGroups {
 public:
  explicit DependentGroups(const SparseRows& pattern)
      : group_of(at(pattern.rows()), -1), pattern_(pattern), number_(group_of.size(), 0), lowest_(group_of.size()) {
    for (int row = 0; row < pattern.rows(); ++row) {
      if (number_[at(row)] == 0) visit(row);
    }
  }

  std::vector<std::vector<int>> groups;
  std::vector<int> group_of;

 private:
  struct Visit {
    int row;
    int next;  // entry of the row to look at
  };

  /// Depth first, without recursion: a chain of entries would need as many frames on the host's stack.
  void visit(int first) {
    std::vector<Visit> visits;
    begin(first, visits);
    while (!visits.empty()) {
      auto& [row, next] = visits.back();
      if (next < pattern_.start[at(row + 1)]) {
        const int column = pattern_.column[at(next)];
        if (number_[at(column)] == 0) {
          begin(column, visits);  // which looks at the same entry again when it is back
        } else {
          if (group_of[at(column)] < 0) lowest_[at(row)] = std::min(lowest_[at(row)], lowest_[at(column)]);
          ++next;
        }
        continue;
      }
      if (lowest_[at(row)] == number_[at(row)]) close_group(row);
      visits.pop_back();
    }
  }

  void begin(int row, std::vector<Visit>& visits) {
    lowest_[at(row)] = number_[at(row)] = ++visited_;
    path_.push_back(row);
    visits.push_back({row, pattern_.start[at(row)]});
  }

  void close_group(int row) {
    const auto first = std::find(path_.begin(), path_.end(), row);
    std::vector<int> group(first, path_.end());
    path_.erase(first, path_.end());
    std::sort(group.begin(), group.end());
    for (const int entry : group) group_of[at(entry)] = static_cast<int>(groups.size());
    groups.push_back(std::move(group));
  }

  const SparseRows& pattern_;
  std::vector<int> number_;  // in the order of visits, 0 before
  std::vector<int> lowest_;  // number that the row leads back to
  std::vector<int> path_;    // visited, and not yet in a group
  int visited_ = 0;
};

/// Replaces b by the solution of J solution = b, where J is the Jacobian of the pseudo-gradient. Group by group, so
/// that entries that do not depend on an entry of b are not touched by it, not even by rounding.
void solve_in_place(const SparseRows& pattern, const std::vector<Real>& hessian, std::vector<Real>& b) {
  const DependentGroups dependent(pattern);
  for (const std::vector<int>& group : dependent.groups) {
    const auto size = static_cast<Eigen::Index>(group.size());
    Eigen::MatrixXd block = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd solution(size);
    for (Eigen::Index row = 0; row < size; ++row) {
      const auto entry = at(group[at(row)]);
      solution(row) = b[entry];
      for (int k = pattern.start[entry]; k < pattern.start[entry + 1]; ++k) {
        const int other = pattern.column[at(k)];
        if (dependent.group_of[at(other)] == dependent.group_of[entry]) {
          block(row, position_in(group, other)) += hessian[at(k)];
        } else {
          solution(row) -= hessian[at(k)] * b[at(other)];
        }
      }
    }
    const Eigen::PartialPivLU<Eigen::MatrixXd> lu(block);
    if (!is_regular(lu)) {
      throw GameError(
          "the game has no unique Nash equilibrium: the Jacobian of its pseudo-gradient is singular"
          " (reciprocal condition number below 1e-13), expected cost parameters that make it regular");
    }
    solution = lu.solve(solution);
    for (Eigen::Index row = 0; row < size; ++row) b[at(group[at(row)])] = solution(row);
  }
}

Real largest_magnitude(const std::vector<Real>& numbers) {
  Real largest = 0.0;
  for (const Real number : numbers) largest = std::max(largest, std::abs(number));
  return largest;
}

}  // namespace

std::vector<Real> nash_equilibrium(const Cost& cost, const Shape& shape) {
  constexpr int most_iterations = 50;
  const std::size_t n = at(shape.actions());
  const SparseRows& pattern = cost.hessian_pattern();
  std::vector<Real> hessian(at(pattern.entries()));
  std::vector<Real> step(n);
  std::vector<Real> x(n, 0.0);
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    cost.own_gradients(x.data(), 0, step.data());
    cost.hessian_rows(x.data(), 0, hessian.data());
    solve_in_place(pattern, hessian, step);
    for (std::size_t p = 0; p < n; ++p) x[p] -= step[p];
    if (largest_magnitude(step) <= 1e-14 * (1.0 + largest_magnitude(x))) return x;
  }
  const bool finite = std::all_of(x.begin(), x.end(), [](Real entry) { return std::isfinite(entry); });
  if (!finite) throw GameError("the search for the Nash equilibrium did not converge, expected costs with one");
  return x;
}

// P(x*) = 0 at every cost, so that (dP/dx) dx* = -dP, the change of P at a fixed x
std::vector<Real> nash_equilibrium_along(const Cost& cost, const Cost& direction, const Shape& shape,
                                         const Real* x_star) {
  const SparseRows& pattern = cost.hessian_pattern();
  std::vector<Real> hessian(at(pattern.entries()));
  std::vector<Real> along(at(shape.actions()));
  cost.hessian_rows(x_star, 0, hessian.data());
  const std::vector<Dual> x(x_star, x_star + along.size());
  std::vector<Dual> gradient(along.size());
  cost.own_gradients(CoefficientsAlong(cost.coefficients, &direction.coefficients), x.data(), 0, gradient.data());
  for (std::size_t p = 0; p < along.size(); ++p) along[p] = -gradient[p].along;
  solve_in_place(pattern, hessian, along);
  return along;
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
