// Communication points, accuracy, inputs and derivatives: behaviours 12 to 19.
#include <cmath>
#include <limits>

#include "angle_reduction.hpp"
#include "larger.hpp"
#include "slave.hpp"

namespace {

#ifdef __SANITIZE_ADDRESS__
constexpr int many_steps = 20'000;
#else
constexpr int many_steps = 1'000'000;
#endif

constexpr const char* outputs[] = {"x[1,1]", "x[1,2]", "x[2,1]", "x[2,2]", "x[3,1]", "x[3,2]", "v[2,1]", "v[2,2]"};

double largest_difference(Slave& a, Slave& b) {
  double largest = 0.0;
  for (const char* name : outputs)
    largest = mixed_order_game::testing::larger(largest, std::fabs(a.get(name) - b.get(name)));
  return largest;
}

constexpr double unix_time = 1.76e9;

/// Frequencies whose products with a large time are no doubles.
void set_frequencies(Slave& slave) {
  for (int i = 1; i <= 3; ++i) {
    for (int l = 1; l <= 2; ++l) {
      ASSERT_EQ(slave.set("disturbance_frequency" + indices(i, l), 0.7 * i + 0.3 * l), fmi2OK);
    }
  }
}

/// A start at 0 then equals one at this time.
void move_phases(Slave& slave, double start) {
  for (int i = 1; i <= 3; ++i) {
    for (int l = 1; l <= 2; ++l) {
      const std::string phase = "disturbance_phase" + indices(i, l);
      const double frequency = slave.get("disturbance_frequency" + indices(i, l));
      ASSERT_EQ(slave.set(phase, mixed_order_game::reduced_angle(frequency, start, slave.get(phase))), fmi2OK);
    }
  }
}

/// All but the time and the phases.
std::vector<double> all_but_phases(Slave& slave) {
  std::vector<double> values = slave.all();
  values[slave.reference("time")] = 0.0;
  for (int i = 1; i <= 3; ++i) {
    for (int l = 1; l <= 2; ++l) values[slave.reference("disturbance_phase" + indices(i, l))] = 0.0;
  }
  return values;
}

}  // namespace

TEST(Behaviour12ManySteps, ByAddingTheStep) {
  Slave slave;
  const double h = 1e-5;
  slave.initialize(0.0, std::nullopt, many_steps * h);
  double t = 0.0;
  for (int k = 0; k < many_steps; ++k) {
    ASSERT_EQ(slave.step(t, h), fmi2OK) << "step " << k << ": " << slave.last_message();
    t += h;
  }
  EXPECT_EQ(slave.get("time"), t);
}

TEST(Behaviour12ManySteps, ByMultiplyingTheStep) {
  Slave slave;
  const double h = 1e-5;
  slave.initialize(1000.0, std::nullopt, 1000.0 + many_steps * h);
  for (int k = 0; k < many_steps; ++k) {
    ASSERT_EQ(slave.step(1000.0 + k * h, h), fmi2OK) << "step " << k << ": " << slave.last_message();
  }
}

TEST(Behaviour12TimeCheck, ScalesWithTimeAndStep) {
  for (const double t : {0.0, 1.0, 1e3, 1e6, unix_time}) {
    Slave slave;
    slave.initialize(t);
    const double rounding = 8.0 * std::numeric_limits<double>::epsilon() * t;
    ASSERT_EQ(slave.step(t + rounding, 0.1), fmi2OK) << slave.last_message();
    const double now = slave.get("time");
    EXPECT_EQ(slave.step(now + 1e-6 * std::max(1.0, t), 0.1), fmi2Error);
    EXPECT_EQ(slave.step(now - 1e-6 * std::max(1.0, t), 0.1), fmi2Error);
    EXPECT_EQ(slave.step(now, 0.1), fmi2OK) << slave.last_message();
  }
}

TEST(Behaviour12TimeCheck, AStepThatDoesNotReachTheNextTimeIsRefused) {
  Slave slave;
  slave.initialize(unix_time);
  const auto before = slave.all();
  EXPECT_EQ(slave.step(unix_time, 1e-8), fmi2Error);
  EXPECT_NE(slave.last_message().find("the step size is 1e-08"), std::string::npos) << slave.last_message();
  EXPECT_TRUE(same_values(slave, slave.all(), before));
  EXPECT_EQ(slave.step(unix_time, 3e-7), fmi2OK) << slave.last_message();
  EXPECT_EQ(slave.get("time"), unix_time + 3e-7);
}

TEST(Behaviour13OutputsBelongToTheEnd, AndCommunicationPointsLeaveNoTrace) {
  Slave coarse;
  Slave fine;
  coarse.initialize();
  fine.initialize();
  double t = 0.0;
  for (int k = 0; k < 10; ++k) {
    ASSERT_EQ(coarse.step(t, 0.3), fmi2OK);
    const double end = t + 0.3;
    for (const double part : {0.07, 0.11}) {
      ASSERT_EQ(fine.step(t, part), fmi2OK);
      t += part;
    }
    ASSERT_EQ(fine.step(t, end - t), fmi2OK);
    t = end;
    ASSERT_EQ(coarse.get("time"), t);
    ASSERT_EQ(fine.get("time"), t);
    EXPECT_TRUE(same_values(fine, fine.all(), coarse.all()));
  }
}

TEST(Behaviour13Inputs, NeverActBeforeTheyAreSet) {
  // the steps up to t = 0.5 know nothing of what comes: the values there are those of a run without the change
  Slave changed;
  Slave unchanged;
  changed.initialize();
  unchanged.initialize();
  ASSERT_EQ(changed.step(0.0, 0.5), fmi2OK);
  ASSERT_EQ(unchanged.step(0.0, 0.5), fmi2OK);
  ASSERT_EQ(changed.set("d_ext[1,1]", 1e6), fmi2OK);
  EXPECT_EQ(changed.get("x[1,1]"), unchanged.get("x[1,1]"));
  ASSERT_EQ(changed.step(0.5, 1e-9), fmi2OK);
  ASSERT_EQ(unchanged.step(0.5, 1e-9), fmi2OK);
  // x' = ... + d_ext from t = 0.5 on
  EXPECT_NEAR(changed.get("x[1,1]") - unchanged.get("x[1,1]"), 1e6 * 1e-9, 1e-5 * 1e-3);
}

TEST(Behaviour14StepSizes, OneLongStepAgreesWithMany) {
  Slave one;
  Slave many;
  one.initialize();
  many.initialize();
  ASSERT_EQ(one.step(0.0, 20.0), fmi2OK) << one.last_message();
  many.run(0.0, 20.0, 2000);
  EXPECT_GT(one.get_integer("solver_steps"), 500);
  EXPECT_LE(largest_difference(one, many), 1e-12);
}

TEST(Behaviour14StepSizes, AStepWithoutEndFailsInsteadOfRunningForEver) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 0.5, 2);
  const auto before = slave.get("x[1,1]");
  EXPECT_EQ(slave.step(0.5, 1e15), fmi2Error);
  EXPECT_NE(slave.last_message().find("no progress towards 1e+15 s"), std::string::npos) << slave.last_message();
  EXPECT_EQ(slave.get("time"), 0.5);
  EXPECT_EQ(slave.get("x[1,1]"), before);
}

TEST(Behaviour15WrongSteps, AreRefusedAndLeaveTheStateAlone) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 0.5, 3);
  const auto before = slave.all();
  const double inf = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const auto& [t, h] : std::vector<std::pair<double, double>>{{0.5, 0.0},
                                                                   {0.5, -0.1},
                                                                   {0.5, -0.0},
                                                                   {0.5, nan},
                                                                   {0.5, inf},
                                                                   {0.5, -inf},
                                                                   {0.4, 0.1},
                                                                   {0.6, 0.1},
                                                                   {0.0, 0.1},
                                                                   {-0.5, 0.1},
                                                                   {nan, 0.1},
                                                                   {inf, 0.1},
                                                                   {-inf, 0.1}}) {
    EXPECT_EQ(slave.step(t, h), fmi2Error) << t << ' ' << h;
    EXPECT_TRUE(same_values(slave, slave.all(), before));
  }
  Slave plain;
  plain.initialize();
  plain.run(0.0, 0.5, 3);
  ASSERT_EQ(slave.step(0.5, 0.25), fmi2OK);
  ASSERT_EQ(plain.step(0.5, 0.25), fmi2OK);
  EXPECT_TRUE(same_values(slave, slave.all(), plain.all()));
}

TEST(Behaviour16StopTime, CannotBePassed) {
  Slave slave;
  slave.initialize(0.0, std::nullopt, 1.0);
  double t = 0.0;
  for (int k = 0; k < 10; ++k, t += 0.1) ASSERT_EQ(slave.step(t, 0.1), fmi2OK) << slave.last_message();
  const auto before = slave.all();
  EXPECT_EQ(slave.step(t, 0.1), fmi2Error);
  EXPECT_NE(slave.last_message().find("stop time"), std::string::npos);
  EXPECT_TRUE(same_values(slave, slave.all(), before));
  EXPECT_EQ(fmi2Terminate(slave.component), fmi2OK);

  Slave early;
  early.initialize(0.0, std::nullopt, 1.0);
  EXPECT_EQ(early.step(0.0, 1.0 + 2e-4), fmi2Error);
  EXPECT_EQ(early.step(0.0, 1.0 + 5e-5), fmi2OK) << "rounding is not passing";

  Slave unlimited;
  unlimited.initialize();
  EXPECT_EQ(unlimited.step(0.0, 50.0), fmi2OK);
}

TEST(Behaviour16StopTime, IsReachedBySums) {
  for (const auto& [h, steps] : {std::pair{0.001, 20000}, {0.01, 10000}, {0.1, 10000}, {0.7, 1000}}) {
    for (const double start : {0.0, unix_time}) {
      Slave slave;
      ASSERT_EQ(slave.set_boolean("robust", false), fmi2OK);
      double t = start;
      for (int k = 0; k < steps; ++k) t += h;
      slave.initialize(start, 1e-3, start == 0.0 ? steps * h : t);
      t = start;
      for (int k = 0; k < steps; ++k, t += h) ASSERT_EQ(slave.step(t, h), fmi2OK) << slave.last_message();
    }
  }
}

TEST(Behaviour16StopTime, IsChecked) {
  Slave slave;
  const fmi2Component c = slave.component;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(fmi2SetupExperiment(c, fmi2False, 0.0, 2.0, fmi2True, 1.0), fmi2Error);
  EXPECT_EQ(fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2True, nan), fmi2Error);
  EXPECT_EQ(fmi2SetupExperiment(c, fmi2False, 0.0, inf, fmi2False, 0.0), fmi2Error);
  EXPECT_EQ(fmi2SetupExperiment(c, fmi2True, 0.0, 0.0, fmi2False, 0.0), fmi2Error);
  EXPECT_EQ(fmi2SetupExperiment(c, fmi2True, nan, 0.0, fmi2False, 0.0), fmi2Error);
  EXPECT_EQ(fmi2SetupExperiment(c, fmi2True, -1e-6, 0.0, fmi2False, 0.0), fmi2Error);
  EXPECT_EQ(fmi2SetupExperiment(c, fmi2False, nan, 0.0, fmi2False, nan), fmi2OK) << "undefined ones are not looked at";
}

TEST(Behaviour17StartTime, DisturbancesUseAbsoluteTime) {
  // d = b + a sin(w t + p): a start at t0 equals a start at 0 with the phases moved by w t0
  const double start = 1.7;
  Slave late;
  Slave moved;
  for (int i = 1; i <= 3; ++i) {
    for (int l = 1; l <= 2; ++l) {
      const std::string index = indices(i, l);
      const double phase = moved.get("disturbance_phase" + index) + start * moved.get("disturbance_frequency" + index);
      ASSERT_EQ(moved.set("disturbance_phase" + index, phase), fmi2OK);
    }
  }
  late.initialize(start, 1e-9);
  moved.initialize(0.0, 1e-9);
  late.run(start, start + 2.0, 10);
  moved.run(0.0, 2.0, 10);
  EXPECT_LE(largest_difference(late, moved), 1e-7);
  EXPECT_EQ(late.get("time"), start + 2.0);

  Slave negative;
  negative.initialize(-3.0);
  negative.run(-3.0, -1.0, 4);
  EXPECT_EQ(negative.get("time"), -1.0);
}

TEST(Behaviour17StartTime, MayBeUnixTimeAtEveryTolerance) {
  for (const double tolerance : {1e-3, 1e-6, 1e-10, 1e-12}) {
    Slave late;
    Slave moved;
    set_frequencies(late);
    set_frequencies(moved);
    move_phases(moved, unix_time);
    late.initialize(unix_time, tolerance, unix_time + 2.0);
    moved.initialize(0.0, tolerance, 2.0);
    for (Slave* slave : {&late, &moved}) {
      ASSERT_EQ(slave->set_derivative("d_ext[2,2]", 1, 0.6), fmi2OK) << "polynomials count from the start, too";
    }
    const double h = 1.0 / 64.0;
    for (int k = 0; k < 128; ++k) {
      ASSERT_EQ(late.step(unix_time + k * h, h), fmi2OK) << late.last_message();
      ASSERT_EQ(moved.step(k * h, h), fmi2OK);
    }
    EXPECT_EQ(late.get("time"), unix_time + 2.0);
    EXPECT_EQ(late.get("d_ext[2,2]"), 1.2);
    EXPECT_GT(late.get_integer("solver_events"), 0);
    EXPECT_TRUE(same_values(late, all_but_phases(late), all_but_phases(moved))) << tolerance;
  }
}

TEST(Behaviour17StartTime, ASavedRunContinuesBitForBit) {
  Slave slave;
  set_frequencies(slave);
  slave.initialize(unix_time);
  slave.run(unix_time, unix_time + 1.0, 9);
  const std::vector<char> bytes = slave.serialized();
  const double now = slave.get("time");
  Slave other;
  ASSERT_EQ(other.deserialize_and_set(bytes), fmi2OK) << other.last_message();
  for (Slave* each : {&slave, &other}) {
    ASSERT_EQ(each->set("disturbance_frequency[1,1]", 1.9), fmi2OK);
    ASSERT_EQ(each->step(now, 0.3), fmi2OK) << each->last_message();
  }
  EXPECT_TRUE(same_values(slave, slave.all(), other.all()));
  ASSERT_EQ(slave.deserialize_and_set(bytes), fmi2OK);
  EXPECT_EQ(slave.get("time"), now);
}

TEST(Behaviour18Tolerance, OfTheExperimentIsUsedAndTheErrorFalls) {
  Slave reference;
  reference.initialize(0.0, 1e-12);
  reference.run(0.0, 2.0, 4);
  double last = 1.0;
  for (const double tolerance : {1e-3, 1e-5, 1e-7, 1e-9}) {
    Slave slave;
    slave.initialize(0.0, tolerance);
    slave.run(0.0, 2.0, 4);
    const double error = largest_difference(slave, reference);
    EXPECT_LT(error, 0.5 * last) << tolerance;
    EXPECT_LT(error, 300.0 * tolerance);
    last = error;
  }
}

TEST(Behaviour18Tolerance, UndefinedIsTheDefaultAndParametersComeFirst) {
  Slave undefined;
  Slave defined;
  Slave parameter;
  Slave both;
  ASSERT_EQ(parameter.set("tolerance_relative", 1e-6), fmi2OK);
  ASSERT_EQ(both.set("tolerance_relative", 1e-6), fmi2OK);
  ASSERT_EQ(both.set("tolerance_absolute", 1e-8), fmi2OK);
  undefined.initialize();
  defined.initialize(0.0, 1e-6);
  parameter.initialize(0.0, 1e-3);
  both.initialize(0.0, 1e-4);
  for (Slave* slave : {&undefined, &defined, &parameter, &both}) slave->run(0.0, 1.0, 3);
  EXPECT_EQ(largest_difference(undefined, defined), 0.0);
  EXPECT_EQ(largest_difference(undefined, parameter), 0.0);
  EXPECT_EQ(largest_difference(undefined, both), 0.0);
}

TEST(Behaviour19SameValue, DoesNotRestart) {
  Slave plain;
  Slave setting;
  plain.initialize();
  setting.initialize();
  for (int k = 0; k < 40; ++k) {
    for (const char* name : {"d_ext[1,1]", "k1", "a[1,2]", "cost_quadratic[2]", "disturbance_bias[3,1]"}) {
      const double value = setting.get(name);
      ASSERT_EQ(setting.set(name, value + 1.0), fmi2OK);
      ASSERT_EQ(setting.set(name, value), fmi2OK);
    }
    ASSERT_EQ(setting.set_derivative("d_ext[1,1]", 1, 0.0), fmi2OK);
    ASSERT_EQ(setting.set_derivative("d_ext[2,1]", 2, 0.0), fmi2OK);
    ASSERT_EQ(plain.step(0.05 * k, 0.05), fmi2OK);
    ASSERT_EQ(setting.step(0.05 * k, 0.05), fmi2OK);
  }
  EXPECT_TRUE(same_values(plain, plain.all(), setting.all())) << "the same bits at the same cost";
}

TEST(Behaviour19ChangedInput, ActsAtOnce) {
  Slave stepwise;
  Slave bias;
  stepwise.initialize(0.0, 1e-9);
  bias.initialize(0.0, 1e-9);
  ASSERT_EQ(stepwise.set("d_ext[2,1]", 0.9), fmi2OK);
  ASSERT_EQ(bias.set("disturbance_bias[2,1]", 0.9 - 0.1), fmi2OK);
  stepwise.run(0.0, 1.0, 5);
  bias.run(0.0, 1.0, 5);
  EXPECT_LE(largest_difference(stepwise, bias), 1e-7);
}

TEST(Behaviour19InputDerivatives, ARampEqualsFineSteps) {
  const double slope = 1.4;
  const double curvature = -0.9;
  Slave ramp;
  ramp.initialize(0.0, 1e-10);
  ASSERT_EQ(ramp.set("d_ext[1,1]", 0.2), fmi2OK);
  ASSERT_EQ(ramp.set_derivative("d_ext[1,1]", 1, slope), fmi2OK);
  ASSERT_EQ(ramp.set_derivative("d_ext[1,1]", 2, curvature), fmi2OK);
  ASSERT_EQ(ramp.step(0.0, 0.25), fmi2OK);
  EXPECT_NEAR(ramp.get("d_ext[1,1]"), 0.2 + slope * 0.25 + curvature * 0.25 * 0.25 / 2.0, 1e-15);
  ASSERT_EQ(ramp.step(0.25, 0.75), fmi2OK) << "the polynomial holds until the input is set again";

  Slave fine;
  fine.initialize(0.0, 1e-10);
  const int steps = 2000;
  const double h = 1.0 / steps;
  for (int k = 0; k < steps; ++k) {
    const double middle = (k + 0.5) * h;
    ASSERT_EQ(fine.set("d_ext[1,1]", 0.2 + slope * middle + curvature * middle * middle / 2.0), fmi2OK);
    ASSERT_EQ(fine.step(k * h, h), fmi2OK);
  }
  EXPECT_LE(largest_difference(ramp, fine), 1e-6);

  // set anew, the input is constant
  const double end = ramp.get("d_ext[1,1]");
  ASSERT_EQ(ramp.set("d_ext[1,1]", end), fmi2OK);
  ASSERT_EQ(ramp.step(1.0, 1.0), fmi2OK);
  EXPECT_EQ(ramp.get("d_ext[1,1]"), end);
}

TEST(Behaviour19InputDerivatives, ADerivativeSetLaterContinuesThePolynomial) {
  Slave slave;
  slave.initialize();
  ASSERT_EQ(slave.set_derivative("d_ext[1,1]", 1, 2.0), fmi2OK);
  ASSERT_EQ(slave.step(0.0, 0.5), fmi2OK);
  EXPECT_EQ(slave.get("d_ext[1,1]"), 1.0);
  ASSERT_EQ(slave.set_derivative("d_ext[1,1]", 1, -4.0), fmi2OK);
  EXPECT_EQ(slave.get("d_ext[1,1]"), 1.0) << "no jump";
  ASSERT_EQ(slave.step(0.5, 0.5), fmi2OK);
  EXPECT_EQ(slave.get("d_ext[1,1]"), -1.0);
  ASSERT_EQ(slave.set_derivative("d_ext[1,1]", 1, 0.0), fmi2OK);
  ASSERT_EQ(slave.step(1.0, 0.5), fmi2OK);
  EXPECT_EQ(slave.get("d_ext[1,1]"), -1.0);
}

TEST(Behaviour19OutputDerivatives, AreExact) {
  for (const char* strategy : {"robust = true", "robust = false", "perturbed = false"}) {
    SCOPED_TRACE(strategy);
    const std::string game = small_game_under(strategy);
    Slave slave(game);
    slave.initialize(0.0, 1e-10);
    slave.run(0.0, 1.3, 3);
    const double h = 2e-5;
    ASSERT_EQ(slave.step(1.3, h), fmi2OK);
    const std::vector<std::string> names = {"x[1,1]", "x[2,2]", "x[3,1]", "v[2,1]", "v[2,2]",
                                            "u[1,1]", "u[2,1]", "u[2,2]", "u[3,2]", "nash_error"};
    std::vector<double> rates;
    for (const auto& name : names) rates.push_back(slave.output_derivative(name));
    EXPECT_EQ(slave.output_derivative("x[1,1]"), slave.get("der(x[1,1])"));
    EXPECT_EQ(slave.output_derivative("v[2,2]"), slave.get("der(v[2,2])"));
    EXPECT_EQ(slave.output_derivative("x[2,1]"), slave.get("v[2,1]"));

    Slave before(game);
    before.initialize(0.0, 1e-10);
    before.run(0.0, 1.3, 3);
    Slave after(game);
    after.initialize(0.0, 1e-10);
    after.run(0.0, 1.3, 3);
    ASSERT_EQ(after.step(1.3, 2.0 * h), fmi2OK);
    for (std::size_t k = 0; k < names.size(); ++k) {
      const double difference = (after.get(names[k]) - before.get(names[k])) / (2.0 * h);
      EXPECT_NEAR(rates[k], difference, 2e-3 * (1.0 + std::fabs(difference))) << names[k];
    }
  }
}

TEST(Behaviour19OutputDerivatives, AreOfOrderOneAndOfOutputs) {
  Slave slave;
  slave.initialize();
  double value = 5.0;
  for (const fmi2Integer order : {0, 2, -1}) {
    const fmi2ValueReference x = slave.reference("x[1,1]");
    EXPECT_EQ(fmi2GetRealOutputDerivatives(slave.component, &x, 1, &order, &value), fmi2Error);
  }
  const fmi2Integer one = 1;
  const fmi2ValueReference z = slave.reference("z[1,1]");
  EXPECT_EQ(fmi2GetRealOutputDerivatives(slave.component, &z, 1, &one, &value), fmi2Error);
  EXPECT_EQ(value, 5.0);
}
