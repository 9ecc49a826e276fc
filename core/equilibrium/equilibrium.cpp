#include "equilibrium/equilibrium.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <numeric>

#include "errors.hpp"
#include "number_text.hpp"

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

// Exponents of powers of two that multiply rows and columns so that the magnitudes in each add up to about 1.
struct Balance {
  std::vector<int> row;
  std::vector<int> column;
};

// Sinkhorn and Knopp: what they reach does not depend on how rows and columns were scaled before, which can hide a
// regular matrix or a singular one. The largest magnitude of each row comes first, against overflow.
Balance balance_of(const Eigen::MatrixXd& matrix) {
  constexpr int most_sweeps = 100;
  constexpr Real close = 0.1;
  const auto size = matrix.rows();
  Eigen::ArrayXXd magnitude = matrix.array().abs();
  Eigen::ArrayXd row = Eigen::ArrayXd::Zero(size);  // exponents, not yet rounded
  Eigen::ArrayXd column = Eigen::ArrayXd::Zero(size);
  const auto usable = [](Real sum) { return sum > 0.0 && std::isfinite(sum); };
  for (Eigen::Index k = 0; k < size; ++k) {
    const Real largest = magnitude.row(k).maxCoeff();
    if (!usable(largest)) continue;
    row(k) = -std::ilogb(largest);
    for (Real& entry : magnitude.row(k)) entry = std::ldexp(entry, static_cast<int>(row(k)));
  }
  for (int sweep = 0; sweep < most_sweeps; ++sweep) {
    const Eigen::ArrayXd row_sum = magnitude.rowwise().sum();
    if (sweep > 0 && (row_sum - 1.0).abs().maxCoeff() <= close) break;
    for (Eigen::Index k = 0; k < size; ++k) {
      if (!usable(row_sum(k))) continue;
      magnitude.row(k) /= row_sum(k);
      row(k) -= std::log2(row_sum(k));
    }
    for (Eigen::Index k = 0; k < size; ++k) {
      const Real sum = magnitude.col(k).sum();
      if (!usable(sum)) continue;
      magnitude.col(k) /= sum;
      column(k) -= std::log2(sum);
    }
  }
  Balance balance;
  for (const Real exponent : row) balance.row.push_back(static_cast<int>(std::lround(exponent)));
  for (const Real exponent : column) balance.column.push_back(static_cast<int>(std::lround(exponent)));
  return balance;
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
    const Balance balance = balance_of(block);
    for (Eigen::Index row = 0; row < size; ++row) {
      for (Eigen::Index column = 0; column < size; ++column) {
        block(row, column) = std::ldexp(block(row, column), balance.row[at(row)] + balance.column[at(column)]);
      }
      solution(row) = std::ldexp(solution(row), balance.row[at(row)]);
    }
    const Eigen::PartialPivLU<Eigen::MatrixXd> lu(block);
    if (!is_regular(lu)) {
      throw GameError(
          "the game has no unique Nash equilibrium: the Jacobian of its pseudo-gradient is singular"
          " (reciprocal condition number below 1e-13 with its rows and columns balanced), expected cost parameters that"
          " make it regular");
    }
    solution = lu.solve(solution);
    for (Eigen::Index row = 0; row < size; ++row) solution(row) = std::ldexp(solution(row), balance.column[at(row)]);
    for (Eigen::Index row = 0; row < size; ++row) b[at(group[at(row)])] = solution(row);
  }
}

Real largest_magnitude(const std::vector<Real>& numbers) {
  Real largest = 0.0;
  for (const Real number : numbers) largest = std::max(largest, std::abs(number));
  return largest;
}

/// Whether gradients at x are what rounding leaves of their terms, for costs that are quadratic between 0 and x.
bool vanish(const std::vector<Real>& gradient, const SparseRows& pattern, const std::vector<Real>& hessian,
            const std::vector<Real>& x) {
  constexpr Real rounding = 4.0 * std::numeric_limits<Real>::epsilon();
  for (std::size_t row = 0; row < gradient.size(); ++row) {
    Real terms = 0.0;
    for (int k = pattern.start[row]; k < pattern.start[row + 1]; ++k) {
      terms += std::abs(hessian[at(k)] * x[at(pattern.column[at(k)])]);
    }
    const int entries = pattern.start[row + 1] - pattern.start[row];
    if (!std::isfinite(terms) || !(std::abs(gradient[row]) <= rounding * (4 + entries) * terms)) return false;
  }
  return true;
}

OwnCurvature curvature_of(int i, const SparseRows& pattern, const std::vector<Real>& hessian, const Shape& shape) {
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(shape.dimension, shape.dimension);
  Real scale = 0.0;
  for (int l = 0; l < shape.dimension; ++l) {
    const auto row = at(shape.entry(i, l));
    for (int k = pattern.start[row]; k < pattern.start[row + 1]; ++k) {
      const int column = pattern.column[at(k)];
      scale = std::max(scale, std::abs(hessian[at(k)]));
      if (shape.player_of(column) == i) own(l, shape.coordinate_of(column)) += hessian[at(k)];
    }
  }
  const Real smallest =
      own.isDiagonal(0.0)
          ? own.diagonal().minCoeff()
          : Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(own, Eigen::EigenvaluesOnly).eigenvalues()(0);
  return {smallest, scale};
}

/// Throws where a player could lower its cost: its own Hessian at x has an eigenvalue that is negative beyond rounding.
void require_best_responses(const SparseRows& pattern, const std::vector<Real>& hessian, const Shape& shape) {
  constexpr Real rounding = 1e-12;  // of the largest second derivative of the player's cost
  for (int i = 0; i < shape.players; ++i) {
    const auto [smallest, scale] = curvature_of(i, pattern, hessian, shape);
    if (smallest >= -rounding * scale) continue;
    const std::string number = std::to_string(i + 1);
    throw GameError("player[" + number + "].cost is concave in the player's own action (second derivative " +
                        text_of(smallest) + "), expected one of at least 0: where all gradients vanish, player " +
                        number + " can lower its cost, and that is no Nash equilibrium",
                    "player[" + number + "].cost");
  }
}

constexpr int most_iterations = 50;

[[noreturn]] void fail_to_converge() {
  throw GameError("the search for the Nash equilibrium did not converge in " + std::to_string(most_iterations) +
                  " Newton steps, expected costs with one");
}

bool is_finite(const std::vector<Real>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](Real number) { return std::isfinite(number); });
}

Real norm(const std::vector<Real>& numbers) {
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(), static_cast<Eigen::Index>(numbers.size())).stableNorm();
}

/// Of costs whose gradients are affine: one step, and one more against rounding.
std::vector<Real> affine_equilibrium(const Cost& cost, std::size_t n) {
  const SparseRows& pattern = cost.hessian_pattern();
  std::vector<Real> hessian(at(pattern.entries()));
  std::vector<Real> step(n);
  std::vector<Real> x(n, 0.0);
  bool converged = false;
  for (int iteration = 0; iteration < most_iterations && !converged; ++iteration) {
    cost.own_gradients(x.data(), 0, step.data());
    cost.hessian_rows(x.data(), 0, hessian.data());
    converged = vanish(step, pattern, hessian, x);
    solve_in_place(pattern, hessian, step);
    for (std::size_t p = 0; p < n; ++p) x[p] -= step[p];
    converged = converged || largest_magnitude(step) <= 1e-14 * (1.0 + largest_magnitude(x));
  }
  if (!converged || !is_finite(x)) fail_to_converge();
  return x;
}

/// The first player whose cost or gradient is not finite at x, such as log(x) below 0, though its gradient 1/x is
/// there; -1 if there is none.
int player_without_cost(const Cost& cost, const Shape& shape, const std::vector<Real>& x,
                        const std::vector<Real>& gradient) {
  for (int i = 0; i < shape.players; ++i) {
    if (!std::isfinite(cost.value(i, x.data()))) return i;
    for (int l = 0; l < shape.dimension; ++l) {
      if (!std::isfinite(gradient[at(shape.entry(i, l))])) return i;
    }
  }
  return -1;
}

/// Newton's method with steps that are halved until the gradients become smaller, where all costs are defined.
std::vector<Real> search_from(const Cost& cost, const Shape& shape, std::vector<Real> x) {
  constexpr Real enough = 1e-12;
  constexpr int most_halvings = 40;
  const SparseRows& pattern = cost.hessian_pattern();
  const std::size_t n = x.size();
  std::vector<Real> hessian(at(pattern.entries()));
  std::vector<Real> gradient(n);
  std::vector<Real> trial(n);
  cost.own_gradients(x.data(), 0, gradient.data());
  if (const int i = player_without_cost(cost, shape, x, gradient); i >= 0) {
    throw GameError("player[" + std::to_string(i + 1) +
                    "].cost is not finite where the search for the Nash equilibrium begins, expected an" +
                    " equilibrium.guess, or x0 without one, at which all costs and their gradients are");
  }
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    cost.hessian_rows(x.data(), 0, hessian.data());
    std::vector<Real> step = gradient;
    solve_in_place(pattern, hessian, step);
    if (!is_finite(step)) break;
    if (largest_magnitude(step) <= enough * (1.0 + largest_magnitude(x))) {
      for (std::size_t p = 0; p < n; ++p) x[p] -= step[p];
      return x;
    }
    const Real before = norm(gradient);
    Real share = 1.0;
    for (int halving = 0;; ++halving, share *= 0.5) {
      if (halving == most_halvings) fail_to_converge();
      for (std::size_t p = 0; p < n; ++p) trial[p] = x[p] - share * step[p];
      cost.own_gradients(trial.data(), 0, gradient.data());
      if (is_finite(gradient) && norm(gradient) <= (1.0 - 0.1 * share) * before &&
          player_without_cost(cost, shape, trial, gradient) < 0) {
        break;
      }
    }
    x = trial;
  }
  fail_to_converge();
}

constexpr std::array starts_everywhere{0.0, 1.0, -1.0, 0.1, 10.0};

std::vector<Real> accepted(std::vector<Real> x, const Cost& cost, const Shape& shape) {
  std::vector<Real> hessian(at(cost.hessian_pattern().entries()));
  cost.hessian_rows(x.data(), 0, hessian.data());
  require_best_responses(cost.hessian_pattern(), hessian, shape);
  return x;
}

}  // namespace

std::vector<Real> nash_equilibrium(const Cost& cost, const Shape& shape, const std::vector<Real>& guess) {
  const std::size_t n = at(shape.actions());
  if (cost.is_affine()) return accepted(affine_equilibrium(cost, n), cost, shape);
  std::exception_ptr first_failure;
  std::vector<std::vector<Real>> starts;
  if (!guess.empty()) starts.push_back(guess);
  for (const Real everywhere : starts_everywhere) starts.emplace_back(n, everywhere);
  for (const std::vector<Real>& start : starts) {
    try {
      return accepted(search_from(cost, shape, start), cost, shape);
    } catch (const GameError&) {
      if (!first_failure) first_failure = std::current_exception();
    }
  }
  std::rethrow_exception(first_failure);
}

std::vector<std::vector<Real>> other_equilibria(const Cost& cost, const Shape& shape, const std::vector<Real>& x_star) {
  constexpr int patterns = 6;  // of signs
  constexpr Real apart = 1e-6;
  constexpr std::size_t large = 100;  // entries, from where a search takes long
  std::vector<std::vector<Real>> starts;
  for (const Real everywhere : starts_everywhere) starts.emplace_back(x_star.size(), everywhere);
  for (const Real times : {-2.0, -1.0, 0.25, 3.0}) {
    if (x_star.size() > large) break;
    starts.push_back(x_star);
    for (Real& action : starts.back()) action *= times;
  }
  for (int pattern = 0; pattern < patterns && x_star.size() <= large; ++pattern) {
    starts.push_back(x_star);
    for (std::size_t p = 0; p < x_star.size(); ++p) {
      const bool is_plus = ((p >> static_cast<unsigned>(pattern / 2)) + static_cast<std::size_t>(pattern)) % 2 == 0;
      starts.back()[p] += (is_plus ? 2.0 : -2.0) * (1.0 + std::abs(x_star[p]));
    }
  }
  std::vector<std::vector<Real>> found;
  const auto is_near = [](const std::vector<Real>& a, const std::vector<Real>& b) {
    Real distance = 0.0;
    for (std::size_t p = 0; p < a.size(); ++p) distance = std::max(distance, std::abs(a[p] - b[p]));
    return distance <= apart * (1.0 + largest_magnitude(b));
  };
  for (const std::vector<Real>& start : starts) {
    try {
      const std::vector<Real> x = accepted(search_from(cost, shape, start), cost, shape);
      const bool is_known = is_near(x, x_star) || std::any_of(found.begin(), found.end(),
                                                              [&](const auto& other) { return is_near(x, other); });
      if (!is_known) found.push_back(x);
    } catch (const GameError&) {
      continue;  // which leads nowhere
    }
  }
  return found;
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

OwnCurvature own_curvature(const Cost& cost, const Shape& shape, int i, const std::vector<Real>& x) {
  std::vector<Real> hessian(at(cost.hessian_pattern().entries()));
  cost.hessian_rows(x.data(), 0, hessian.data());
  return curvature_of(i, cost.hessian_pattern(), hessian, shape);
}

Real strong_monotonicity(const Cost& cost, const std::vector<Real>& x) {
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
