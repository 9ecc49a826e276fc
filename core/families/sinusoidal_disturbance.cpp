#include "families/sinusoidal_disturbance.hpp"

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

SinusoidalDisturbance::SinusoidalDisturbance(int players, int dimension)
    : Disturbance(Coefficients(declared, players, dimension)) {
  refresh();
}

std::unique_ptr<Disturbance> SinusoidalDisturbance::clone() const {
  return std::make_unique<SinusoidalDisturbance>(*this);
}

void SinusoidalDisturbance::refresh() {
  phase_at_origin_ = coefficients[phase];
  if (time_origin == 0.0) return;
  for (std::size_t p = 0; p < phase_at_origin_.size(); ++p) {
    phase_at_origin_[p] = reduced_angle(coefficients[frequency][p], time_origin, coefficients[phase][p]);
  }
}

Dual SinusoidalDisturbance::phase_at_origin(const CoefficientsAs<Dual>& along, int p) const {
  return {phase_at_origin_[at(p)], along.value(frequency, p).along * time_origin + along.value(phase, p).along};
}

Dependencies SinusoidalDisturbance::phase_at_origin(const CoefficientsAs<Dependencies>& of, int p) const {
  return of.value(frequency, p) * time_origin + of.value(phase, p);
}

void SinusoidalDisturbance::values(Real t, Real* d) const {
  const auto entries = static_cast<int>(coefficients[amplitude].size());
  kernels().sinusoid(entries, t, coefficients[amplitude].data(), coefficients[frequency].data(),
                     phase_at_origin_.data(), coefficients[bias].data(), d);
}

template <typename Scalar>
void SinusoidalDisturbance::values_as(const CoefficientsAs<Scalar>& of, const Scalar& t, Scalar* d) const {
  for (int p = 0; p < static_cast<int>(coefficients[amplitude].size()); ++p) {
    d[p] = of.value(bias, p) + of.value(amplitude, p) * sin(of.value(frequency, p) * t + phase_at_origin(of, p));
  }
}

void SinusoidalDisturbance::values(const CoefficientsAs<Dual>& along, const Dual& t, Dual* d) const {
  values_as(along, t, d);
}

void SinusoidalDisturbance::values(const CoefficientsAs<Dependencies>& of, const Dependencies& t,
                                   Dependencies* d) const {
  values_as(of, t, d);
}

}  // namespace mixed_order_game
