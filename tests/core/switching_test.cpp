#include "expression/switching.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "errors.hpp"
#include "expression/noise.hpp"
#include "expression/unroll.hpp"

namespace mixed_order_game {
namespace {

const Shape shape{.players = 2, .dimension = 1, .neurons = 1, .order = {2, 2}};

NamedParameters parameters() {
  NamedParameters named;
  named.declared.push_back({.name = "p"});
  named.declared.push_back({.name = "q", .first = 1});
  named.values = {0.4, 7.0};
  return named;
}

/// A text of player 1, with its switches.
struct Text {
  explicit Text(const std::string& text, Purpose purpose = Purpose::dynamics) {
    const auto graph = std::make_shared<ExpressionGraph>(10'000);
    const Place place{.shape = &shape, .parameters = &named, .purpose = purpose, .player = 0, .coordinate = 0};
    expression.add(0, 0, graph, unroll(parse_expression(text), place, *graph));
    expression.compile();
    switching = Switching({{0, 0, graph}}, "dynamics", 2, 2, 2);
    held.resize(at(switching.count()));
  }
  [[nodiscard]] LeafValues leaves() const {
    return {.points = x.data(),
            .velocities = v.data(),
            .time = time,
            .parameters = named.values.data(),
            .held = held.data()};
  }
  void hold_own() { switching.own_values(leaves(), 0.0, time, held.data()); }
  Real value() {
    std::vector<Real> values(2);
    expression.values(leaves(), values.data());
    return values[0];
  }
  Real own(Real x1, Real x2 = 0.0) {
    x = {x1, x2};
    hold_own();
    return value();
  }
  std::vector<Real> ends() {
    std::vector<Real> values(at(switching.located()));
    switching.event_functions(leaves(), values.data());
    return values;
  }
  Real derivative(LeafKind kind, int number = 0) {
    std::vector<Real> entries(at(expression.pattern(kind).entries()));
    expression.derivatives(kind, leaves(), entries.data());
    return entries[at(number)];
  }

  NamedParameters named = parameters();
  PlayerExpressions expression{2, 2, 2, 2};
  Switching switching;
  std::vector<Real> x{0.0, 0.0}, v{0.0, 0.0}, held;
  Real time = 0.0;
};

TEST(Switching, ValuesAtAPointAreThoseOfTheWords) {
  for (const Real s : {-1.7, -1.0, -0.3, 0.0, 0.3, 1.0, 2.5}) {
    SCOPED_TRACE(s);
    EXPECT_EQ(Text("sign(x[1])").own(s), s > 0 ? 1.0 : s < 0 ? -1.0 : 0.0);
    EXPECT_EQ(Text("floor(x[1])").own(s), std::floor(s));
    EXPECT_DOUBLE_EQ(Text("mod(x[1], p)").own(s), s - 0.4 * std::floor(s / 0.4));
    EXPECT_EQ(Text("abs(x[1])").own(s), std::fabs(s));
    EXPECT_EQ(Text("min(x[1], 0.5)").own(s), std::min(s, 0.5));
    EXPECT_EQ(Text("max(x[1], 0.5)", Purpose::cost).own(s), std::max(s, 0.5));
    EXPECT_EQ(Text("if(x[1] > 0, 1, 2)").own(s), s > 0 ? 1.0 : 2.0);
    EXPECT_EQ(Text("if(x[1] >= 0, 1, 2)").own(s), s >= 0 ? 1.0 : 2.0);
    EXPECT_EQ(Text("if(0 > x[1], 1, 2)").own(s), s < 0 ? 1.0 : 2.0);
    EXPECT_EQ(Text("if(x[1] <= 0, 1, 2)").own(s), s <= 0 ? 1.0 : 2.0);
    EXPECT_EQ(Text("if(x[1] > -1 and (x[1] < 1 or not x[1] < 2), 1, 2)").own(s),
              s > -1 && (s < 1 || !(s < 2)) ? 1.0 : 2.0);
    EXPECT_EQ(Text("sum(x[j] for j in 1..N if x[j] > 1)").own(s, 1.5), (s > 1 ? s : 0.0) + 1.5);
    EXPECT_EQ(Text("if(p > 0.3, x[1], 1 / 0)").own(s), s);
  }
}

TEST(Switching, ABranchIsHeldUntilItsEvent) {
  Text text("if(x[1] > 1, 5, x[1])");
  EXPECT_EQ(text.own(2.0), 5.0);
  text.x[0] = 0.5;
  EXPECT_EQ(text.value(), 5.0);
  EXPECT_GT(text.ends()[0], 0.0);
  EXPECT_EQ(text.switching.next_value(0, text.leaves()), 0.0);
  text.held[0] = 0.0;
  EXPECT_EQ(text.value(), 0.5);
  EXPECT_LT(text.ends()[0], 0.0);
  EXPECT_EQ(text.derivative(LeafKind::action), 1.0);
  EXPECT_EQ(text.switching.description(0), "\"x[1] > 1\" in the dynamics of player 1");
}

TEST(Switching, ABendIsNotHeld) {
  Text text("abs(x[1]) + max(x[1], x[2])");
  EXPECT_EQ(text.own(2.0, 3.0), 5.0);
  text.x[0] = -4.0;
  EXPECT_EQ(text.value(), 7.0);
  EXPECT_GT(text.ends()[0], 0.0);
  EXPECT_TRUE(text.switching.is_bend(0));
  EXPECT_EQ(text.derivative(LeafKind::action), -1.0);
  EXPECT_FALSE(Text("abs(x[1])", Purpose::cost).switching.is_bend(0));
}

TEST(Switching, ABranchWithoutAFiniteValueGivesWay) {
  Text text("if(x[1] >= 0, sqrt(x[1]), -x[1])");
  EXPECT_EQ(text.own(4.0), 2.0);
  EXPECT_EQ(text.derivative(LeafKind::action), 0.25);
  text.x[0] = -0.5;  // still held
  EXPECT_EQ(text.value(), 0.5);
  EXPECT_EQ(text.derivative(LeafKind::action), -1.0);
  EXPECT_EQ(text.own(-0.5), 0.5);
  EXPECT_EQ(text.derivative(LeafKind::action), -1.0);
}

TEST(Switching, ConditionsInBranchesThatAreNotTakenAreMasked) {
  Text text("if(x[1] > 0, if(x[2] > 1, 1, 2), if(log(x[2]) > 0, 3, 4))");
  EXPECT_EQ(text.own(1.0, 0.5), 2.0);
  text.x[1] = 3.0;
  const std::vector<Real> ends = text.ends();
  ASSERT_EQ(ends.size(), 3U);
  EXPECT_GT(ends[1], 0.0);
  EXPECT_EQ(ends[2], -1.0);  // in the other branch
}

TEST(Switching, TiesAreThoseOfTheComparison) {
  for (const auto& [condition, at_zero] : {std::pair("x[1] > 0", 0.0), std::pair("x[1] >= 0", 1.0)}) {
    Text text(std::string("if(") + condition + ", 1, 0)");
    EXPECT_EQ(text.own(0.0), at_zero);
    EXPECT_LT(text.ends()[0], 0.0);
    text.held[0] = 1.0 - at_zero;
    EXPECT_GT(text.ends()[0], 0.0);
  }
}

TEST(Switching, OneSwitchServesOppositeComparisons) {
  EXPECT_EQ(Text("if(x[1] > 0, 1, 2) + if(0 < x[1], 1, 2) + if(x[1] <= 0, 1, 2)").switching.count(), 1);
}

TEST(Switching, EventsOfTimeAreKnownToTheBit) {
  Text noise("noise(q, p) + square(t - 0.1, 2) + pulse(t, 5, p) + if(3 * t > 4, 1, 0)", Purpose::disturbance);
  EXPECT_EQ(noise.switching.located(), 0);
  Real t = 0.0;
  std::vector<Real> times;
  for (int n = 0; n < 400; ++n) {
    t = noise.switching.next_event(noise.leaves(), 0.0, t);
    noise.time = t;
    noise.hold_own();
    times.push_back(t);
  }
  std::vector<Real> expected{5.0, 5.0 + 0.4, 4.0 / 3.0};
  for (int k = 1; k < 1000; ++k) expected.push_back(k * 0.4);
  for (int k = 0; k < 1000; ++k) expected.push_back(k * 1.0 + 0.1);
  std::sort(expected.begin(), expected.end());
  for (std::size_t n = 0, k = 0; n < times.size(); ++n, ++k) {
    EXPECT_NEAR(times[n], expected[k], 4e-16 * expected[k]);
    while (expected[k + 1] - expected[k] <= 4e-16 * expected[k]) ++k;  // at once
  }
}

TEST(Switching, TimeHasItsDigitsFarFromTheOrigin) {
  const Real origin = 1.7e9;
  Text text("floor(10 * t)", Purpose::disturbance);
  const Real first = text.switching.next_event(text.leaves(), origin, 0.0);
  EXPECT_EQ(first, 17'000'000'001.0 / 10.0);
  text.switching.own_values(text.leaves(), origin, first - origin, text.held.data());
  EXPECT_EQ(text.held[0], 17'000'000'001.0);
  text.switching.own_values(text.leaves(), origin, 0.09, text.held.data());
  EXPECT_EQ(text.held[0], 17'000'000'000.0);
}

TEST(Switching, AnEventWithinRoundingCountsAsReached) {
  Text text("if(t >= 0.3, 1, 0)", Purpose::disturbance);
  const Real just_before = std::nextafter(0.3, 0.0);
  text.switching.own_values(text.leaves(), 0.0, just_before, text.held.data());
  EXPECT_EQ(text.held[0], 1.0);
  EXPECT_EQ(text.switching.next_event(text.leaves(), 0.0, just_before), std::numeric_limits<Real>::infinity());
}

TEST(Switching, FallingTimesCountDown) {
  Text text("floor(1 - 2 * t)", Purpose::disturbance);
  text.hold_own();
  EXPECT_EQ(text.held[0], 0.0);  // just after 0
  text.time = text.switching.next_event(text.leaves(), 0.0, 0.0);
  EXPECT_EQ(text.time, 0.5);
  text.hold_own();
  EXPECT_EQ(text.held[0], -1.0);
}

TEST(Switching, TimesFollowOtherSwitchesOfTime) {
  Text text("if(mod(t, 10) < 0.001, 1, 0)", Purpose::disturbance);
  EXPECT_EQ(text.switching.located(), 0);
  text.hold_own();
  EXPECT_EQ(text.value(), 1.0);
  for (const Real expected : {0.001, 10.0, 10.001, 20.0, 20.001}) {
    text.time = text.switching.next_event(text.leaves(), 0.0, text.time);
    EXPECT_NEAR(text.time, expected, 1e-14);
    text.hold_own();
    EXPECT_EQ(text.value(), expected == 10.0 || expected == 20.0 ? 1.0 : 0.0);
  }
}

TEST(Switching, ParametersAreJudged) {
  for (const auto& [text, sentence] :
       {std::pair("mod(x[1], p)",
                  "the second argument of \"mod(x[1], p)\" in the dynamics of player 1 is -1, expected "
                  "a positive number")}) {
    Text judged(text);
    judged.switching.judge(judged.named.values.data());
    judged.named.values[0] = -1.0;
    try {
      judged.switching.judge(judged.named.values.data());
      FAIL();
    } catch (const GameError& error) {
      EXPECT_EQ(std::string(error.what()), sentence);
    }
  }
  Text seed("noise(q, p)", Purpose::disturbance);
  seed.named.values[1] = 0.5;
  EXPECT_THROW(seed.switching.judge(seed.named.values.data()), GameError);
}

TEST(Switching, WhatMakesNoSenseIsRefused) {
  for (const auto& [text, purpose] :
       {std::pair("square(t, 1)", Purpose::dynamics), std::pair("square(2 * t, 1)", Purpose::disturbance),
        std::pair("pulse(t^2, 1, 1)", Purpose::disturbance),
        std::pair("square(t + square(t, 1), 1)", Purpose::disturbance), std::pair("mod(x[1], x[2])", Purpose::dynamics),
        std::pair("noise(t, 1)", Purpose::disturbance), std::pair("if(x[1], 1, 2)", Purpose::dynamics),
        std::pair("if(x[1] == 1, 1, 2)", Purpose::dynamics), std::pair("1 + (x[1] > 1)", Purpose::dynamics),
        std::pair("abs(x[1], 2)", Purpose::dynamics)}) {
    EXPECT_THROW(Text(text, purpose), ExpressionError) << text;
  }
}

TEST(Noise, IsPhiloxAndTheNormalQuantile) {
  // NumPy: bits = Philox(key=seed, counter=k - 1).random_raw(1)[0] >> 12; SciPy: ndtri((bits + 0.5) / 2**52)
  EXPECT_NEAR(noise(7.0, 1.0), 1.136247274644977, 1e-14);
  EXPECT_NEAR(noise(7.0, 0.0), 1.2858920077392249, 1e-14);
  EXPECT_NEAR(noise(123456789.0, 1e6), 0.41961811493700296, 1e-14);
  EXPECT_NEAR(noise(0.0, -3.0), -1.3496726385571076, 1e-14);
  Real sum = 0.0;
  Real squares = 0.0;
  for (int k = -5000; k < 5000; ++k) {
    const Real number = noise(3.0, k);
    ASSERT_TRUE(std::isfinite(number));
    sum += number;
    squares += number * number;
  }
  EXPECT_NEAR(sum / 10'000, 0.0, 0.03);
  EXPECT_NEAR(squares / 10'000, 1.0, 0.05);
}

}  // namespace
}  // namespace mixed_order_game
