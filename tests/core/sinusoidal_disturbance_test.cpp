#include "families/sinusoidal_disturbance.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "random_game.hpp"

namespace mixed_order_game {
namespace {

constexpr int entries = 11;

SinusoidalDisturbance disturbance() {
  SinusoidalDisturbance d({.players = entries, .dimension = 1, .order = {}});
  testing::RandomNumbers random(8);
  random.fill(d.coefficients[SinusoidalDisturbance::amplitude], -4.0, 4.0);
  random.fill(d.coefficients[SinusoidalDisturbance::frequency], 0.1, 9.0);
  random.fill(d.coefficients[SinusoidalDisturbance::phase], -3.0, 3.0);
  random.fill(d.coefficients[SinusoidalDisturbance::bias], -2.0, 2.0);
  d.refresh();
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

// sin(1.3 (1.76e9 + t) + 0.4) for t = 0, 1/64 and 20 from exact fractions and 110 digits of pi
TEST(SinusoidalDisturbance, CountsFromItsOrigin) {
  SinusoidalDisturbance d({.players = 1, .dimension = 1, .order = {}});
  d.coefficients[SinusoidalDisturbance::amplitude] = {1.0};
  d.coefficients[SinusoidalDisturbance::frequency] = {1.3};
  d.coefficients[SinusoidalDisturbance::phase] = {0.4};
  d.time_origin = 1.76e9;
  d.refresh();
  SinusoidalDisturbance faster({.players = 1, .dimension = 1, .order = {}});
  faster.coefficients[SinusoidalDisturbance::frequency] = {1.0};
  const CoefficientsAlong still(d.coefficients, nullptr);
  const CoefficientsAlong moved(d.coefficients, &faster.coefficients);
  for (const auto& [t, sine, cosine] : {std::array{0.0, -0.7787835568174883, 0.6272927320085112},
                                        std::array{0.015625, -0.7658818927812336, 0.6429812799062153},
                                        std::array{20.0, -0.025462757099529828, 0.9996757714383651}}) {
    Real value = 0.0;
    d.values(t, &value);
    EXPECT_NEAR(value, sine, 4e-15);
    Dual along;
    d.values(still, {t, 1.0}, &along);
    EXPECT_NEAR(along.value, sine, 4e-15);
    EXPECT_NEAR(along.along, 1.3 * cosine, 4e-15);
    d.values(moved, t, &along);
    EXPECT_NEAR(along.along / (1.76e9 + t), cosine, 4e-15) << "along the frequency, absolute time counts";
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
    moved.refresh();
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
  SinusoidalDisturbance d({.players = 2, .dimension = 1, .order = {}});
  std::vector<Real> values(2, 99.0);
  d.values(3.0, values.data());
  EXPECT_EQ(values, std::vector<Real>(2, 0.0));
  d.coefficients[SinusoidalDisturbance::bias] = {1.0, -2.0};
  d.refresh();
  const std::unique_ptr<Disturbance> clone = d.clone();
  d.coefficients[SinusoidalDisturbance::bias] = {5.0, 5.0};
  clone->values(3.0, values.data());
  EXPECT_EQ(values, (std::vector<Real>{1.0, -2.0}));
}

}  // namespace
}  // namespace mixed_order_game
