#include "equilibrium/box_constants.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>

#include "equilibrium/equilibrium.hpp"
#include "equilibrium/hessian_bounds.hpp"
#include "families/polynomial_dynamics.hpp"
#include "families/sinusoidal_disturbance.hpp"

namespace mixed_order_game {

namespace {

using Box = std::vector<Interval>;
using Matrix = Eigen::MatrixXd;

constexpr Real infinite = std::numeric_limits<Real>::infinity();
constexpr int most_cut_actions = 40;  // of games whose boxes are cut
constexpr int most_parts = 20000;     // times actions
constexpr int most_corners = 200;
constexpr int most_points = 200;
constexpr Real close = 0.005;  // of proof and sample, relative, from where on no more is cut

/// Rounding of Eigen's eigenvalues and norms, relative to the matrix.
constexpr Real rounding = 1e-13;

bool is_proof(const Enclosure::Found& found) {
  return found.definition == Enclosure::Definition::everywhere && found.kink == nullptr;
}

Real middle_of(const Interval& side) { return 0.5 * side.lower + 0.5 * side.upper; }

/// Of a box, with an upper bound of a quantity there.
struct Part {
  Box box;
  Real bound;
};

/// Covers a box by parts on which an upper bound of a quantity is close to the largest sample, as far as the work
/// allows: the part with the largest bound is cut along the action that moves it most.
std::vector<Part> parts_of(const Box& whole, const std::function<Real(const Box&)>& bound, Real sampled) {
  const auto is_less = [](const Part& a, const Part& b) { return a.bound < b.bound; };
  std::vector<Part> parts{{whole, bound(whole)}};
  std::vector<Real> influence(whole.size(), 0.0);
  if (whole.size() <= at(most_cut_actions)) {
    for (std::size_t p = 0; p < whole.size(); ++p) {
      if (whole[p].is_point()) continue;
      Box fixed = whole;
      fixed[p] = Interval::of(middle_of(whole[p]));
      const Real drop = parts[0].bound - bound(fixed);
      influence[p] = std::isfinite(drop) ? std::max(drop, 0.0) : std::isnan(drop) ? 0.0 : 1e300;
    }
    const Real largest = *std::max_element(influence.begin(), influence.end());
    for (std::size_t p = 0; p < whole.size(); ++p) {
      if (!whole[p].is_point()) influence[p] = std::max({influence[p], 1e-3 * largest, 1e-300});
    }
  }
  const int most = std::max(300, most_parts / static_cast<int>(whole.size()));
  for (int count = 1; count < most; ++count) {
    const Part& worst = parts.front();
    if (worst.bound <= sampled + close * std::abs(sampled)) break;
    std::size_t cut = 0;
    Real largest = 0.0;
    for (std::size_t p = 0; p < whole.size(); ++p) {
      const Real share = (worst.box[p].upper - worst.box[p].lower) / (whole[p].upper - whole[p].lower);
      if (influence[p] > 0.0 && influence[p] * share > largest) {
        largest = influence[p] * share;
        cut = p;
      }
    }
    const Real middle = middle_of(worst.box[cut]);
    if (largest == 0.0 || !(worst.box[cut].lower < middle && middle < worst.box[cut].upper)) break;
    std::pop_heap(parts.begin(), parts.end(), is_less);
    const Part whole_part = std::move(parts.back());
    parts.pop_back();
    for (const bool first : {true, false}) {
      Box half = whole_part.box;
      (first ? half[cut].upper : half[cut].lower) = middle;
      const Real bound_there = std::min(whole_part.bound, bound(half));  // that of a smaller box may be the larger one
      parts.push_back({std::move(half), bound_there});
      std::push_heap(parts.begin(), parts.end(), is_less);
    }
  }
  return parts;
}

/// An upper bound of the 2-norms of all matrices of D x n intervals.
Real norm_bound(const std::vector<Interval>& rows, int D) {
  const auto n = static_cast<Eigen::Index>(rows.size()) / D;
  Matrix magnitude(D, n);
  Matrix middle(D, n);
  Matrix radius(D, n);
  for (Eigen::Index l = 0; l < D; ++l) {
    for (Eigen::Index k = 0; k < n; ++k) {
      const Interval& entry = rows[at(static_cast<int>(l * n + k))];
      magnitude(l, k) = entry.magnitude();
      middle(l, k) = middle_of(entry);
      radius(l, k) = std::max(entry.upper - middle(l, k), middle(l, k) - entry.lower);
    }
  }
  if (!magnitude.allFinite()) return infinite;
  const auto norm = [](const Matrix& matrix) {
    return matrix.rows() == 1 ? matrix.norm()
                              : std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Matrix>(
                                                            matrix * matrix.transpose(), Eigen::EigenvaluesOnly)
                                                            .eigenvalues()
                                                            .maxCoeff()));
  };
  const Real least = D == 1 ? norm(magnitude) : std::min(norm(magnitude), norm(middle) + radius.norm());
  return least * (1.0 + 10.0 * rounding);
}

/// Lower bound of the eigenvalues of the symmetric parts of all matrices of intervals: that of the one in the middle,
/// less the norm of what the others differ by. The norm of a matrix R without negative entries is at most that of max_k
/// (R v)_k / v_k with any positive v.
Real least_eigenvalue(const std::vector<Interval>& entries, Eigen::Index n) {
  Matrix middle(n, n);
  Matrix radius(n, n);
  for (Eigen::Index p = 0; p < n; ++p) {
    for (Eigen::Index k = 0; k <= p; ++k) {
      const Interval one = entries[at(static_cast<int>(p * n + k))] + entries[at(static_cast<int>(k * n + p))];
      middle(p, k) = middle(k, p) = 0.5 * middle_of(one);
      radius(p, k) = radius(k, p) =
          0.5 * std::max(one.upper - middle_of(one), middle_of(one) - one.lower) * (1.0 + rounding);
    }
  }
  if (!middle.allFinite() || !radius.allFinite()) return -infinite;
  Eigen::VectorXd v = Eigen::VectorXd::Ones(n);
  Real norm = radius.maxCoeff() == 0.0 ? 0.0 : infinite;
  for (int sweep = 0; sweep < 20 && norm > 0.0; ++sweep) {
    const Eigen::VectorXd next = radius * v;
    norm = std::min(norm, next.cwiseQuotient(v).maxCoeff());
    v = next + Eigen::VectorXd::Constant(n, 1e-3 * next.maxCoeff());
    v /= v.maxCoeff();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(middle, Eigen::EigenvaluesOnly);
  const Real scale = middle.cwiseAbs().rowwise().sum().maxCoeff();
  return solver.eigenvalues()(0) - norm * (1.0 + rounding) - rounding * static_cast<Real>(n) * scale;
}

Real norm_of(const Matrix& rows) {
  if (rows.rows() == 1) return rows.norm();
  return std::sqrt(
      std::max(0.0, Eigen::SelfAdjointEigenSolver<Matrix>(rows * rows.transpose()).eigenvalues()(rows.rows() - 1)));
}

/// Corners and points inside, always the same ones.
std::vector<std::vector<Real>> samples_of(const Box& box) {
  const bool is_large = box.size() > at(most_cut_actions);
  std::mt19937_64 random(1);  // NOLINT(bugprone-random-generator-seed): the same points in every run
  const auto share = [&] { return std::ldexp(static_cast<Real>(random() >> 11U), -53); };
  std::vector<std::vector<Real>> points(1);
  for (const Interval& side : box) points[0].push_back(middle_of(side));
  for (int corner = 0; corner < (is_large ? 4 : most_corners); ++corner) {
    points.emplace_back();
    for (std::size_t p = 0; p < box.size(); ++p) {
      const bool is_upper = p < 7 ? ((static_cast<unsigned>(corner) >> p) & 1U) != 0 : share() < 0.5;
      points.back().push_back(is_upper ? box[p].upper : box[p].lower);
    }
  }
  for (int point = 0; point < (is_large ? 4 : most_points); ++point) {
    points.emplace_back();
    for (const Interval& side : box) {
      points.back().push_back(std::clamp(side.lower + share() * (side.upper - side.lower), side.lower, side.upper));
    }
  }
  return points;
}

/// The sparse rows of a map at a point as one full matrix, its rows at entry(i, l).
Matrix full(const SparseRows& pattern, const std::vector<Real>& values, const Shape& shape) {
  const auto n = static_cast<Eigen::Index>(shape.actions());
  Matrix matrix = Matrix::Zero(n, n);
  for (int row = 0; row < pattern.rows(); ++row) {
    for (int k = pattern.start[at(row)]; k < pattern.start[at(row + 1)]; ++k) {
      matrix(shape.entry_of_own(row), pattern.column[at(k)]) = values[at(k)];
    }
  }
  return matrix;
}

using RowsOverBox = std::function<Enclosure::Found(int i, const Box& box, std::vector<Interval>& rows)>;

/// sampled[i] are the largest norms of samples.
JacobianBounds jacobian_bounds(const Shape& shape, const Box& box, const std::vector<Real>& sampled,
                               const RowsOverBox& rows_over) {
  const int D = shape.dimension;
  const std::size_t n = box.size();
  JacobianBounds bounds;
  bounds.entries.assign(n * n, Interval::none());
  std::vector<Interval> rows;
  for (int i = 0; i < shape.players; ++i) {
    const auto bound = [&](const Box& part) {
      return is_proof(rows_over(i, part, rows)) ? norm_bound(rows, D) : infinite;
    };
    Real proved = 0.0;
    for (const Part& part : parts_of(box, bound, sampled[at(i)])) {
      const bool is_proved = is_proof(rows_over(i, part.box, rows));
      proved = std::max(proved, part.bound);
      for (int l = 0; l < D; ++l) {
        for (std::size_t k = 0; k < n; ++k) {
          Interval& entry = bounds.entries[at(shape.entry(i, l)) * n + k];
          const Interval& there = rows[at(l) * n + k];
          if (!is_proved || !std::isfinite(proved)) {
            entry = {};
          } else {
            entry = {std::min(entry.lower, there.lower), std::max(entry.upper, there.upper)};
          }
        }
      }
    }
    bounds.lipschitz.push_back({proved, sampled[at(i)]});
  }
  return bounds;
}

/// Encloses g_i and its derivatives along actions.
class DynamicsRows {
 public:
  DynamicsRows(const Parameters& parameters, const std::vector<ExpressionCost::Text>& texts) : parameters_(parameters) {
    const Shape& shape = parameters.shape;
    for (int i = 0; i < shape.players; ++i) {
      const auto& graph = texts[at(shape.own_entry(i, 0))].graph;
      players_.push_back(graph == nullptr ? nullptr : std::make_unique<OfPlayer>(OfPlayer{*graph, {}, {}, false}));
      if (graph == nullptr) continue;
      OfPlayer& player = *players_.back();
      std::vector<int> nodes;
      for (int l = 0; l < shape.dimension; ++l) nodes.push_back(texts[at(shape.own_entry(i, l))].node);
      for (int l = 0; l < shape.dimension; ++l) {
        for (const auto& [leaf, derivative] : player.graph.derivatives(nodes[at(l)])) {
          player.uses_velocities = player.uses_velocities || leaf.kind == LeafKind::velocity;
          if (leaf.kind != LeafKind::action) continue;
          nodes.push_back(derivative);
          player.place.emplace_back(l, leaf.index);
        }
      }
      player.enclosure.emplace(player.graph, nodes);
    }
  }

  [[nodiscard]] bool uses_velocities(int i) const {
    return players_[at(i)] != nullptr && players_[at(i)]->uses_velocities;
  }

  /// g_il at values[l], d g_il / d x_k at rows[l n + k].
  Enclosure::Found operator()(int i, const Box& box, std::vector<Interval>& rows, std::vector<Interval>& values) const {
    const Shape& shape = parameters_.shape;
    const Coefficients& coefficients = parameters_.dynamics->coefficients;
    const std::size_t n = box.size();
    rows.assign(at(shape.dimension) * n, Interval::of(0.0));
    values.assign(at(shape.dimension), Interval::of(0.0));
    Enclosure::Found found;
    if (const OfPlayer* player = players_[at(i)].get(); player != nullptr) {
      std::vector<Interval> of_nodes;
      found = player->enclosure->evaluate(box, coefficients.named, of_nodes);
      std::copy_n(of_nodes.begin(), shape.dimension, values.begin());
      for (std::size_t k = 0; k < player->place.size(); ++k) {
        const auto [l, column] = player->place[k];
        rows[at(l) * n + at(column)] = of_nodes[at(shape.dimension) + k];
      }
    }
    const auto add_terms = [&](int number, const auto& value, const auto& slope) {
      for (int l = 0; l < shape.dimension; ++l) {
        const int first = shape.entry(i, l) * shape.players;
        const auto& terms = coefficients.terms(number);
        for (auto term = terms.lower_bound(first); term != terms.end() && term->first < first + shape.players; ++term) {
          const int column = shape.entry(term->first - first, l);
          const Interval& x = box[at(column)];
          values[at(l)] = values[at(l)] + Interval::of(term->second) * value(x);
          rows[at(l) * n + at(column)] = rows[at(l) * n + at(column)] + Interval::of(term->second) * slope(x);
        }
      }
    };
    add_terms(
        PolynomialDynamics::linear, [](const Interval& x) { return x; },
        [](const Interval&) { return Interval::of(1.0); });
    add_terms(
        PolynomialDynamics::square, [](const Interval& x) { return squared(x); },
        [](const Interval& x) { return Interval::of(2.0) * x; });
    const Interval gain = Interval::of(coefficients[PolynomialDynamics::gain][at(i)]);
    for (Interval& each : rows) each = gain * each;
    for (Interval& each : values) each = gain * each;
    return found;
  }

 private:
  struct OfPlayer {
    ExpressionGraph graph;
    std::optional<Enclosure> enclosure;
    std::vector<std::pair<int, int>> place;  // l and column of the derivatives, which come after the values
    bool uses_velocities;
  };
  const Parameters& parameters_;
  std::vector<std::unique_ptr<OfPlayer>> players_;  // null without an expression
};

/// |d_il(t)| for all t >= 0.
Real disturbance_size(const Parameters& parameters, const ExpressionCost::Text& text, int entry) {
  const Coefficients& coefficients = parameters.disturbance->coefficients;
  const Real wave = std::abs(coefficients.value(SinusoidalDisturbance::amplitude, entry)) +
                    std::abs(coefficients.value(SinusoidalDisturbance::bias, entry));
  if (text.graph == nullptr) return wave;
  std::vector<Interval> value;
  const Enclosure::Found found = Enclosure(*text.graph, {text.node})
                                     .evaluate(
                                         [&](const Leaf& leaf) {
                                           return leaf.kind == LeafKind::parameter
                                                      ? Interval::of(coefficients.named[at(leaf.index)])
                                                      : Interval{0.0, infinite};
                                         },
                                         value);
  if (found.definition != Enclosure::Definition::everywhere) return infinite;
  return (wave + value[0].magnitude()) * (1.0 + rounding);
}

std::string why_not(const char* what, int i, const Enclosure::Found& found) {
  const std::string of_player = std::string("the ") + what + " of player " + std::to_string(i + 1);
  if (found.definition != Enclosure::Definition::everywhere)
    return of_player + " may have points of the box without a value";
  if (found.kink != nullptr) return of_player + " may switch in the box: \"" + found.kink->text + "\"";
  return of_player + " may have derivatives without a bound in the box";
}

}  // namespace

BoxConstants box_constants(const Parameters& parameters, const GameExpressions& expressions, const Box& box) {
  const Shape& shape = parameters.shape;
  const std::size_t n = box.size();
  const HessianBounds hessian(parameters, expressions.costs);
  const DynamicsRows dynamics(parameters, expressions.dynamics);
  BoxConstants constants;

  // samples
  std::vector<Real> of_gradients(at(shape.players), 0.0);
  std::vector<Real> of_dynamics = of_gradients;
  Real least = infinite;
  const SparseRows& costs = parameters.cost->hessian_pattern();
  const SparseRows& terms = parameters.dynamics->jacobian_pattern();
  std::vector<Real> cost_entries(at(costs.entries()));
  std::vector<Real> term_entries(at(terms.entries()));
  const std::vector<Real> at_rest(n, 0.0);
  const auto take = [&](const std::vector<Real>& x) {
    parameters.cost->hessian_rows(x.data(), 0, cost_entries.data());
    parameters.dynamics->jacobian(x.data(), at_rest.data(), term_entries.data());
    const Matrix gradient = full(costs, cost_entries, shape);
    const Matrix change = full(terms, term_entries, shape);
    const auto own = [&](const Matrix& matrix, int i) {
      Matrix rows(shape.dimension, matrix.cols());
      for (int l = 0; l < shape.dimension; ++l) rows.row(l) = matrix.row(shape.entry(i, l));
      return rows;
    };
    for (int i = 0; i < shape.players; ++i) {
      const Matrix of_cost = own(gradient, i);
      const Matrix of_term = own(change, i);
      if (of_cost.allFinite()) of_gradients[at(i)] = std::max(of_gradients[at(i)], norm_of(of_cost));
      if (of_term.allFinite()) of_dynamics[at(i)] = std::max(of_dynamics[at(i)], norm_of(of_term));
    }
    if (!gradient.allFinite()) return;
    const Matrix symmetric = 0.5 * (gradient + gradient.transpose());
    least = std::min(least, Eigen::SelfAdjointEigenSolver<Matrix>(symmetric, Eigen::EigenvaluesOnly).eigenvalues()(0));
  };
  for (const std::vector<Real>& x : samples_of(box)) take(x);

  // proofs
  std::vector<Interval> rows;
  const auto of_cost = [&](int i, const Box& part, std::vector<Interval>& found) {
    return hessian.rows(i, part, found);
  };
  constants.gradients = jacobian_bounds(shape, box, of_gradients, of_cost);
  std::vector<Interval> values;
  constants.dynamics = jacobian_bounds(
      shape, box, of_dynamics,
      [&](int i, const Box& part, std::vector<Interval>& found) { return dynamics(i, part, found, values); });
  std::vector<Interval> jacobian(n * n);
  const auto bound = [&](const Box& part) {
    for (int i = 0; i < shape.players; ++i) {
      if (!is_proof(hessian.rows(i, part, rows))) return infinite;
      for (int l = 0; l < shape.dimension; ++l) {
        std::copy_n(rows.begin() + static_cast<std::ptrdiff_t>(at(l) * n), n,
                    jacobian.begin() + static_cast<std::ptrdiff_t>(at(shape.entry(i, l)) * n));
      }
    }
    return -least_eigenvalue(jacobian, static_cast<Eigen::Index>(n));
  };
  Real proved = -infinite;
  for (const Part& part : parts_of(box, bound, -least)) {
    std::vector<Real> middle;
    for (const Interval& side : part.box) middle.push_back(middle_of(side));
    take(middle);
    proved = std::max(proved, part.bound);
  }
  constants.monotonicity = {-proved, least};
  for (int i = 0; i < shape.players; ++i) {
    constants.gradients.lipschitz[at(i)].sampled = of_gradients[at(i)];
    constants.dynamics.lipschitz[at(i)].sampled = of_dynamics[at(i)];
  }

  constants.dynamics_size.assign(n, infinite);
  constants.disturbance_size.assign(n, infinite);
  for (int i = 0; i < shape.players; ++i) {
    if (!std::isfinite(constants.gradients.lipschitz[at(i)].proved)) {
      constants.open.push_back(why_not("cost", i, hessian.rows(i, box, rows)));
    }
    const Enclosure::Found found = dynamics(i, box, rows, values);
    if (dynamics.uses_velocities(i)) {
      constants.dynamics.lipschitz[at(i)].proved = infinite;
      constants.open.push_back("the dynamics of player " + std::to_string(i + 1) + " depend on velocities");
    } else if (!std::isfinite(constants.dynamics.lipschitz[at(i)].proved)) {
      constants.open.push_back(why_not("dynamics", i, found));
    }
    for (int l = 0; l < shape.dimension; ++l) {
      const int entry = shape.entry(i, l);
      if (found.definition == Enclosure::Definition::everywhere) {
        constants.dynamics_size[at(entry)] = values[at(l)].magnitude();
      }
      constants.disturbance_size[at(entry)] =
          disturbance_size(parameters, expressions.disturbances[at(shape.own_entry(i, l))], entry);
      if (!std::isfinite(constants.disturbance_size[at(entry)])) {
        constants.open.push_back("the disturbance of player " + std::to_string(i + 1) + ", coordinate " +
                                 std::to_string(l + 1) + " has no bound that is proved");
      }
    }
  }
  return constants;
}

}  // namespace mixed_order_game
