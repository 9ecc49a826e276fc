// Costs with expressions: f_i is the quadratic cost of its coefficients plus the value of a text.
#pragma once

#include "expression/player_expressions.hpp"
#include "families/quadratic_cost.hpp"

namespace mixed_order_game {

class ExpressionCost final : public QuadraticCost {
 public:
  /// A graph and a node for each hosted player; null for players without an expression.
  struct Text {
    std::shared_ptr<ExpressionGraph> graph;
    int node = 0;
  };
  ExpressionCost(QuadraticCost quadratic_part, const Shape& shape, const std::vector<Text>& texts);

  [[nodiscard]] std::unique_ptr<Cost> clone() const override { return std::make_unique<ExpressionCost>(*this); }
  void refresh() override;
  [[nodiscard]] Real value(int i, const Real* x) const override;
  void own_gradients(const Real* points, int stride, Real* gradient, const Real* held = nullptr) const override;
  void own_gradients(const CoefficientsAs<Dual>& along, const Dual* points, int stride, Dual* gradient,
                     const Real* held = nullptr) const override;
  void own_gradients(const CoefficientsAs<Dependencies>& of, const Dependencies* points, int stride,
                     Dependencies* gradient) const override;
  [[nodiscard]] const SparseRows& hessian_pattern() const override { return pattern_; }
  void hessian_rows(const Real* points, int stride, Real* values, const Real* held = nullptr) const override;
  [[nodiscard]] bool is_affine() const override { return false; }
  [[nodiscard]] const Switching& switching() const override { return switching_; }

 private:
  [[nodiscard]] LeafValues leaves(const Real* points, int stride, const Real* held) const;

  int rows_;
  PlayerExpressions values_;     // f_i at host numbers
  PlayerExpressions gradients_;  // at own entries
  Switching switching_;
  SparseRows pattern_;  // of both together
  std::vector<int> quadratic_place_;
  std::vector<int> expression_place_;
  mutable std::vector<Real> scratch_;
  mutable std::vector<Real> held_there_;
};

}  // namespace mixed_order_game
