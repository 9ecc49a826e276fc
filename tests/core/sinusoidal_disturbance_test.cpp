#include "sinusoidal_disturbance.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "random_game.hpp"

namespace mixed_order_game {
namespace {

constexpr int entries = 11;

SinusoidalDisturbance disturbance() {
  SinusoidalDisturbance d(entries);
  testing::RandomNumbers random(8);
  random.fill(d.amplitude, -4.0, 4.0);
  random.fill(d.frequency, 0.1, 9.0);
  random.fill(d.phase, -3.0, 3.0);
  random.fill(d.bias, -2.0, 2.0);
  return d;
}

TEST(SinusoidalDisturbance, ValuesAreTheFormula) {
  const SinusoidalDisturbance d = disturbance();
  std::vector<Real> values(entries);
  for (const Real t : {0.0, 0.3, 17.0, 1e4, 1e6}) {
    d.values(t, values.data());
    for (std::size_t p = 0; p < entries; ++p) {
      const Real expected = d.bias[p] + d.amplitude[p] * std::sin(d.frequency[p] * t + d.phase[p]);
      EXPECT_NEAR(values[p], expected, 5e-15) << p << " at " << t;
    }
  }
}

TEST(SinusoidalDisturbance, RatesAreTheDerivativesOfTheValues) {
  const SinusoidalDisturbance d = disturbance();
  std::vector<Real> rates(entries);
  std::vector<Real> above(entries);
  std::vector<Real> below(entries);
  constexpr Real h = 1e-5;
  for (const Real t : {0.0, 0.3, 17.0}) {
    d.rates(t, rates.data());
    d.values(t + h, above.data());
    d.values(t - h, below.data());
    for (std::size_t p = 0; p < entries; ++p) EXPECT_NEAR(rates[p], (above[p] - below[p]) / (2.0 * h), 1e-7);
  }
}

TEST(SinusoidalDisturbance, StartsAtZeroAndIsCopiedWhole) {
  SinusoidalDisturbance d(2);
  std::vector<Real> values(2, 99.0);
  d.values(3.0, values.data());
  EXPECT_EQ(values, std::vector<Real>(2, 0.0));
  d.bias = {1.0, -2.0};
  const std::unique_ptr<Disturbance> clone = d.clone();
  d.bias = {5.0, 5.0};
  clone->values(3.0, values.data());
  EXPECT_EQ(values, (std::vector<Real>{1.0, -2.0}));
}

}  // namespace
}  // namespace mixed_order_game
