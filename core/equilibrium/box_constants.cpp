#include "equilibrium/box_constants.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>

#include "equilibrium/dynamics_bounds.hpp"
#include "equilibrium/equilibrium.hpp"
#include "equilibrium/hessian_bounds.hpp"
#include "equilibrium/interval_matrix.hpp"
#include "expression/enclosure.hpp"
#include "families/sinusoidal_disturbance.hpp"

namespace mixed_order_game {

namespace {

using Box = std::vector<Interval>;
using Matrix = Eigen::MatrixXd;

constexpr Real infinite = std::numeric_limits<Real>::infinity();
constexpr int most_cut_sides = 40;  // that a quantity depends on, for the box to be cut
constexpr int most_parts = 20000;   // times sides
constexpr int most_corners = 200;
constexpr int most_points = 200;
constexpr Real close = 0.005;     // of proof and sample, relative, from where on no more is cut
constexpr Real rounding = 1e-13;  // relative, of a few operations

bool is_proof(const Enclosure::Found& found) {
  return found.definition == Enclosure::Definition::everywhere && found.kink == nullptr;
}

/// Of a box, with an upper bound of a quantity there.
struct Part {
  Box box;
  Real bound;
};

/// Covers a box by parts on which an upper bound of a quantity is close to the largest sample, as far as the work
/// allows: the part with the largest bound is cut along the side that moves it most, of those that it depends on.
std::vector<Part> parts_of(const Box& whole, const std::function<Real(const Box&)>& bound, Real sampled,
                           const std::vector<int>& sides) {
  const auto is_less = [](const Part& a, const Part& b) { return a.bound < b.bound; };
  std::vector<Part> parts{{whole, bound(whole)}};
  std::vector<Real> influence(whole.size(), 0.0);
  if (sides.size() <= at(most_cut_sides)) {
    for (const int p : sides) {
      if (whole[at(p)].is_point()) continue;
      Box fixed = whole;
      fixed[at(p)] = Interval::of(middle_of(whole[at(p)]));
      const Real drop = parts[0].bound - bound(fixed);
      influence[at(p)] = std::isfinite(drop) ? std::max(drop, 0.0) : std::isnan(drop) ? 0.0 : 1e300;
    }
    const Real largest = *std::max_element(influence.begin(), influence.end());
    for (const int p : sides) {
      if (!whole[at(p)].is_point()) influence[at(p)] = std::max({influence[at(p)], 1e-3 * largest, 1e-300});
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

Real norm_of(const Matrix& rows) {
  if (rows.rows() == 1) return rows.norm();
  return std::sqrt(
      std::max(0.0, Eigen::SelfAdjointEigenSolver<Matrix>(rows * rows.transpose()).eigenvalues()(rows.rows() - 1)));
}

/// Corners and points inside, always the same ones.
std::vector<std::vector<Real>> samples_of(const Box& box) {
  const bool is_large = box.size() > at(most_cut_sides);
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

/// Those of player i.
Matrix rows_of(const Matrix& matrix, int i, const Shape& shape) {
  Matrix rows(shape.dimension, matrix.cols());
  for (int l = 0; l < shape.dimension; ++l) rows.row(l) = matrix.row(shape.entry(i, l));
  return rows;
}

/// How to enclose a player's rows over a box, and the sides of the box that they depend on.
struct RowsOverBox {
  std::function<Enclosure::Found(int i, const Box& box, std::vector<Interval>& rows)> enclose;
  std::function<std::vector<int>(int i)> sides;
};

/// Narrows entries of D rows over the box by cutting it for each row alone, along what that row depends on.
void narrow_by_rows(int D, const Box& box, const std::function<bool(const Box&, std::vector<Interval>&)>& proved_rows,
                    const std::vector<int>& sides, std::vector<Interval>& narrowed) {
  const std::size_t n = narrowed.size() / at(D);
  std::vector<Interval> rows;
  for (int l = 0; l < D; ++l) {
    const auto row_of = [&] { return std::vector<Interval>(&rows[at(l) * n], &rows[at(l) * n] + n); };
    const auto bound = [&](const Box& part) { return proved_rows(part, rows) ? norm_bound(row_of(), 1) : infinite; };
    Real sampled = 0.0;
    for (const std::vector<Real>& point : samples_of(box)) {
      Box there;
      for (const Real action : point) there.push_back(Interval::of(action));
      if (proved_rows(there, rows)) sampled = std::max(sampled, norm_bound(row_of(), 1));
    }
    std::vector<Interval> hull(n, Interval::none());
    for (const Part& part : parts_of(box, bound, sampled, sides)) {
      if (!proved_rows(part.box, rows)) return;
      for (std::size_t k = 0; k < n; ++k) {
        const Interval& there = rows[at(l) * n + k];
        hull[k] = {std::min(hull[k].lower, there.lower), std::max(hull[k].upper, there.upper)};
      }
    }
    for (std::size_t k = 0; k < n; ++k) {
      Interval& entry = narrowed[at(l) * n + k];
      entry = {std::max(entry.lower, hull[k].lower), std::min(entry.upper, hull[k].upper)};
    }
  }
}

/// sampled[i] are the largest norms of samples. The box has a side for each action, and more when rows depend on more.
JacobianBounds jacobian_bounds(const Shape& shape, const Box& box, const std::vector<Real>& sampled,
                               const RowsOverBox& rows_over) {
  const int D = shape.dimension;
  const std::size_t n = at(shape.actions());
  JacobianBounds bounds;
  bounds.entries.assign(n * n, Interval::none());
  std::vector<Interval> rows;
  for (int i = 0; i < shape.players; ++i) {
    const auto proved_rows = [&](const Box& part, std::vector<Interval>& found) {
      return is_proof(rows_over.enclose(i, part, found));
    };
    const std::vector<int> sides = rows_over.sides(i);
    const auto bound = [&](const Box& part) { return proved_rows(part, rows) ? norm_bound(rows, D) : infinite; };
    Real proved = 0.0;
    std::vector<Interval> hull(at(D) * n, Interval::none());
    for (const Part& part : parts_of(box, bound, sampled[at(i)], sides)) {
      const bool is_proved = proved_rows(part.box, rows);
      proved = std::max(proved, part.bound);
      for (std::size_t k = 0; k < hull.size(); ++k) {
        if (!is_proved || !std::isfinite(proved)) {
          hull[k] = {};
        } else {
          hull[k] = {std::min(hull[k].lower, rows[k].lower), std::max(hull[k].upper, rows[k].upper)};
        }
      }
    }
    if (D > 1 && std::isfinite(proved) && proved > (1.0 + close) * sampled[at(i)]) {
      narrow_by_rows(D, box, proved_rows, sides, hull);
      proved = std::min(proved, norm_bound(hull, D));
    }
    for (int l = 0; l < D; ++l) {
      std::copy_n(hull.begin() + static_cast<std::ptrdiff_t>(at(l) * n), n,
                  bounds.entries.begin() + static_cast<std::ptrdiff_t>(at(shape.entry(i, l)) * n));
    }
    bounds.lipschitz.push_back({proved, sampled[at(i)]});
  }
  return bounds;
}

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
    return of_player + " may have points of the box without a value or a derivative";
  if (found.kink != nullptr) return of_player + " may switch in the box: \"" + found.kink->text + "\"";
  return of_player + " may have derivatives without a bound in the box";
}

/// A side for each action, then one for each velocity, which players of order 1 have none of.
Box with_speeds(const Box& box, const Shape& shape, Real speed) {
  Box both = box;
  for (int k = 0; k < shape.actions(); ++k) {
    both.push_back(shape.is_second_order(shape.player_of(k)) ? Interval{-speed, speed} : Interval::of(0.0));
  }
  return both;
}

/// Of g_i along velocities.
JacobianBounds velocity_bounds(const Parameters& parameters, const DynamicsBounds& dynamics, const Box& box,
                               Real speed) {
  const Shape& shape = parameters.shape;
  const Box both = with_speeds(box, shape, speed);
  std::vector<Real> sampled(at(shape.players), 0.0);
  const SparseRows& pattern = parameters.dynamics->velocity_pattern();
  std::vector<Real> entries(at(pattern.entries()));
  if (!entries.empty()) {
    for (const std::vector<Real>& point : samples_of(both)) {
      parameters.dynamics->velocity_jacobian(point.data(), point.data() + shape.actions(), entries.data());
      const Matrix change = full(pattern, entries, shape);
      for (int i = 0; i < shape.players; ++i) {
        const Matrix rows = rows_of(change, i, shape);
        if (rows.allFinite()) sampled[at(i)] = std::max(sampled[at(i)], norm_of(rows));
      }
    }
  }
  return jacobian_bounds(
      shape, both, sampled,
      {[&](int i, const Box& part, std::vector<Interval>& rows) { return dynamics.along_velocities(i, part, rows); },
       [&](int i) { return dynamics.sides_along_velocities(i); }});
}

/// Lower bound of the eigenvalues of the symmetric part of dP/dx: the block of each player's own actions is at least
/// the one in the middle of its entries, less what the box cut along the actions that the block depends on asks for;
/// the entries beside the blocks are anything within theirs.
Real least_by_blocks(const Shape& shape, const HessianBounds& hessian, const Box& box, std::vector<Interval> entries) {
  const int D = shape.dimension;
  const std::size_t n = box.size();
  std::vector<Interval> rows;
  std::vector<Interval> block(at(D) * at(D));
  for (int i = 0; i < shape.players; ++i) {
    const auto place = [&](int l, int h) { return at(shape.entry(i, l)) * n + at(shape.entry(i, h)); };
    std::vector<Real> middle;
    for (int l = 0; l < D; ++l) {
      for (int h = 0; h < D; ++h) middle.push_back(middle_of(entries[place(l, h)]));
    }
    const auto lacking = [&](const Box& part) {
      if (!is_proof(hessian.own_rows(i, part, rows))) return infinite;
      for (int l = 0; l < D; ++l) {
        for (int h = 0; h < D; ++h) {
          const std::size_t k = at(l * D + h);
          block[k] = rows[at(l) * n + at(shape.entry(i, h))] - Interval::of(middle[k]);
        }
      }
      return -least_eigenvalue(block, D);
    };
    Real sampled = -infinite;
    for (const std::vector<Real>& point : samples_of(box)) {
      Box there;
      for (const Real action : point) there.push_back(Interval::of(action));
      const Real found = lacking(there);
      if (std::isfinite(found)) sampled = std::max(sampled, found);
    }
    Real proved = -infinite;
    for (const Part& part : parts_of(box, lacking, sampled, hessian.actions_of_own_rows(i))) {
      proved = std::max(proved, part.bound);
    }
    if (!std::isfinite(proved)) return -infinite;
    for (int l = 0; l < D; ++l) {
      for (int h = 0; h < D; ++h) {
        const Interval least = Interval::of(middle[at(l * D + h)]);
        entries[place(l, h)] = l == h ? least - Interval::of(proved) : least;
      }
    }
  }
  return least_eigenvalue(entries, shape.actions());
}

}  // namespace

BoxConstants box_constants(const Parameters& parameters, const GameExpressions& expressions, const Box& box,
                           Real speed) {
  const Shape& shape = parameters.shape;
  const std::size_t n = box.size();
  const HessianBounds hessian(parameters, expressions.costs);
  const DynamicsBounds dynamics(parameters, expressions.dynamics);
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
    for (int i = 0; i < shape.players; ++i) {
      const Matrix of_cost = rows_of(gradient, i, shape);
      const Matrix of_term = rows_of(change, i, shape);
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
  constants.gradients = jacobian_bounds(
      shape, box, of_gradients,
      {[&](int i, const Box& part, std::vector<Interval>& found) { return hessian.rows(i, part, found); },
       [&](int i) { return hessian.actions_of_rows(i); }});
  std::vector<Interval> values;
  constants.dynamics = jacobian_bounds(shape, box, of_dynamics,
                                       {[&](int i, const Box& part, std::vector<Interval>& found) {
                                          return dynamics.along_actions(i, part, found, values);
                                        },
                                        [&](int i) { return dynamics.sides_along_actions(i); }});
  constants.velocities = velocity_bounds(parameters, dynamics, box, speed);
  std::vector<Interval> jacobian(n * n);
  const auto bound = [&](const Box& part) {
    for (int i = 0; i < shape.players; ++i) {
      if (!is_proof(hessian.rows(i, part, rows))) return infinite;
      for (int l = 0; l < shape.dimension; ++l) {
        std::copy_n(rows.begin() + static_cast<std::ptrdiff_t>(at(l) * n), n,
                    jacobian.begin() + static_cast<std::ptrdiff_t>(at(shape.entry(i, l)) * n));
      }
    }
    return -least_eigenvalue(jacobian, shape.actions());
  };
  Real proved = -infinite;
  std::vector<int> sides;
  for (int i = 0; i < shape.players; ++i) {
    const std::vector<int> own = hessian.actions_of_rows(i);
    sides.insert(sides.end(), own.begin(), own.end());
  }
  std::sort(sides.begin(), sides.end());
  sides.erase(std::unique(sides.begin(), sides.end()), sides.end());
  for (const Part& part : parts_of(box, bound, -least, sides)) {
    std::vector<Real> middle;
    for (const Interval& side : part.box) middle.push_back(middle_of(side));
    take(middle);
    proved = std::max(proved, part.bound);
  }
  constants.monotonicity = {-proved, least};
  if (-proved < least - close * std::abs(least)) {
    const Real by_blocks = least_by_blocks(shape, hessian, box, constants.gradients.entries);
    constants.monotonicity.proved = std::min(least, std::max(-proved, by_blocks));
  }
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
    const Enclosure::Found found = dynamics.along_actions(i, box, rows, values);
    if (!std::isfinite(constants.dynamics.lipschitz[at(i)].proved)) {
      constants.open.push_back(why_not("dynamics", i, found));
    } else if (!std::isfinite(constants.velocities.lipschitz[at(i)].proved)) {
      constants.open.push_back(
          why_not("dynamics", i, dynamics.along_velocities(i, with_speeds(box, shape, speed), rows)));
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
