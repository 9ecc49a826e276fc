#include "families/sinusoidal_disturbance.hpp"

#include <algorithm>

#include "angle_reduction.hpp"
#include "kernels/kernels.hpp"

namespace mixed_order_game {

namespace {

constexpr Coefficient declared[] = {
    {.key = "amplitude",
     .variable = "disturbance_amplitude",
     .description = "Amplitude of d_il(t)",
     .indices = Indices::entry,
     .declared_type = "Drive",
     .unit = {"1/s", "1/s2"}},
    {.key = "frequency",
     .variable = "disturbance_frequency",
     .description = "Angular frequency of d_il(t)",
     .indices = Indices::entry,
     .declared_type = "AngularFrequency",
     .unit = {"rad/s", "rad/s"}},
    {.key = "phase",
     .variable = "disturbance_phase",
     .description = "Phase of d_il(t)",
     .indices = Indices::entry,
     .declared_type = "Phase",
     .unit = {"rad", "rad"}},
    {.key = "bias",
     .variable = "disturbance_bias",
     .description = "Mean of d_il(t)",
     .indices = Indices::entry,
     .declared_type = "Drive",
     .unit = {"1/s", "1/s2"}},
};

}  // namespace

SinusoidalDisturbance::SinusoidalDisturbance(const Shape& shape)
    : Disturbance(Coefficients(declared, shape.players, shape.dimension)), shape_(shape) {
  refresh();
}

std::unique_ptr<Disturbance> SinusoidalDisturbance::clone() const {
  return std::make_unique<SinusoidalDisturbance>(*this);
}

void SinusoidalDisturbance::refresh() {
  const auto own = [&](Number number) {
    std::vector<Real> values;
    for (int p = 0; p < own_entries(); ++p) values.push_back(coefficients[number][at(shape_.entry_of_own(p))]);
    return values;
  };
  amplitude_ = own(amplitude);
  frequency_ = own(frequency);
  bias_ = own(bias);
  phase_at_origin_ = own(phase);
  const auto vanishes = [](const std::vector<Real>& values) {
    return std::all_of(values.begin(), values.end(), [](Real value) { return value == 0.0; });
  };
  is_none_ = vanishes(amplitude_) && vanishes(bias_);
  if (time_origin == 0.0) return;
  for (std::size_t p = 0; p < phase_at_origin_.size(); ++p) {
    phase_at_origin_[p] = reduced_angle(frequency_[p], time_origin, phase_at_origin_[p]);
  }
}

Dual SinusoidalDisturbance::phase_at_origin(const CoefficientsAs<Dual>& along, int p) const {
  const int entry = shape_.entry_of_own(p);
  return {phase_at_origin_[at(p)], along.value(frequency, entry).along * time_origin + along.value(phase, entry).along};
}

Dependencies SinusoidalDisturbance::phase_at_origin(const CoefficientsAs<Dependencies>& of, int p) const {
  const int entry = shape_.entry_of_own(p);
  return of.value(frequency, entry) * time_origin + of.value(phase, entry);
}

void SinusoidalDisturbance::values(Real t, Real* d, const Real* /*held*/) const {
  kernels().sinusoid(own_entries(), t, amplitude_.data(), frequency_.data(), phase_at_origin_.data(), bias_.data(), d);
}

template <typename Scalar>
void SinusoidalDisturbance::values_as(const CoefficientsAs<Scalar>& of, const Scalar& t, Scalar* d) const {
  for (int p = 0; p < own_entries(); ++p) {
    const int entry = shape_.entry_of_own(p);
    d[p] = of.value(bias, entry) +
           of.value(amplitude, entry) * sin(of.value(frequency, entry) * t + phase_at_origin(of, p));
  }
}

void SinusoidalDisturbance::values(const CoefficientsAs<Dual>& along, const Dual& t, Dual* d,
                                   const Real* /*held*/) const {
  values_as(along, t, d);
}

void SinusoidalDisturbance::values(const CoefficientsAs<Dependencies>& of, const Dependencies& t,
                                   Dependencies* d) const {
  values_as(of, t, d);
}

}  // namespace mixed_order_game
