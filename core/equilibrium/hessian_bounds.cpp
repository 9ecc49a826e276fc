#include "equilibrium/hessian_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include "equilibrium/interval_matrix.hpp"

namespace mixed_order_game {

namespace {

/// Where a box is cut in two.
Real cut_of(const Interval& side) {
  if (std::isinf(side.lower) && std::isinf(side.upper)) return 0.0;
  if (std::isinf(side.upper)) return side.lower < 0.0 ? 0.0 : 2.0 * side.lower + 1.0;
  if (std::isinf(side.lower)) return side.upper > 0.0 ? 0.0 : 2.0 * side.upper - 1.0;
  return 0.5 * side.lower + 0.5 * side.upper;
}

}  // namespace

HessianBounds::HessianBounds(const Parameters& parameters, const std::vector<ExpressionCost::Text>& expressions)
    : parameters_(parameters), players_(expressions.size()) {
  const Shape& shape = parameters.shape;
  for (int i = 0; i < shape.players; ++i) {
    const auto& [graph, node] = expressions[at(i)];
    if (graph == nullptr) continue;
    players_[at(i)] = std::make_unique<OfPlayer>(OfPlayer{*graph, {}, {}});
    OfPlayer& player = *players_[at(i)];
    std::vector<int> own;
    std::vector<int> all;
    const auto add = [](int wanted, int l, int column, std::vector<int>& nodes, Derivatives& derivatives) {
      nodes.push_back(wanted);
      derivatives.place.emplace_back(l, column);
    };
    const auto add_to_both = [&](int wanted) {
      add(wanted, -1, 0, own, player.own);
      add(wanted, -1, 0, all, player.all);
    };
    add_to_both(node);
    for (const auto& [leaf, gradient] : player.graph.derivatives(node)) {
      if (leaf.kind != LeafKind::action || shape.player_of(leaf.index) != i) continue;
      add_to_both(gradient);
      const int l = shape.coordinate_of(leaf.index);
      for (const auto& [along, second] : player.graph.derivatives(gradient)) {
        if (along.kind != LeafKind::action) continue;
        add(second, l, along.index, all, player.all);
        if (shape.player_of(along.index) == i) add(second, l, along.index, own, player.own);
      }
    }
    const auto make = [&](const std::vector<int>& nodes, Derivatives& derivatives) {
      std::vector<int> second;
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        if (derivatives.place[k].first >= 0) second.push_back(nodes[k]);
      }
      for (const Leaf& leaf : Enclosure(player.graph, second).leaves()) {
        if (leaf.kind == LeafKind::action) derivatives.actions.push_back(leaf.index);
      }
      derivatives.enclosure.emplace(player.graph, nodes);
    };
    make(own, player.own);
    make(all, player.all);
  }
}

const Switch* HessianBounds::kink_at(int i, const std::vector<Real>& x) const {
  constexpr Real rounding = 1e-9;
  std::vector<Interval> box;
  for (const Real action : x) {
    const Real reach = rounding * (1.0 + std::abs(action));
    box.push_back({action - reach, action + reach});
  }
  std::vector<Interval> values;
  return rows(i, box, values).kink;
}

bool HessianBounds::has_affine_gradient(int i) const {
  if (players_[at(i)] == nullptr) return true;
  const OfPlayer& player = *players_[at(i)];
  if (!player.all.actions.empty() || !player.graph.switches().empty()) return false;
  constexpr Real infinite = std::numeric_limits<Real>::infinity();
  std::vector<Interval> values;
  const std::vector<Interval> everywhere(at(parameters_.shape.actions()), {-infinite, infinite});
  return rows(i, everywhere, values).definition == Enclosure::Definition::everywhere;
}

Enclosure::Found HessianBounds::rows(int i, const std::vector<Interval>& box, std::vector<Interval>& values) const {
  return enclose(i, Columns::all, box, values);
}

Enclosure::Found HessianBounds::own_rows(int i, const std::vector<Interval>& box, std::vector<Interval>& values) const {
  return enclose(i, Columns::own, box, values);
}

std::vector<int> HessianBounds::actions_of_rows(int i) const {
  return players_[at(i)] == nullptr ? std::vector<int>{} : players_[at(i)]->all.actions;
}

std::vector<int> HessianBounds::actions_of_own_rows(int i) const {
  return players_[at(i)] == nullptr ? std::vector<int>{} : players_[at(i)]->own.actions;
}

Enclosure::Found HessianBounds::enclose(int i, Columns columns, const std::vector<Interval>& box,
                                        std::vector<Interval>& values) const {
  const Shape& shape = parameters_.shape;
  const Coefficients& coefficients = parameters_.cost->coefficients;
  const std::size_t n = box.size();
  values.assign(at(shape.dimension) * n, Interval::of(0.0));
  // of the coefficients: 2 (q_i + sum_j c_ij) along the own action, -2 c_ij along those of others
  Interval own = Interval::of(coefficients.value(QuadraticCost::quadratic, i));
  for (int j = 0; j < shape.players; ++j) {
    const Real coupling = j == i ? 0.0 : coefficients.value(QuadraticCost::coupling, i * shape.players + j);
    if (coupling == 0.0) continue;
    own = own + Interval::of(coupling);
    for (int l = 0; l < shape.dimension; ++l) values[at(l) * n + at(shape.entry(j, l))] = Interval::of(-2.0 * coupling);
  }
  for (int l = 0; l < shape.dimension; ++l) values[at(l) * n + at(shape.entry(i, l))] = own * Interval::of(2.0);
  if (players_[at(i)] == nullptr) return {};
  const Derivatives& derivatives = columns == Columns::own ? players_[at(i)]->own : players_[at(i)]->all;
  std::vector<Interval> of_nodes;
  const Enclosure::Found found = derivatives.enclosure->evaluate(box, coefficients.named, of_nodes);
  if (found.definition == Enclosure::Definition::nowhere) return found;
  for (std::size_t k = 0; k < derivatives.place.size(); ++k) {
    const auto [l, column] = derivatives.place[k];
    if (l < 0) continue;
    Interval& value = values[at(l) * n + at(column)];
    value = value + of_nodes[k];
  }
  return found;
}

bool HessianBounds::is_positive_semidefinite(int i, const std::vector<Interval>& rows) const {
  const Shape& shape = parameters_.shape;
  const int D = shape.dimension;
  const std::size_t n = rows.size() / at(D);
  const auto entry = [&](int l, int h) -> const Interval& { return rows[at(l) * n + at(shape.entry(i, h))]; };
  // by Gershgorin's circles
  bool is_dominant = true;
  for (int l = 0; l < D; ++l) {
    Interval rest = Interval::of(entry(l, l).lower);
    for (int h = 0; h < D; ++h) {
      if (h != l) rest = rest - Interval::of(entry(l, h).magnitude());
    }
    is_dominant = is_dominant && rest.lower >= 0.0;
  }
  if (is_dominant || D == 1) return is_dominant;
  std::vector<Interval> own;
  for (int l = 0; l < D; ++l) {
    for (int h = 0; h < D; ++h) own.push_back(entry(l, h));
  }
  return least_eigenvalue(own, D) >= 0.0;
}

bool HessianBounds::is_convex(int i, const std::vector<Real>& x, Real distance) const {
  constexpr int most_boxes = 300;
  const Shape& shape = parameters_.shape;
  std::vector<Interval> whole;
  for (const Real action : x) whole.push_back(Interval::of(action));
  for (int l = 0; l < shape.dimension; ++l) {
    const Real own = x[at(shape.entry(i, l))];
    whole[at(shape.entry(i, l))] = {own - distance, own + distance};
  }
  struct Box {
    std::vector<Interval> actions;
    std::vector<int> cuts;  // along each coordinate
  };
  std::deque<Box> boxes{{whole, std::vector<int>(at(shape.dimension), 0)}};
  std::vector<Interval> hessian;
  for (int count = 0; !boxes.empty(); ++count) {
    if (count == most_boxes) return false;
    const Box box = std::move(boxes.front());
    boxes.pop_front();
    const Enclosure::Found found = enclose(i, Columns::own, box.actions, hessian);
    if (found.definition == Enclosure::Definition::nowhere) continue;
    const bool tells = found.definition != Enclosure::Definition::unknown && found.kink == nullptr;
    if (tells && is_positive_semidefinite(i, hessian)) continue;
    std::vector<Interval> middle = box.actions;
    for (int l = 0; l < shape.dimension; ++l) {
      const std::size_t own = at(shape.entry(i, l));
      middle[own] = Interval::of(cut_of(box.actions[own]));
    }
    const Enclosure::Found there = enclose(i, Columns::own, middle, hessian);
    if (there.definition == Enclosure::Definition::everywhere && there.kink == nullptr) {
      for (int l = 0; l < shape.dimension; ++l) {  // it curves downwards there
        if (hessian[at(l) * x.size() + at(shape.entry(i, l))].upper < 0.0) return false;
      }
    }
    const auto coordinate = std::min_element(box.cuts.begin(), box.cuts.end()) - box.cuts.begin();
    const std::size_t own = at(shape.entry(i, static_cast<int>(coordinate)));
    const Real cut = middle[own].lower;
    if (!(box.actions[own].lower < cut && cut < box.actions[own].upper)) return false;
    for (const bool first : {true, false}) {
      boxes.push_back(box);
      ++boxes.back().cuts[at(static_cast<int>(coordinate))];
      (first ? boxes.back().actions[own].upper : boxes.back().actions[own].lower) = cut;
    }
  }
  return true;
}

}  // namespace mixed_order_game
