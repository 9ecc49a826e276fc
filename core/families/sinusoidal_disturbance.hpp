// d_il(t) = bias + amplitude sin(frequency t + phase), the family of the paper's example.
#pragma once

#include "families/disturbance.hpp"

namespace mixed_order_game {

class SinusoidalDisturbance : public Disturbance {
 public:
  enum Number { amplitude, frequency, phase, bias };  ///< all at entry(i, l); frequency in rad/s, phase in rad

  explicit SinusoidalDisturbance(const Shape& shape);

  [[nodiscard]] std::unique_ptr<Disturbance> clone() const override;
  void refresh() override;
  void values(Real t, Real* d, const Real* held = nullptr) const override;
  void values(const CoefficientsAs<Dual>& along, const Dual& t, Dual* d, const Real* held = nullptr) const override;
  void values(const CoefficientsAs<Dependencies>& of, const Dependencies& t, Dependencies* d) const override;

 protected:
  [[nodiscard]] int own_entries() const { return shape_.own_entries(); }
  /// Whether it is zero at all times.
  [[nodiscard]] bool is_none() const { return is_none_; }

 private:
  template <typename Scalar>
  void values_as(const CoefficientsAs<Scalar>& of, const Scalar& t, Scalar* d) const;
  [[nodiscard]] Dual phase_at_origin(const CoefficientsAs<Dual>& along, int p) const;
  [[nodiscard]] Dependencies phase_at_origin(const CoefficientsAs<Dependencies>& of, int p) const;

  Shape shape_;
  // at own entries, as the coefficients
  std::vector<Real> amplitude_, frequency_, bias_;
  bool is_none_ = false;
  std::vector<Real> phase_at_origin_;  ///< frequency time_origin + phase; a large origin does not cost it digits
};

}  // namespace mixed_order_game
