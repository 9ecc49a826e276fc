#include "families/expression_cost.hpp"

#include <algorithm>

namespace mixed_order_game {

ExpressionCost::ExpressionCost(QuadraticCost coefficients_of, const Shape& shape, const std::vector<Text>& texts)
    : QuadraticCost(std::move(coefficients_of)) {
  const auto parameters = static_cast<int>(coefficients.named.size());
  values_ = PlayerExpressions(shape.players, shape.players, shape.actions(), parameters);
  gradients_ = PlayerExpressions(shape.actions(), shape.players, shape.actions(), parameters);
  for (int i = 0; i < shape.players; ++i) {
    const auto& [graph, node] = texts[at(i)];
    if (graph == nullptr) continue;
    values_.add(i, i, graph, node);
    const auto derivatives = graph->derivatives(node);
    for (int l = 0; l < shape.dimension; ++l) {
      const Leaf own{LeafKind::action, shape.entry(i, l)};
      const auto found =
          std::find_if(derivatives.begin(), derivatives.end(), [&](const auto& along) { return along.first == own; });
      if (found != derivatives.end()) gradients_.add(own.index, i, graph, found->second);
    }
  }
  values_.compile();
  gradients_.compile();
  refresh();
}

Real ExpressionCost::value(int i, const Real* x) const {
  scratch_.assign(at(values_.pattern(LeafKind::action).rows()), 0.0);
  values_.value_of_player(i, leaves(x, 0), scratch_.data());
  return QuadraticCost::value(i, x) + scratch_[at(i)];
}

void ExpressionCost::own_gradients(const Real* points, int stride, Real* gradient) const {
  QuadraticCost::own_gradients(points, stride, gradient);
  const std::size_t n = at(pattern_.rows());
  scratch_.assign(n, 0.0);
  gradients_.values(leaves(points, stride), scratch_.data());
  for (std::size_t p = 0; p < n; ++p) gradient[p] += scratch_[p];
}

void ExpressionCost::own_gradients(const CoefficientsAs<Dual>& along, const Dual* points, int stride,
                                   Dual* gradient) const {
  QuadraticCost::own_gradients(along, points, stride, gradient);
  gradients_.add_values({.points = points, .stride = stride, .coefficients = &along}, gradient);
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

void ExpressionCost::hessian_rows(const Real* points, int stride, Real* values) const {
  std::fill_n(values, pattern_.entries(), 0.0);
  scratch_.resize(std::max(quadratic_place_.size(), expression_place_.size()));
  QuadraticCost::hessian_rows(points, stride, scratch_.data());
  for (std::size_t k = 0; k < quadratic_place_.size(); ++k) values[quadratic_place_[k]] += scratch_[k];
  gradients_.derivatives(LeafKind::action, leaves(points, stride), scratch_.data());
  for (std::size_t k = 0; k < expression_place_.size(); ++k) values[expression_place_[k]] += scratch_[k];
}

}  // namespace mixed_order_game
