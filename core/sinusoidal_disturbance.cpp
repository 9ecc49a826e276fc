#include "sinusoidal_disturbance.hpp"

#include <cmath>

#include "kernels/kernels.hpp"

namespace mixed_order_game {

SinusoidalDisturbance::SinusoidalDisturbance(int entries)
    : amplitude(at(entries)), frequency(at(entries)), phase(at(entries)), bias(at(entries)) {}

std::unique_ptr<Disturbance> SinusoidalDisturbance::clone() const {
  return std::make_unique<SinusoidalDisturbance>(*this);
}

void SinusoidalDisturbance::values(Real t, Real* d) const {
  const auto entries = static_cast<int>(amplitude.size());
  kernels().sinusoid(entries, t, amplitude.data(), frequency.data(), phase.data(), bias.data(), d);
}

void SinusoidalDisturbance::rates(Real t, Real* rate) const {
  for (std::size_t p = 0; p < amplitude.size(); ++p) {
    rate[p] = amplitude[p] * frequency[p] * std::cos(frequency[p] * t + phase[p]);
  }
}

std::unique_ptr<Disturbance> SinusoidalDisturbance::zero_direction() const {
  return std::make_unique<SinusoidalDisturbance>(static_cast<int>(amplitude.size()));
}

void SinusoidalDisturbance::values_along(const Disturbance& direction, Real t, Real* derivative) const {
  const auto& change = static_cast<const SinusoidalDisturbance&>(direction);
  for (std::size_t p = 0; p < amplitude.size(); ++p) {
    const Real angle = frequency[p] * t + phase[p];
    derivative[p] = change.bias[p] + change.amplitude[p] * std::sin(angle) +
                    amplitude[p] * std::cos(angle) * (change.frequency[p] * t + change.phase[p]);
  }
}

}  // namespace mixed_order_game
