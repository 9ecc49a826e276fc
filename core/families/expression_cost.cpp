#include "families/expression_cost.hpp"

#include <algorithm>

namespace mixed_order_game {

ExpressionCost::ExpressionCost(QuadraticCost coefficients_of, const Shape& shape, const std::vector<Text>& texts)
    : QuadraticCost(std::move(coefficients_of)), rows_(shape.hosts()) {
  const auto parameters = static_cast<int>(coefficients.named.size());
  values_ = PlayerExpressions(shape.hosts(), shape.hosts(), shape.actions(), parameters);
  gradients_ = PlayerExpressions(shape.own_entries(), shape.hosts(), shape.actions(), parameters);
  std::vector<Switching::OfPlayer> graphs;
  for (int h = 0; h < shape.hosts(); ++h) {
    const auto& [graph, node] = texts[at(h)];
    if (graph == nullptr) continue;
    graphs.push_back({h, shape.host(h), graph});
    values_.add(h, h, graph, node);
    const auto derivatives = graph->derivatives(node);
    for (int l = 0; l < shape.dimension; ++l) {
      const Leaf own{LeafKind::action, shape.entry(shape.host(h), l)};
      const auto found =
          std::find_if(derivatives.begin(), derivatives.end(), [&](const auto& along) { return along.first == own; });
      if (found != derivatives.end()) gradients_.add(shape.own_entry(h, l), h, graph, found->second);
    }
  }
  values_.compile();
  gradients_.compile();
  switching_ = Switching(graphs, "cost", shape.hosts(), shape.actions(), parameters);
  held_there_.resize(at(switching_.count()));
  refresh();
}

LeafValues ExpressionCost::leaves(const Real* points, int stride, const Real* held) const {
  LeafValues leaves{.points = points, .stride = stride, .parameters = coefficients.named.data(), .held = held};
  if (held == nullptr && switching_.count() != 0) {
    switching_.own_values(leaves, 0.0, 0.0, held_there_.data());
    leaves.held = held_there_.data();
  }
  return leaves;
}

Real ExpressionCost::value(int i, const Real* x) const {
  scratch_.assign(at(values_.pattern(LeafKind::action).rows()), 0.0);
  const int h = shape().host_number(i);
  values_.value_of_player(h, leaves(x, 0, nullptr), scratch_.data());
  return QuadraticCost::value(i, x) + scratch_[at(h)];
}

void ExpressionCost::own_gradients(const Real* points, int stride, Real* gradient, const Real* held) const {
  const std::size_t n = at(pattern_.rows());
  if (has_no_gradients()) {
    std::fill_n(gradient, n, 0.0);
    gradients_.values(leaves(points, stride, held), gradient);
    return;
  }
  QuadraticCost::own_gradients(points, stride, gradient);
  scratch_.assign(n, 0.0);
  gradients_.values(leaves(points, stride, held), scratch_.data());
  for (std::size_t p = 0; p < n; ++p) gradient[p] += scratch_[p];
}

void ExpressionCost::own_gradients(const CoefficientsAs<Dual>& along, const Dual* points, int stride, Dual* gradient,
                                   const Real* held) const {
  QuadraticCost::own_gradients(along, points, stride, gradient);
  if (held == nullptr && switching_.count() != 0) {
    std::vector<Real> values(at(stride * (rows_ - 1) + shape().actions()));
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = points[k].value;
    held = leaves(values.data(), stride, nullptr).held;
  }
  gradients_.add_values({.points = points, .stride = stride, .coefficients = &along, .held = held}, gradient);
}

void ExpressionCost::own_gradients(const CoefficientsAs<Dependencies>& of, const Dependencies* points, int stride,
                                   Dependencies* gradient) const {
  QuadraticCost::own_gradients(of, points, stride, gradient);
  gradients_.add_values({.points = points, .stride = stride, .coefficients = &of}, gradient);
}

void ExpressionCost::refresh() {
  QuadraticCost::refresh();
  if (gradients_.pattern(LeafKind::action).rows() == 0) return;  // the base class is being made
  unite(QuadraticCost::hessian_pattern(), gradients_.pattern(LeafKind::action), pattern_, quadratic_place_,
        expression_place_);
}

void ExpressionCost::hessian_rows(const Real* points, int stride, Real* values, const Real* held) const {
  std::fill_n(values, pattern_.entries(), 0.0);
  scratch_.resize(std::max(quadratic_place_.size(), expression_place_.size()));
  QuadraticCost::hessian_rows(points, stride, scratch_.data());
  for (std::size_t k = 0; k < quadratic_place_.size(); ++k) values[quadratic_place_[k]] += scratch_[k];
  gradients_.derivatives(LeafKind::action, leaves(points, stride, held), scratch_.data());
  for (std::size_t k = 0; k < expression_place_.size(); ++k) values[expression_place_[k]] += scratch_[k];
}

}  // namespace mixed_order_game
