// What judges a run: independent of communication points and neutral to the run, with a window that begins anew.
#include <cmath>

#include "importer.hpp"

namespace {

constexpr const char* judged[] = {"settling_time", "control_energy", "control_peak", "error_peak", "overshoot"};

std::vector<double> judgement(Slave& slave) {
  std::vector<double> values;
  for (const char* name : judged) values.push_back(slave.get(name));
  values.push_back(slave.get_boolean("settled") ? 1.0 : 0.0);
  return values;
}

}  // namespace

TEST(Judgement, NeitherDependsOnCommunicationPointsNorLeavesATrace) {
  Slave often;
  Slave once;
  for (Slave* slave : {&often, &once}) {
    slave->initialize();
    EXPECT_GT(slave->get("error_peak"), 0.0);
    EXPECT_GT(slave->get("control_peak"), 0.0);
    EXPECT_EQ(slave->get("control_energy"), 0.0);
    EXPECT_FALSE(slave->get_boolean("settled"));
  }
  std::vector<double> before = judgement(often);
  for (int k = 0; k < 128; ++k) {
    ASSERT_EQ(often.step(k / 64.0, 1.0 / 64.0), fmi2OK);
    const std::vector<double> now = judgement(often);
    for (std::size_t value = 1; value < std::size(judged); ++value) EXPECT_GE(now[value], before[value]);
    before = now;
  }
  ASSERT_EQ(once.step(0.0, 2.0), fmi2OK);
  EXPECT_TRUE(same_values(once, once.all(), often.all()));
}

TEST(Judgement, OfAnInstantThatTheIntegratorHasPassedIsOfThatInstant) {
  Slave slave;
  slave.initialize();
  double energy = 0.0;
  for (int k = 0; k < 2000; ++k) {  // finer than the integrator's steps
    const double power = std::pow(slave.get("u[1,1]"), 2) + std::pow(slave.get("u[1,2]"), 2) +
                         std::pow(slave.get("u[2,1]"), 2) + std::pow(slave.get("u[2,2]"), 2) +
                         std::pow(slave.get("u[3,1]"), 2) + std::pow(slave.get("u[3,2]"), 2);
    energy += power * (k == 0 ? 0.5e-4 : 1e-4);
    ASSERT_EQ(slave.step(k * 1e-4, 1e-4), fmi2OK);
  }
  EXPECT_NEAR(slave.get("control_energy") / energy, 1.0, 1e-3);
}

TEST(Judgement, SettingItsBeginningBeginsTheErrorPeakAnewAndNothingElse) {
  Slave slave;
  Slave twin;
  for (Slave* one : {&slave, &twin}) {
    one->initialize();
    ASSERT_EQ(one->step(0.0, 0.5), fmi2OK);
  }
  const double peak = twin.get("error_peak");
  ASSERT_EQ(slave.set("judge_from", 0.75), fmi2OK);
  EXPECT_EQ(slave.get("error_peak"), 0.0);
  ASSERT_EQ(slave.step(0.5, 0.25 - 0.001), fmi2OK);
  EXPECT_EQ(slave.get("error_peak"), 0.0);
  ASSERT_EQ(slave.set("judge_from", 0.0), fmi2OK);  // from now on
  double now = 0.0;
  for (const char* entry : {"[1,1]", "[1,2]", "[2,1]", "[2,2]", "[3,1]", "[3,2]"}) {
    const double error = slave.get(std::string("x") + entry) - slave.get(std::string("x_star") + entry);
    now = std::max(now, std::fabs(error));
  }
  EXPECT_EQ(slave.get("error_peak"), now);
  ASSERT_EQ(slave.step(0.749, 0.251), fmi2OK);
  ASSERT_EQ(twin.step(0.5, 0.5), fmi2OK);
  EXPECT_GE(slave.get("error_peak"), now);
  EXPECT_LE(slave.get("error_peak"), twin.get("error_peak"));
  EXPECT_GE(twin.get("error_peak"), peak);
  EXPECT_EQ(slave.get_integer("solver_steps"), twin.get_integer("solver_steps"));
  EXPECT_EQ(slave.get("x[1,1]"), twin.get("x[1,1]"));
  EXPECT_EQ(slave.get("control_energy"), twin.get("control_energy"));
}

TEST(Judgement, FollowsTheParametersBeforeTheRunBegins) {
  Slave slave;
  const double peak = slave.get("error_peak");
  ASSERT_EQ(slave.set("x0[1,1]", 30.0), fmi2OK);
  EXPECT_GT(slave.get("error_peak"), peak);
  ASSERT_EQ(slave.set("judge_from", 1.0), fmi2OK);
  EXPECT_EQ(slave.get("error_peak"), 0.0);
  slave.initialize();
  EXPECT_EQ(slave.get("error_peak"), 0.0);
  EXPECT_EQ(slave.set("settling_band", 1.0), fmi2Error) << "fixed";
}

TEST(Judgement, OfModelExchangeIsThatOfCoSimulation) {
  Slave slave;
  slave.initialize(0.0, 1e-9);
  slave.run(0.0, 1.0, 1);
  Importer importer;
  importer.begin();
  importer.integrate(1.0, 2e-4);
  const std::vector<double> a = judgement(slave);
  const std::vector<double> b = judgement(importer);
  for (std::size_t value = 0; value < a.size(); ++value) {
    EXPECT_NEAR(b[value], a[value], 1e-5 * (1.0 + std::fabs(a[value]))) << value;
  }
}

TEST(Judgement, OfModelExchangeIsSavedAndRestored) {
  Importer importer;
  importer.begin();
  importer.integrate(0.25, 1e-3);
  const std::vector<char> bytes = importer.serialized();
  const double time = importer.time;
  importer.integrate(0.5, 1e-3);
  const std::vector<double> there = importer.all();
  Importer other;
  for (Importer* one : {&importer, &other}) {
    ASSERT_EQ(one->deserialize_and_set(bytes), fmi2OK) << one->last_message();
    one->time = time;
    one->integrate(0.5, 1e-3);
    EXPECT_TRUE(same_values(*one, one->all(), there));
  }
}
