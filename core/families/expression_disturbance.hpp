// Disturbances with expressions: d_i is the sinusoid of its coefficients plus the values of texts.
#pragma once

#include "expression/player_expressions.hpp"
#include "families/sinusoidal_disturbance.hpp"

namespace mixed_order_game {

class ExpressionDisturbance final : public SinusoidalDisturbance {
 public:
  /// The values at own entries, compiled.
  ExpressionDisturbance(SinusoidalDisturbance sinusoids, PlayerExpressions values)
      : SinusoidalDisturbance(std::move(sinusoids)), values_(std::move(values)) {}

  [[nodiscard]] std::unique_ptr<Disturbance> clone() const override {
    return std::make_unique<ExpressionDisturbance>(*this);
  }
  void values(Real t, Real* d) const override;
  void values(const CoefficientsAs<Dual>& along, const Dual& t, Dual* d) const override;
  void values(const CoefficientsAs<Dependencies>& of, const Dependencies& t, Dependencies* d) const override;

 private:
  PlayerExpressions values_;
  mutable std::vector<Real> scratch_;
};

}  // namespace mixed_order_game
