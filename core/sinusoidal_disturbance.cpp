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

}  // namespace mixed_order_game
