// Disturbances with expressions: d_i is the sinusoid of its coefficients plus the values of texts.
#pragma once

#include "expression/player_expressions.hpp"
#include "families/sinusoidal_disturbance.hpp"

namespace mixed_order_game {

class ExpressionDisturbance final : public SinusoidalDisturbance {
 public:
  /// The values at own entries, compiled, and their switches.
  ExpressionDisturbance(SinusoidalDisturbance sinusoids, PlayerExpressions values, Switching switching)
      : SinusoidalDisturbance(std::move(sinusoids)),
        values_(std::move(values)),
        switching_(std::move(switching)),
        held_there_(at(switching_.count())) {}

  [[nodiscard]] std::unique_ptr<Disturbance> clone() const override {
    return std::make_unique<ExpressionDisturbance>(*this);
  }
  void values(Real t, Real* d, const Real* held = nullptr) const override;
  void values(const CoefficientsAs<Dual>& along, const Dual& t, Dual* d, const Real* held = nullptr) const override;
  void values(const CoefficientsAs<Dependencies>& of, const Dependencies& t, Dependencies* d) const override;

  /// Texts see the absolute time.
  [[nodiscard]] Real resolution(Real t) const override { return SinusoidalDisturbance::resolution(time_origin + t); }
  [[nodiscard]] const Switching& switching() const override { return switching_; }

 private:
  [[nodiscard]] LeafValues leaves(Real t, const Real* held) const;

  PlayerExpressions values_;
  Switching switching_;
  mutable std::vector<Real> scratch_;
  mutable std::vector<Real> held_there_;
};

}  // namespace mixed_order_game
