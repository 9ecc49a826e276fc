#include "expression/interval.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "expression/graph.hpp"
#include "random_game.hpp"

namespace mixed_order_game {
namespace {

constexpr Real infinite = std::numeric_limits<Real>::infinity();

TEST(Intervals, EncloseWhatOperationsGiveAtTheirPoints) {
  testing::RandomNumbers random(3);
  std::vector<Real> numbers(6);
  int compared = 0;
  for (int k = static_cast<int>(Operation::add); k <= static_cast<int>(Operation::multiply_unless_zero); ++k) {
    const auto operation = static_cast<Operation>(k);
    for (int repeat = 0; repeat < 4000; ++repeat) {
      random.fill(numbers, -3.0, 3.0);
      if (repeat % 2 == 0) numbers[2] *= 0.01;  // narrow ones
      Interval a{numbers[0], numbers[0] + std::abs(numbers[2])};
      Interval b{numbers[1], numbers[1] + std::abs(numbers[3])};
      if (repeat % 5 == 0) a.lower = std::round(a.lower);
      if (repeat % 5 == 1) b = Interval::of(std::round(b.lower));  // integer exponents
      if (repeat % 7 == 0) a.upper = 1000.0 * (1.0 + std::abs(a.upper));
      a.upper = std::max(a.lower, a.upper);
      const Real share_a = repeat % 3 == 0 ? 0.0 : 0.5 + numbers[4] / 6.0;
      const Real share_b = repeat % 4 == 0 ? 1.0 : 0.5 + numbers[5] / 6.0;
      const Real at_a = std::clamp(a.lower + share_a * (a.upper - a.lower), a.lower, a.upper);
      const Real at_b = std::clamp(b.lower + share_b * (b.upper - b.lower), b.lower, b.upper);
      const Real value = apply(operation, at_a, at_b);
      if (!std::isfinite(value)) continue;
      ++compared;
      const Interval enclosed = enclose(operation, a, b);
      EXPECT_TRUE(enclosed.contains(value)) << "operation " << k << " of " << at_a << ", " << at_b << " is " << value
                                            << ", not in " << enclosed.lower << " to " << enclosed.upper << "; a "
                                            << a.lower << " to " << a.upper << ", b " << b.lower << " to " << b.upper;
      const Interval point = enclose(operation, Interval::of(at_a), Interval::of(at_b));
      // 0 by definition, whatever is near, and where the angle jumps
      if (at_a == 0.0 && (operation == Operation::power_log || operation == Operation::atan2)) continue;
      EXPECT_LE(point.upper - point.lower, 1e-12 * (1.0 + std::abs(value))) << "operation " << k << " of " << at_a;
    }
  }
  EXPECT_GT(compared, 60000);
}

TEST(Intervals, KeepWhatIsExact) {
  const Interval sum = enclose(Operation::add, Interval::of(0.5), {0.25, 1.0});
  EXPECT_EQ(sum.lower, 0.75);
  EXPECT_EQ(sum.upper, 1.5);
  const Interval slope = enclose(Operation::subtract, Interval::of(1.0), squared(enclose(Operation::tanh, {}, {})));
  EXPECT_EQ(slope.lower, 0.0);
  EXPECT_EQ(slope.upper, 1.0);
  // 0.1 + 0.2 rounds up to 0.30000000000000004
  const Interval rounded = enclose(Operation::add, Interval::of(0.1), Interval::of(0.2));
  EXPECT_LT(rounded.lower, rounded.upper);
  EXPECT_TRUE(rounded.contains(0.1 + 0.2));
}

/// Remainders are computed with one rounding, which leaves their signs.
TEST(Intervals, AreRoundedOutwardByOneUnitAtMost) {
  testing::RandomNumbers random(5);
  std::vector<Real> numbers(2);
  const auto narrow = [](const Interval& found) { return found.upper <= std::nextafter(found.lower, infinite); };
  for (int repeat = 0; repeat < 2000; ++repeat) {
    random.fill(numbers, -3.0, 3.0);
    const Real a = numbers[0];
    const Real b = numbers[1];
    const Interval product = enclose(Operation::multiply, Interval::of(a), Interval::of(b));
    EXPECT_GE(std::fma(a, b, -product.lower), 0.0) << a << " * " << b;
    EXPECT_LE(std::fma(a, b, -product.upper), 0.0) << a << " * " << b;
    const Interval quotient = enclose(Operation::divide, Interval::of(a), Interval::of(b));
    const Real sign = b > 0.0 ? 1.0 : -1.0;
    EXPECT_LE(sign * std::fma(quotient.lower, b, -a), 0.0) << a << " / " << b;
    EXPECT_GE(sign * std::fma(quotient.upper, b, -a), 0.0) << a << " / " << b;
    const Interval square = squared(Interval::of(a));
    EXPECT_GE(std::fma(a, a, -square.lower), 0.0) << a;
    EXPECT_LE(std::fma(a, a, -square.upper), 0.0) << a;
    const Interval root = enclose(Operation::sqrt, Interval::of(std::abs(a)), {});
    EXPECT_LE(std::fma(root.lower, root.lower, -std::abs(a)), 0.0) << a;
    EXPECT_GE(std::fma(root.upper, root.upper, -std::abs(a)), 0.0) << a;
    EXPECT_TRUE(narrow(product) && narrow(quotient) && narrow(square)) << a << ", " << b;
    const Interval sum = enclose(Operation::add, Interval::of(a), Interval::of(b));
    const Real rounded = a + b;
    const Real rest = std::abs(a) > std::abs(b) ? b - (rounded - a) : a - (rounded - b);
    EXPECT_GE((rounded - sum.lower) + rest, 0.0) << a << " + " << b;
    EXPECT_LE((rounded - sum.upper) + rest, 0.0) << a << " + " << b;
    EXPECT_TRUE(narrow(sum));
  }
}

TEST(Intervals, HoldWhatFunctionsAreBetweenTwoNumbers) {
  testing::RandomNumbers random(7);
  std::vector<Real> numbers(1);
  const auto expect_within = [](Operation operation, Real x, long double value) {
    const Interval found = enclose(operation, Interval::of(x), {});
    EXPECT_LE(static_cast<long double>(found.lower), value) << static_cast<int>(operation) << " of " << x;
    EXPECT_GE(static_cast<long double>(found.upper), value) << static_cast<int>(operation) << " of " << x;
  };
  for (int repeat = 0; repeat < 200; ++repeat) {
    random.fill(numbers, 0.1, 3.0);
    const long double x = numbers[0];
    expect_within(Operation::exp, numbers[0], std::exp(x));
    expect_within(Operation::log, numbers[0], std::log(x));
    expect_within(Operation::cos, numbers[0], std::cos(x));
    expect_within(Operation::tanh, numbers[0], std::tanh(x));
  }
}

TEST(Intervals, MeetTheEdgesOfWhatIsDivided) {
  EXPECT_TRUE(domain_of(Operation::divide, Interval::of(1.0), {0.0, 2.0}).meets_edge);
  EXPECT_TRUE(domain_of(Operation::divide, Interval::of(1.0), {-2.0, 0.0}).meets_edge);
  EXPECT_FALSE(domain_of(Operation::divide, Interval::of(1.0), {0.5, 2.0}).meets_edge);
  const Interval below = enclose(Operation::divide, Interval::of(1.0), {-2.0, 0.0});
  EXPECT_EQ(below.lower, -infinite);
  EXPECT_EQ(below.upper, -0.5);
  const Interval above = enclose(Operation::divide, Interval::of(1.0), {0.0, 2.0});
  EXPECT_EQ(above.lower, 0.5);
  EXPECT_EQ(above.upper, infinite);
  const Interval odd = enclose(Operation::power, {-2.0, 0.0}, Interval::of(-1.0));
  EXPECT_EQ(odd.lower, -infinite);
  EXPECT_NEAR(odd.upper, -0.5, 1e-14);
  EXPECT_EQ(enclose(Operation::divide, Interval::of(1.0), {-1.0, 2.0}).lower, -infinite);
  EXPECT_EQ(enclose(Operation::divide, Interval::of(1.0), {-1.0, 2.0}).upper, infinite);
}

TEST(Intervals, ReachToInfinity) {
  const Interval half{0.0, infinite};
  EXPECT_EQ(enclose(Operation::exp, {}, {}).lower, 0.0);
  EXPECT_EQ(enclose(Operation::exp, {}, {}).upper, infinite);
  EXPECT_EQ(enclose(Operation::multiply, half, half).lower, 0.0);
  EXPECT_EQ(enclose(Operation::divide, Interval::of(1.0), half).lower, 0.0);
  EXPECT_EQ(enclose(Operation::divide, {1.0, infinite}, {1.0, infinite}).lower, 0.0);
  EXPECT_EQ(enclose(Operation::divide, {1.0, infinite}, {1.0, infinite}).upper, infinite);
  EXPECT_EQ(enclose(Operation::sin, half, {}).upper, 1.0);
  EXPECT_TRUE(enclose(Operation::log, {-2.0, -1.0}, {}).is_empty());
  const Interval largest = enclose(Operation::exp, {700.0, 1000.0}, {});
  EXPECT_TRUE(std::isfinite(largest.lower));
  EXPECT_EQ(largest.upper, infinite);
}

}  // namespace
}  // namespace mixed_order_game
