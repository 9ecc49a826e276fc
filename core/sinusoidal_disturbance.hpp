// d_il(t) = bias + amplitude sin(frequency t + phase), the family of the paper's example.
#pragma once

#include "disturbance.hpp"

namespace mixed_order_game {

class SinusoidalDisturbance final : public Disturbance {
 public:
  explicit SinusoidalDisturbance(int entries);

  /// Coefficients at entry(i, l); any may change at any time.
  std::vector<Real> amplitude;
  std::vector<Real> frequency;  ///< rad/s
  std::vector<Real> phase;      ///< rad
  std::vector<Real> bias;

  [[nodiscard]] std::unique_ptr<Disturbance> clone() const override;
  void values(Real t, Real* d) const override;
  void rates(Real t, Real* rate) const override;
  [[nodiscard]] std::unique_ptr<Disturbance> zero_direction() const override;
  void values_along(const Disturbance& direction, Real t, Real* derivative) const override;
};

}  // namespace mixed_order_game
