// f_i(x) = q_i |x_i|^2 + l_i . x_i + const_i + sum_j c_ij |x_i - x_j|^2, the family of the paper's example.
#pragma once

#include "cost.hpp"

namespace mixed_order_game {

class QuadraticCost final : public Cost {
 public:
  QuadraticCost(int players, int dimension);

  /// Coefficients; call refresh() after changing any.
  std::vector<Real> quadratic;  ///< q_i at i
  std::vector<Real> linear;     ///< l_il at l * N + i
  std::vector<Real> constant;   ///< const_i at i
  std::vector<Real> coupling;   ///< c_ij at i * N + j, zero diagonal

  [[nodiscard]] std::unique_ptr<Cost> clone() const override;
  [[nodiscard]] Real value(int i, const Real* x) const override;
  void own_gradients(const Real* points, int stride, Real* gradient) const override;
  [[nodiscard]] const SparseRows& hessian_pattern() const override { return pattern_; }
  void hessian_rows(const Real* points, int stride, Real* values) const override;
  [[nodiscard]] std::unique_ptr<Cost> zero_direction() const override;
  void own_gradients_along(const Cost& direction, const Real* points, int stride, Real* derivative) const override;
  void refresh() override;

 private:
  int players_;
  int dimension_;
  SparseRows neighbours_;             // row i: the j with c_ij != 0
  std::vector<Real> neighbour_cost_;  // their c_ij
  SparseRows pattern_;
  std::vector<Real> hessian_;  // constant for this family
};

}  // namespace mixed_order_game
