#include "loop/inputs.hpp"

#include <gtest/gtest.h>

namespace mixed_order_game {
namespace {

Real value_at(const Inputs& d, Real t, int entry = 1) {
  std::vector<Real> values(at(d.count()));
  d.values(t, values.data());
  return values[at(entry)];
}

Real rate_at(const Inputs& d, Real t, int entry = 1) {
  std::vector<Real> rates(at(d.count()));
  d.rates(t, rates.data());
  return rates[at(entry)];
}

Inputs cubic() {
  Inputs d(3);
  d.set_value(1, 4.0);
  d.set_derivative(1, 1, -3.0, 10.0);
  d.set_derivative(1, 2, 2.0, 10.0);
  d.set_derivative(1, 3, 6.0, 10.0);
  return d;
}

TEST(Inputs, IsZeroAtFirst) {
  const Inputs d(3);
  EXPECT_EQ(d.count(), 3);
  for (int entry = 0; entry < 3; ++entry) {
    EXPECT_EQ(value_at(d, 5.0, entry), 0.0);
    EXPECT_EQ(rate_at(d, 5.0, entry), 0.0);
  }
}

TEST(Inputs, IsTheTaylorPolynomialOfItsDerivatives) {
  const Inputs d = cubic();
  for (const Real h : {0.0, 0.5, 2.0, -1.0}) {
    EXPECT_DOUBLE_EQ(value_at(d, 10.0 + h), 4.0 - 3.0 * h + h * h + h * h * h);
    EXPECT_DOUBLE_EQ(rate_at(d, 10.0 + h), -3.0 + 2.0 * h + 3.0 * h * h);
  }
  EXPECT_EQ(d.value(1), 4.0);
  EXPECT_EQ(value_at(d, 12.0, 0), 0.0);
  EXPECT_EQ(value_at(d, 12.0, 2), 0.0);
}

TEST(Inputs, ANewValueRemovesTheDerivatives) {
  Inputs d = cubic();
  d.set_value(1, -1.5);
  EXPECT_EQ(value_at(d, 100.0), -1.5);
  EXPECT_EQ(rate_at(d, 100.0), 0.0);
}

TEST(Inputs, IsSavedAndRestoredWhole) {
  const Inputs d = cubic();
  const std::vector<Real> saved(d.numbers().begin(), d.numbers().end());
  EXPECT_EQ(saved.size(), at(3 * (Inputs::highest_derivative + 2)));
  Inputs other(3);
  other.set_value(0, 7.0);
  other.set_numbers(saved);
  EXPECT_EQ(value_at(other, 11.5), value_at(d, 11.5));
  EXPECT_EQ(value_at(other, 11.5, 0), 0.0);
  EXPECT_TRUE(std::equal(saved.begin(), saved.end(), other.numbers().begin()));

  Inputs constant(3);
  constant.set_value(2, 5.0);
  other.set_numbers(constant.numbers());
  EXPECT_TRUE(other.are_constant());
  EXPECT_EQ(value_at(other, 11.5, 2), 5.0);
  EXPECT_EQ(value_at(other, 11.5), 0.0);
}

}  // namespace
}  // namespace mixed_order_game
