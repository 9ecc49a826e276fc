// f_i(x) = q_i |x_i|^2 + l_i . x_i + const_i + sum_j c_ij |x_i - x_j|^2, the family of the paper's example.
#pragma once

#include "families/cost.hpp"

namespace mixed_order_game {

class QuadraticCost : public Cost {
 public:
  enum Number { quadratic, linear, constant, coupling };  ///< q_i, l_il, const_i, c_ij

  explicit QuadraticCost(const Shape& shape);

  [[nodiscard]] std::unique_ptr<Cost> clone() const override;
  void refresh() override;
  [[nodiscard]] Real value(int i, const Real* x) const override;
  void own_gradients(const Real* points, int stride, Real* gradient, const Real* held = nullptr) const override;
  void own_gradients(const CoefficientsAs<Dual>& along, const Dual* points, int stride, Dual* gradient,
                     const Real* held = nullptr) const override;
  void own_gradients(const CoefficientsAs<Dependencies>& of, const Dependencies* points, int stride,
                     Dependencies* gradient) const override;
  [[nodiscard]] const SparseRows& hessian_pattern() const override { return pattern_; }
  void hessian_rows(const Real* points, int stride, Real* values, const Real* held = nullptr) const override;
  [[nodiscard]] bool is_affine() const override { return true; }

 protected:
  [[nodiscard]] const Shape& shape() const { return shape_; }
  /// Whether all of its gradients are zero, whatever the actions.
  [[nodiscard]] bool has_no_gradients() const { return has_no_gradients_; }

 private:
  template <typename Scalar>
  void own_gradients_as(const CoefficientsAs<Scalar>& coefficients, const Scalar* points, int stride,
                        Scalar* gradient) const;

  Shape shape_;
  std::vector<int> host_;             // player h of the hosted ones
  SparseRows neighbours_;             // row h: the j with c_ij != 0 of i = host(h)
  std::vector<Real> neighbour_cost_;  // their c_ij
  SparseRows pattern_;
  std::vector<Real> hessian_;  // constant for this family
  bool has_no_gradients_ = false;
};

}  // namespace mixed_order_game
