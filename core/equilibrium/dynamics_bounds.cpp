#include "equilibrium/dynamics_bounds.hpp"

#include <algorithm>

#include "families/polynomial_dynamics.hpp"

namespace mixed_order_game {

DynamicsBounds::DynamicsBounds(const Parameters& parameters, const std::vector<ExpressionCost::Text>& expressions)
    : parameters_(parameters) {
  const Shape& shape = parameters.shape;
  for (int i = 0; i < shape.players; ++i) {
    const auto& graph = expressions[at(shape.own_entry(i, 0))].graph;
    players_.push_back(graph == nullptr ? nullptr : std::make_unique<OfPlayer>(OfPlayer{*graph, {}, {}}));
    if (graph == nullptr) continue;
    OfPlayer& player = *players_.back();
    std::vector<int> of_values;
    std::vector<int> of_actions;
    std::vector<int> of_velocities;
    for (int l = 0; l < shape.dimension; ++l) {
      of_values.push_back(expressions[at(shape.own_entry(i, l))].node);
      for (const auto& [leaf, derivative] : player.graph.derivatives(of_values.back())) {
        if (leaf.kind == LeafKind::action) {
          of_actions.push_back(derivative);
          player.actions.place.emplace_back(l, leaf.index);
        } else if (leaf.kind == LeafKind::velocity) {
          of_velocities.push_back(derivative);
          player.velocities.place.emplace_back(l, leaf.index);
        }
      }
    }
    const auto make = [&](const std::vector<int>& of_derivatives, Derivatives& derivatives) {
      derivatives.leaves = Enclosure(player.graph, of_derivatives).leaves();
      std::vector<int> nodes = of_values;
      nodes.insert(nodes.end(), of_derivatives.begin(), of_derivatives.end());
      derivatives.enclosure.emplace(player.graph, nodes);
    };
    make(of_actions, player.actions);
    make(of_velocities, player.velocities);
  }
}

Enclosure::Found DynamicsBounds::along_actions(int i, const std::vector<Interval>& box, std::vector<Interval>& rows,
                                               std::vector<Interval>& values) const {
  const Shape& shape = parameters_.shape;
  const Coefficients& coefficients = parameters_.dynamics->coefficients;
  const std::size_t n = box.size();
  rows.assign(at(shape.dimension) * n, Interval::of(0.0));
  values.assign(at(shape.dimension), Interval::of(0.0));
  Enclosure::Found found;
  if (const OfPlayer* player = players_[at(i)].get(); player != nullptr) {
    found = enclose(player->actions, box, rows, values);
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

Enclosure::Found DynamicsBounds::along_velocities(int i, const std::vector<Interval>& box,
                                                  std::vector<Interval>& rows) const {
  const Shape& shape = parameters_.shape;
  rows.assign(at(shape.dimension) * at(shape.actions()), Interval::of(0.0));
  if (players_[at(i)] == nullptr || players_[at(i)]->velocities.place.empty()) return {};
  std::vector<Interval> values(at(shape.dimension));
  const Enclosure::Found found = enclose(players_[at(i)]->velocities, box, rows, values);
  const Interval gain = Interval::of(parameters_.dynamics->coefficients[PolynomialDynamics::gain][at(i)]);
  for (Interval& each : rows) each = gain * each;
  return found;
}

std::vector<int> DynamicsBounds::sides_along_actions(int i) const {
  const Shape& shape = parameters_.shape;
  std::vector<int> sides;
  if (players_[at(i)] != nullptr) {
    for (const Leaf& leaf : players_[at(i)]->actions.leaves) {
      if (leaf.kind == LeafKind::action) sides.push_back(leaf.index);
    }
  }
  for (const auto& [place, coefficient] : parameters_.dynamics->coefficients.terms(PolynomialDynamics::square)) {
    const int entry = place / shape.players;
    if (shape.player_of(entry) != i || coefficient == 0.0) continue;
    sides.push_back(shape.entry(place % shape.players, shape.coordinate_of(entry)));
  }
  std::sort(sides.begin(), sides.end());
  sides.erase(std::unique(sides.begin(), sides.end()), sides.end());
  return sides;
}

std::vector<int> DynamicsBounds::sides_along_velocities(int i) const {
  std::vector<int> sides;
  if (players_[at(i)] == nullptr) return sides;
  for (const Leaf& leaf : players_[at(i)]->velocities.leaves) {
    if (leaf.kind == LeafKind::action) sides.push_back(leaf.index);
    if (leaf.kind == LeafKind::velocity) sides.push_back(parameters_.shape.actions() + leaf.index);
  }
  return sides;
}

/// Velocities that the box has no sides for are 0.
Enclosure::Found DynamicsBounds::enclose(const Derivatives& derivatives, const std::vector<Interval>& box,
                                         std::vector<Interval>& rows, std::vector<Interval>& values) const {
  const std::size_t n = at(parameters_.shape.actions());
  std::vector<Interval> of_nodes;
  const Enclosure::Found found = derivatives.enclosure->evaluate(
      [&](const Leaf& leaf) {
        switch (leaf.kind) {
          case LeafKind::action:
            return box[at(leaf.index)];
          case LeafKind::velocity:
            return box.size() > n ? box[n + at(leaf.index)] : Interval::of(0.0);
          case LeafKind::parameter:
            return Interval::of(parameters_.dynamics->coefficients.named[at(leaf.index)]);
          default:
            return Interval{};
        }
      },
      of_nodes);
  std::copy_n(of_nodes.begin(), values.size(), values.begin());
  for (std::size_t k = 0; k < derivatives.place.size(); ++k) {
    const auto [l, column] = derivatives.place[k];
    rows[at(l) * n + at(column)] = of_nodes[values.size() + k];
  }
  return found;
}

}  // namespace mixed_order_game
