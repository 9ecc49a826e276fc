#include "families/sinusoidal_disturbance.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "random_game.hpp"

namespace mixed_order_game {
namespace {

constexpr int entries = 11;

SinusoidalDisturbance disturbance() {
  SinusoidalDisturbance d(entries, 1);
  testing::RandomNumbers random(8);
  random.fill(d.coefficients[SinusoidalDisturbance::amplitude], -4.0, 4.0);
  random.fill(d.coefficients[SinusoidalDisturbance::frequency], 0.1, 9.0);
  random.fill(d.coefficients[SinusoidalDisturbance::phase], -3.0, 3.0);
  random.fill(d.coefficients[SinusoidalDisturbance::bias], -2.0, 2.0);
  return d;
}

TEST(SinusoidalDisturbance, ValuesAreTheFormula) {
  const SinusoidalDisturbance d = disturbance();
  std::vector<Real> values(entries);
  for (const Real t : {0.0, 0.3, 17.0, 1e4, 1e6}) {
    d.values(t, values.data());
    for (std::size_t p = 0; p < entries; ++p) {
      const Real expected = d.coefficients[SinusoidalDisturbance::bias][p] +
                            d.coefficients[SinusoidalDisturbance::amplitude][p] *
                                std::sin(d.coefficients[SinusoidalDisturbance::frequency][p] * t +
                                         d.coefficients[SinusoidalDisturbance::phase][p]);
      EXPECT_NEAR(values[p], expected, 5e-15) << p << " at " << t;
    }
  }
}

TEST(SinusoidalDisturbance, DerivativesAlongTimeAndCoefficientsAreThoseOfTheValues) {
  const SinusoidalDisturbance d = disturbance();
  SinusoidalDisturbance direction = d;
  testing::RandomNumbers random(9);
  for (int k = 0; k < 4; ++k) random.fill(direction.coefficients[k], -1.0, 1.0);
  constexpr Real time_direction = 0.7;
  constexpr Real h = 1e-5;
  std::vector<Dual> along(entries);
  const auto values = [&](Real t, Real s) {
    SinusoidalDisturbance moved = d;
    for (int k = 0; k < 4; ++k) {
      for (std::size_t p = 0; p < entries; ++p) moved.coefficients[k][p] += s * direction.coefficients[k][p];
    }
    std::vector<Real> found(entries);
    moved.values(t + s * time_direction, found.data());
    return found;
  };
  for (const Real t : {0.0, 0.3, 17.0}) {
    d.values(CoefficientsAlong(d.coefficients, &direction.coefficients), {t, time_direction}, along.data());
    const std::vector<Real> here = values(t, 0.0);
    const std::vector<Real> above = values(t, h);
    const std::vector<Real> below = values(t, -h);
    for (std::size_t p = 0; p < entries; ++p) {
      EXPECT_NEAR(along[p].value, here[p], 5e-15);
      EXPECT_NEAR(along[p].along, (above[p] - below[p]) / (2.0 * h), 1e-6);
    }
  }
}

TEST(SinusoidalDisturbance, StartsAtZeroAndIsCopiedWhole) {
  SinusoidalDisturbance d(2, 1);
  std::vector<Real> values(2, 99.0);
  d.values(3.0, values.data());
  EXPECT_EQ(values, std::vector<Real>(2, 0.0));
  d.coefficients[SinusoidalDisturbance::bias] = {1.0, -2.0};
  const std::unique_ptr<Disturbance> clone = d.clone();
  d.coefficients[SinusoidalDisturbance::bias] = {5.0, 5.0};
  clone->values(3.0, values.data());
  EXPECT_EQ(values, (std::vector<Real>{1.0, -2.0}));
}

}  // namespace
}  // namespace mixed_order_game
