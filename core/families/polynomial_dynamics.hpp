// g_i(x)_l = gain_i sum_j (G_ijl x_jl + H_ijl x_jl^2), the family of the paper's example.
#pragma once

#include "families/unknown_dynamics.hpp"

namespace mixed_order_game {

class PolynomialDynamics : public UnknownDynamics {
 public:
  enum Number { linear, square, gain };  ///< G_ijl, H_ijl, gain_i

  explicit PolynomialDynamics(const Shape& shape);

  [[nodiscard]] std::unique_ptr<UnknownDynamics> clone() const override;
  void refresh() override;
  void values(const Real* x, const Real* v, Real* g, const Real* held = nullptr) const override;
  void values(const CoefficientsAs<Dual>& along, const Dual* x, const Dual* v, Dual* g,
              const Real* held = nullptr) const override;
  void values(const CoefficientsAs<Dependencies>& of, const Dependencies* x, const Dependencies* v,
              Dependencies* g) const override;
  [[nodiscard]] const SparseRows& jacobian_pattern() const override { return pattern_; }
  void jacobian(const Real* x, const Real* v, Real* values, const Real* held = nullptr) const override;
  [[nodiscard]] const SparseRows& velocity_pattern() const override { return no_velocities_; }
  void velocity_jacobian(const Real* /*x*/, const Real* /*v*/, Real* /*values*/,
                         const Real* /*held*/ = nullptr) const override {}
  [[nodiscard]] std::vector<int> actions_used() const override { return pattern_.column; }
  [[nodiscard]] std::vector<int> velocities_used() const override { return {}; }

 protected:
  [[nodiscard]] const Shape& shape() const { return shape_; }

 private:
  template <typename Scalar, typename Gain>
  void values_as(const Scalar* x, Gain gain_of, Scalar* g) const;

  Shape shape_;
  bool is_built_ = false;
  std::vector<int> player_;  // of each row
  SparseRows pattern_;
  SparseRows no_velocities_;
  std::vector<Real> linear_;  // along pattern_
  std::vector<Real> square_;
};

}  // namespace mixed_order_game
