// Unknown dynamics with expressions: g_i is the polynomial of its coefficients plus gain_i times the values of texts.
#pragma once

#include "expression/player_expressions.hpp"
#include "families/polynomial_dynamics.hpp"

namespace mixed_order_game {

class ExpressionDynamics final : public PolynomialDynamics {
 public:
  /// The values at own entries, compiled, and their switches.
  ExpressionDynamics(PolynomialDynamics polynomials, PlayerExpressions values, Switching switching);

  [[nodiscard]] std::unique_ptr<UnknownDynamics> clone() const override {
    return std::make_unique<ExpressionDynamics>(*this);
  }
  void values(const Real* x, const Real* v, Real* g, const Real* held = nullptr) const override;
  void values(const CoefficientsAs<Dual>& along, const Dual* x, const Dual* v, Dual* g,
              const Real* held = nullptr) const override;
  void values(const CoefficientsAs<Dependencies>& of, const Dependencies* x, const Dependencies* v,
              Dependencies* g) const override;
  [[nodiscard]] const SparseRows& jacobian_pattern() const override { return pattern_; }
  void jacobian(const Real* x, const Real* v, Real* values, const Real* held = nullptr) const override;
  [[nodiscard]] const SparseRows& velocity_pattern() const override { return values_.pattern(LeafKind::velocity); }
  void velocity_jacobian(const Real* x, const Real* v, Real* values, const Real* held = nullptr) const override;
  [[nodiscard]] const Switching& switching() const override { return switching_; }
  [[nodiscard]] std::vector<int> actions_used() const override;
  [[nodiscard]] std::vector<int> velocities_used() const override { return values_.used(LeafKind::velocity); }

 private:
  [[nodiscard]] LeafValues leaves(const Real* x, const Real* v, const Real* held) const;
  template <typename Scalar>
  void add_expressions(const CoefficientsAs<Scalar>& of, const Scalar* x, const Scalar* v, Scalar* g,
                       const Real* held) const;

  PlayerExpressions values_;
  Switching switching_;
  SparseRows pattern_;  // of both together
  std::vector<int> polynomial_place_;
  std::vector<int> expression_place_;
  mutable std::vector<Real> scratch_;
  mutable std::vector<Real> held_there_;
};

}  // namespace mixed_order_game
