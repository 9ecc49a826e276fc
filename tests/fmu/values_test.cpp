// Reading and setting: behaviours 7 to 11, and 20.
#include <cmath>
#include <functional>
#include <limits>
#include <pugixml.hpp>

#include "importer.hpp"
#include "model_description.hpp"

using namespace mixed_order_game;

namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

bool mentions(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

// Calls `refused`, expects fmi2Error with a message that holds all parts, and that nothing changed.
template <typename Call>
void expect_refused(Slave& slave, std::initializer_list<const char*> parts, Call refused) {
  const auto before = slave.all();
  slave.log.clear();
  EXPECT_EQ(refused(), fmi2Error);
  ASSERT_FALSE(slave.log.empty()) << "the reason was not told";
  for (const char* part : parts) EXPECT_TRUE(mentions(slave.last_message(), part)) << slave.last_message();
  EXPECT_TRUE(same_values(slave, slave.all(), before));
}

}  // namespace

TEST(Behaviour07StartValues, AreWhatIsReadAfterInstantiateAndAfterReset) {
  for (const std::string& game : {small_game(), vector_centers_game(), five_vehicles(),
                                  small_game_with({{"dimension = 2\n", "dimension = 2\nexpose = \"outputs\"\n"}})}) {
    Slave slave(game);
    pugi::xml_document document;
    ASSERT_TRUE(document.load_string(model_description(slave.model()).c_str()));
    const auto check = [&] {
      int checked = 0;
      for (const auto& node : document.child("fmiModelDescription").child("ModelVariables").children()) {
        const std::string name = node.attribute("name").value();
        ASSERT_EQ(slave.reference(name), node.attribute("valueReference").as_uint());
        const auto type = node.first_child();
        const auto start = type.attribute("start");
        if (!start) continue;
        ++checked;
        if (type.name() == std::string("Real")) {
          EXPECT_EQ(slave.get(name), std::strtod(start.value(), nullptr)) << name;
        } else if (type.name() == std::string("Integer")) {
          EXPECT_EQ(slave.get_integer(name), start.as_int()) << name;
        } else {
          EXPECT_EQ(slave.get_boolean(name), start.as_bool()) << name;
        }
      }
      EXPECT_GT(checked, 20);
    };
    check();
    slave.initialize();
    slave.run(0.0, 0.5, 2);
    ASSERT_EQ(slave.set("k1", 3.0), fmi2OK);
    ASSERT_EQ(slave.set("d_ext[1,1]", 3.0), fmi2OK);
    ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
    check();
  }
}

TEST(Behaviour08BeforeInitializationEnds, CalculatedValuesFollowTheParameters) {
  Slave slave;
  const auto check = [&] {
    EXPECT_EQ(slave.get("x[1,1]"), 0.8);
    EXPECT_EQ(slave.get("v[2,2]"), -0.35);
    ASSERT_EQ(slave.set("x0[1,1]", 2.5), fmi2OK);
    ASSERT_EQ(slave.set("v0[2,2]", 0.75), fmi2OK);
    ASSERT_EQ(slave.set("z0[3,1]", -4.0), fmi2OK);
    ASSERT_EQ(slave.set("y0[2,3,1]", 6.0), fmi2OK);
    EXPECT_EQ(slave.get("x[1,1]"), 2.5);
    EXPECT_EQ(slave.get("v[2,2]"), 0.75);
    EXPECT_EQ(slave.get("z[3,1]"), -4.0);
    EXPECT_EQ(slave.get("y[2,3,1]"), 6.0);
    EXPECT_EQ(slave.get("W[1,2,1]"), 0.0);

    // u = -k1 (x - z) - phi with W = 0
    const double e = 2.5 - 0.3;
    const double phi = 1.5 * std::tanh(0.2784645427610738 * 1.5 * e / 0.05);
    EXPECT_NEAR(slave.get("u[1,1]"), -6.0 * e - phi, 1e-12);
    ASSERT_EQ(slave.set("k1", 4.0), fmi2OK);
    EXPECT_NEAR(slave.get("u[1,1]"), -4.0 * e - phi, 1e-12);
    ASSERT_EQ(slave.set_boolean("robust", false), fmi2OK);
    EXPECT_NEAR(slave.get("u[1,1]"), -4.0 * e, 1e-12);
    ASSERT_EQ(slave.set("d_ext[1,1]", 11.0), fmi2OK);
    const double rate = slave.get("der(x[1,1])");
    ASSERT_EQ(slave.set("d_ext[1,1]", 12.0), fmi2OK);
    EXPECT_NEAR(slave.get("der(x[1,1])") - rate, 1.0, 1e-12);

    // two players without coupling: x* = -l / (2 q)
    for (const char* name : {"cost_coupling[1,2]", "cost_coupling[2,1]", "cost_coupling[2,3]", "cost_coupling[3,2]"}) {
      ASSERT_EQ(slave.set(name, 0.0), fmi2OK);
    }
    EXPECT_NEAR(slave.get("x_star[1,2]"), 0.7 / 2.4, 1e-14);
    EXPECT_NEAR(slave.get("x_star[3,1]"), -0.8 / 4.2, 1e-14);
    ASSERT_EQ(slave.set("cost_quadratic[3]", 1.0), fmi2OK);
    EXPECT_NEAR(slave.get("x_star[3,1]"), -0.4, 1e-14);
    double squares = 0.0;
    for (int i = 1; i <= 3; ++i) {
      for (int l = 1; l <= 2; ++l) {
        const std::string index = indices(i, l);
        squares += std::pow(slave.get("x" + index) - slave.get("x_star" + index), 2);
      }
    }
    EXPECT_NEAR(slave.get("nash_error"), std::sqrt(squares), 1e-13);
    ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2False, 0.0, 5.0, fmi2False, 0.0), fmi2OK);
    EXPECT_EQ(slave.get("time"), 5.0);
  };
  check();
  ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
  ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2False, 0.0, 0.0, fmi2False, 0.0), fmi2OK);
  check();
  ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
  ASSERT_EQ(slave.set("x0[1,1]", 1.25), fmi2OK);
  EXPECT_EQ(slave.get("x[1,1]"), 1.25);
  const auto before = slave.all();
  ASSERT_EQ(fmi2ExitInitializationMode(slave.component), fmi2OK);
  auto after = slave.all();
  const auto evaluations = static_cast<std::size_t>(slave.reference("solver_rhs_evaluations"));
  after[evaluations] = before[evaluations];
  EXPECT_TRUE(same_values(slave, after, before)) << "ending initialization changes no value";
}

TEST(Behaviour09WhatCannotBeSet, IsRefusedByName) {
  Slave slave;
  expect_refused(slave, {"x[1,1]", "output"}, [&] { return slave.set("x[1,1]", 1.0); });
  expect_refused(slave, {"z[3,2]", "local"}, [&] { return slave.set("z[3,2]", 1.0); });
  expect_refused(slave, {"x_star[1,1]", "calculated"}, [&] { return slave.set("x_star[1,1]", 1.0); });
  expect_refused(slave, {"time", "independent"}, [&] { return slave.set("time", 1.0); });
  const fmi2ValueReference order = slave.reference("order[2]");
  const fmi2Integer one = 1;
  expect_refused(slave, {"order[2]", "constant"}, [&] { return fmi2SetInteger(slave.component, &order, 1, &one); });
  slave.initialize();
  slave.run(0.0, 0.3, 1);
  for (const char* name : {"W_max", "rho", "center[2]", "x0[1,1]", "v0[2,1]", "z0[1,1]", "y0[1,2,1]",
                           "tolerance_relative", "tolerance_absolute"}) {
    expect_refused(slave, {name, "fixed parameter", "step complete"}, [&] { return slave.set(name, 0.01); });
  }
  for (const char* name : {"robust", "perturbed", "allow_disconnected"}) {
    expect_refused(slave, {name, "fixed parameter"}, [&] { return slave.set_boolean(name, true); });
  }
  EXPECT_EQ(slave.step(0.3, 0.1), fmi2OK);
}

TEST(Behaviour09Tunables, ActFromTheNextStep) {
  for (const char* name :
       {"k1", "k2", "k3", "k4", "beta", "delta", "epsilon", "a[1,2]", "a[1,3]", "disturbance_amplitude[1,1]",
        "disturbance_frequency[2,2]", "disturbance_phase[3,1]", "disturbance_bias[1,2]", "dynamics_gain[2]",
        "cost_quadratic[1]", "cost_linear[2,1]", "cost_coupling[3,1]"}) {
    SCOPED_TRACE(name);
    Slave changed;
    Slave unchanged;
    changed.initialize();
    unchanged.initialize();
    changed.run(0.0, 0.6, 2);
    unchanged.run(0.0, 0.6, 2);
    const double value = changed.get(name);
    ASSERT_EQ(changed.set(name, value + 0.5), fmi2OK);
    EXPECT_EQ(changed.get(name), value + 0.5);
    for (const char* seen : {"x[1,1]", "v[2,1]", "u[3,2]", "z[1,2]", "phi[1,1]", "cost[2]"}) {
      EXPECT_EQ(changed.get(seen), unchanged.get(seen)) << seen;
    }
    ASSERT_EQ(changed.step(0.6, 0.2), fmi2OK);
    ASSERT_EQ(unchanged.step(0.6, 0.2), fmi2OK);
    bool acted = false;
    for (const char* seen : {"x[1,1]", "x[1,2]", "x[2,1]", "v[2,2]", "x[3,1]", "x[3,2]", "y[1,2,1]", "z[3,1]"}) {
      acted = acted || changed.get(seen) != unchanged.get(seen);
    }
    EXPECT_TRUE(acted);
  }
}

TEST(Behaviour09Tunables, TheEquilibriumFollowsAtOnce) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 0.3, 1);
  const double before = slave.get("x_star[1,1]");
  ASSERT_EQ(slave.set("cost_linear[1,1]", 3.0), fmi2OK);
  const double after = slave.get("x_star[1,1]");
  EXPECT_NE(after, before);
  ASSERT_EQ(slave.step(0.3, 0.1), fmi2OK);
  EXPECT_EQ(slave.get("x_star[1,1]"), after);
}

TEST(Behaviour10Arguments, UnknownReferencesAndTypesAreRefused) {
  Slave slave;
  slave.initialize();
  const auto beyond = static_cast<fmi2ValueReference>(slave.model().variables.size());
  for (const fmi2ValueReference bad : {beyond, beyond + 1, 0xFFFFFFFFU, 0x7FFFFFFFU, 0x80000000U}) {
    const fmi2ValueReference references[] = {slave.reference("k1"), bad};
    double values[] = {5.0, 6.0};
    expect_refused(slave, {"unknown"}, [&] { return fmi2GetReal(slave.component, references, 2, values); });
    EXPECT_EQ(values[0], 5.0) << "nothing is written";
    expect_refused(slave, {"unknown"}, [&] { return fmi2SetReal(slave.component, references, 2, values); });
    int numbers[] = {1, 1};
    expect_refused(slave, {"unknown"}, [&] { return fmi2GetInteger(slave.component, references + 1, 1, numbers); });
    expect_refused(slave, {"unknown"}, [&] { return fmi2GetBoolean(slave.component, references + 1, 1, numbers); });
    expect_refused(slave, {"unknown"}, [&] { return fmi2SetInteger(slave.component, references + 1, 1, numbers); });
    expect_refused(slave, {"unknown"}, [&] { return fmi2SetBoolean(slave.component, references + 1, 1, numbers); });
    expect_refused(slave, {"unknown"},
                   [&] { return fmi2SetRealInputDerivatives(slave.component, references + 1, 1, numbers, values); });
    expect_refused(slave, {"unknown"},
                   [&] { return fmi2GetRealOutputDerivatives(slave.component, references + 1, 1, numbers, values); });
  }
  const fmi2ValueReference robust = slave.reference("robust");
  double value = 0.0;
  int number = 0;
  expect_refused(slave, {"robust", "Boolean"}, [&] { return fmi2GetReal(slave.component, &robust, 1, &value); });
  const fmi2ValueReference k1 = slave.reference("k1");
  expect_refused(slave, {"k1", "Real"}, [&] { return fmi2GetInteger(slave.component, &k1, 1, &number); });
  expect_refused(slave, {"k1", "Real"}, [&] { return fmi2SetBoolean(slave.component, &k1, 1, &number); });
  fmi2String text = nullptr;
  expect_refused(slave, {"String"}, [&] { return fmi2GetString(slave.component, &k1, 1, &text); });
  expect_refused(slave, {"String"}, [&] { return fmi2SetString(slave.component, &k1, 1, &text); });
}

TEST(Behaviour10Arguments, NullArraysAndZeroCounts) {
  Slave slave;
  slave.initialize();
  const fmi2Component c = slave.component;
  const fmi2ValueReference k1 = slave.reference("k1");
  double value = 1.0;
  int number = 1;
  EXPECT_EQ(fmi2GetReal(c, nullptr, 0, nullptr), fmi2OK);
  EXPECT_EQ(fmi2SetReal(c, nullptr, 0, nullptr), fmi2OK);
  EXPECT_EQ(fmi2GetInteger(c, nullptr, 0, nullptr), fmi2OK);
  EXPECT_EQ(fmi2SetInteger(c, nullptr, 0, nullptr), fmi2OK);
  EXPECT_EQ(fmi2GetBoolean(c, nullptr, 0, nullptr), fmi2OK);
  EXPECT_EQ(fmi2SetBoolean(c, nullptr, 0, nullptr), fmi2OK);
  EXPECT_EQ(fmi2GetString(c, nullptr, 0, nullptr), fmi2OK);
  EXPECT_EQ(fmi2SetString(c, nullptr, 0, nullptr), fmi2OK);
  EXPECT_EQ(fmi2SetRealInputDerivatives(c, nullptr, 0, nullptr, nullptr), fmi2OK);
  EXPECT_EQ(fmi2GetRealOutputDerivatives(c, nullptr, 0, nullptr, nullptr), fmi2OK);
  EXPECT_EQ(fmi2SetDebugLogging(c, fmi2False, 0, nullptr), fmi2OK);
  expect_refused(slave, {"null"}, [&] { return fmi2GetReal(c, nullptr, 1, &value); });
  expect_refused(slave, {"null"}, [&] { return fmi2GetReal(c, &k1, 1, nullptr); });
  expect_refused(slave, {"null"}, [&] { return fmi2SetReal(c, nullptr, 1, &value); });
  expect_refused(slave, {"null"}, [&] { return fmi2SetReal(c, &k1, 1, nullptr); });
  expect_refused(slave, {"null"}, [&] { return fmi2GetInteger(c, nullptr, 1, &number); });
  expect_refused(slave, {"null"}, [&] { return fmi2SetBoolean(c, nullptr, 1, &number); });
  expect_refused(slave, {"null"}, [&] { return fmi2SetRealInputDerivatives(c, &k1, 1, nullptr, &value); });
  expect_refused(slave, {"null"}, [&] { return fmi2GetRealOutputDerivatives(c, &k1, 1, &number, nullptr); });
  expect_refused(slave, {"null"}, [&] { return fmi2SetDebugLogging(c, fmi2True, 1, nullptr); });
  const char* no_category = nullptr;
  expect_refused(slave, {"category"}, [&] { return fmi2SetDebugLogging(c, fmi2True, 1, &no_category); });
  const char* unknown = "logNothing";
  expect_refused(slave, {"category"}, [&] { return fmi2SetDebugLogging(c, fmi2True, 1, &unknown); });
  expect_refused(slave, {"null"}, [&] { return fmi2GetStatus(c, fmi2DoStepStatus, nullptr); });
  expect_refused(slave, {"null"}, [&] { return fmi2GetRealStatus(c, fmi2LastSuccessfulTime, nullptr); });
}

TEST(Behaviour10Arguments, DuplicatesTakeTheLastValue) {
  Slave slave;
  const fmi2ValueReference references[] = {slave.reference("k1"), slave.reference("k2"), slave.reference("k1")};
  const double values[] = {2.0, 3.0, 4.0};
  ASSERT_EQ(fmi2SetReal(slave.component, references, 3, values), fmi2OK);
  double read[3] = {};
  ASSERT_EQ(fmi2GetReal(slave.component, references, 3, read), fmi2OK);
  EXPECT_EQ(read[0], 4.0);
  EXPECT_EQ(read[1], 3.0);
  EXPECT_EQ(read[2], 4.0);
}

TEST(Behaviour10Arguments, OneBadValueStopsAll) {
  Slave slave;
  const fmi2ValueReference references[] = {slave.reference("k1"), slave.reference("d_ext[1,1]"), slave.reference("k2")};
  const double values[] = {2.0, 3.0, -4.0};
  expect_refused(slave, {"k2", "-4"}, [&] { return fmi2SetReal(slave.component, references, 3, values); });
}

TEST(Behaviour10Arguments, NullInstance) {
  double value = 0.0;
  EXPECT_EQ(fmi2GetReal(nullptr, nullptr, 0, &value), fmi2Error);
  EXPECT_EQ(fmi2DoStep(nullptr, 0.0, 1.0, fmi2True), fmi2Error);
  EXPECT_EQ(fmi2Reset(nullptr), fmi2Error);
  EXPECT_EQ(fmi2Terminate(nullptr), fmi2Error);
  EXPECT_EQ(fmi2GetFMUstate(nullptr, nullptr), fmi2Error);
  EXPECT_EQ(fmi2EnterEventMode(nullptr), fmi2Error);
  fmi2FreeInstance(nullptr);
}

TEST(Behaviour11Ranges, AreToldWithTheName) {
  for (const bool running : {false, true}) {
    Slave slave;
    if (running) slave.initialize();
    for (const char* name : {"k1", "beta", "epsilon", "a[1,2]", "disturbance_amplitude[2,1]", "dynamics_gain[1]",
                             "cost_quadratic[1]", "cost_coupling[1,3]", "d_ext[2,2]"}) {
      for (const double value : {not_a_number, infinity, -infinity}) {
        expect_refused(slave, {name, "finite"}, [&] { return slave.set(name, value); });
      }
    }
    for (const char* name : {"k1", "k2", "k3", "k4", "epsilon"}) {
      expect_refused(slave, {name, "-0.5", "positive"}, [&] { return slave.set(name, -0.5); });
      expect_refused(slave, {name, "positive"}, [&] { return slave.set(name, 0.0); });
    }
    for (const char* name : {"beta", "delta", "a[2,3]"}) {
      expect_refused(slave, {name, "-1e-09", "at least 0"}, [&] { return slave.set(name, -1e-9); });
      EXPECT_EQ(slave.set(name, slave.get(name)), fmi2OK);
    }
    for (const char* name : {"d_ext[1,1]"}) {
      expect_refused(slave, {name, "finite"}, [&] { return slave.set_derivative(name, 1, not_a_number); });
      expect_refused(slave, {name, "order"}, [&] { return slave.set_derivative(name, 0, 1.0); });
      expect_refused(slave, {name, "order"}, [&] { return slave.set_derivative(name, 4, 1.0); });
      expect_refused(slave, {name, "order"}, [&] { return slave.set_derivative(name, -1, 1.0); });
    }
    expect_refused(slave, {"k1", "input"}, [&] { return slave.set_derivative("k1", 1, 1.0); });
  }
  Slave slave;
  for (const char* name : {"W_max", "rho"}) {
    expect_refused(slave, {name, "positive"}, [&] { return slave.set(name, 0.0); });
  }
  expect_refused(slave, {"tolerance_relative", "0.1"}, [&] { return slave.set("tolerance_relative", 0.2); });
  expect_refused(slave, {"tolerance_relative"}, [&] { return slave.set("tolerance_relative", -1e-6); });
  expect_refused(slave, {"tolerance_absolute"}, [&] { return slave.set("tolerance_absolute", -1e-6); });
  expect_refused(slave, {"center[1]"}, [&] { return slave.set("center[1]", not_a_number); });
  expect_refused(slave, {"x0[1,1]"}, [&] { return slave.set("x0[1,1]", infinity); });
}

TEST(Behaviour11SeveralValues, ADisconnectedGraphIsJudgedWhenInitializationEnds) {
  Slave slave;
  ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2False, 0.0, 0.0, fmi2False, 0.0), fmi2OK);
  ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
  ASSERT_EQ(slave.set("a[1,2]", 0.0), fmi2OK) << "importers pass through illegal combinations";
  expect_refused(slave, {"a[i,j]", "{1}", "{2, 3}", "connected"},
                 [&] { return fmi2ExitInitializationMode(slave.component); });
  ASSERT_EQ(slave.set("a[1,3]", 0.8), fmi2OK) << "still in initialization mode";
  ASSERT_EQ(fmi2ExitInitializationMode(slave.component), fmi2OK) << slave.last_message();
  EXPECT_EQ(slave.step(0.0, 0.1), fmi2OK);
}

TEST(Behaviour11SeveralValues, ADisconnectedGraphIsJudgedAtTheNextStep) {
  Slave slave;
  Slave plain;
  for (Slave* one : {&slave, &plain}) {
    one->initialize();
    one->run(0.0, 0.5, 2);
  }
  ASSERT_EQ(slave.set("a[2,3]", 0.0), fmi2OK);
  for (int repeat = 0; repeat < 3; ++repeat) {
    expect_refused(slave, {"a[i,j]", "connected"}, [&] { return slave.step(0.5, 0.1); });
  }
  ASSERT_EQ(slave.set("a[2,3]", 1.0), fmi2OK);
  ASSERT_EQ(slave.step(0.5, 0.1), fmi2OK) << slave.last_message();
  ASSERT_EQ(plain.step(0.5, 0.1), fmi2OK);
  EXPECT_TRUE(same_values(slave, slave.all(), plain.all())) << "mended to what it was: nothing happened";
}

TEST(Behaviour11SeveralValues, ADisconnectedGraphCanBeAllowed) {
  Slave slave;
  ASSERT_EQ(slave.set_boolean("allow_disconnected", true), fmi2OK);
  ASSERT_EQ(slave.set("a[1,2]", 0.0), fmi2OK);
  slave.initialize();
  EXPECT_EQ(slave.step(0.0, 0.1), fmi2OK);
  ASSERT_EQ(slave.set("a[2,3]", 0.0), fmi2OK);
  EXPECT_EQ(slave.step(0.1, 0.1), fmi2OK) << slave.last_message();
}

TEST(Behaviour11SeveralValues, AGameWithoutUniqueEquilibriumIsJudgedWhereItMatters) {
  Slave slave;
  const auto break_costs = [&] {
    for (const char* name : {"cost_quadratic[3]", "cost_coupling[3,2]"}) ASSERT_EQ(slave.set(name, 0.0), fmi2OK);
  };
  const auto mend_costs = [&] {
    ASSERT_EQ(slave.set("cost_quadratic[3]", 2.1), fmi2OK);
    ASSERT_EQ(slave.set("cost_coupling[3,2]", 0.2), fmi2OK);
  };
  const auto reading_fails = [&] {
    double value = 7.0;
    for (const char* name : {"x_star[1,1]", "nash_error"}) {
      const fmi2ValueReference vr = slave.reference(name);
      EXPECT_EQ(fmi2GetReal(slave.component, &vr, 1, &value), fmi2Error);
      EXPECT_TRUE(mentions(slave.last_message(), "equilibrium")) << slave.last_message();
      EXPECT_EQ(value, 7.0);
    }
    EXPECT_EQ(slave.get("cost_quadratic[3]"), 0.0);
  };
  break_costs();
  reading_fails();
  ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
  EXPECT_EQ(fmi2ExitInitializationMode(slave.component), fmi2Error);
  mend_costs();
  ASSERT_EQ(fmi2ExitInitializationMode(slave.component), fmi2OK) << slave.last_message();
  slave.run(0.0, 0.2, 1);
  break_costs();
  reading_fails();
  EXPECT_EQ(slave.step(0.2, 0.1), fmi2Error);
  EXPECT_EQ(slave.get("time"), 0.2);
  mend_costs();
  EXPECT_EQ(slave.step(0.2, 0.1), fmi2OK) << slave.last_message();
}

TEST(Behaviour11SeveralValues, ACostThatIsConcaveInTheOwnActionIsJudgedWhereItMatters) {
  Slave slave;
  Importer importer;
  const auto break_and_mend = [](Slave& each, const char* call, const std::function<fmi2Status()>& judged) {
    SCOPED_TRACE(call);
    // own curvature of player 2: 1.7 + 0.3 + 0.6 and then -2 + 0.3 + 0.6
    ASSERT_EQ(each.set("cost_quadratic[2]", -2.0), fmi2OK);
    EXPECT_EQ(judged(), fmi2Error);
    EXPECT_TRUE(mentions(each.last_message(), "player[2].cost is concave")) << each.last_message();
    EXPECT_TRUE(mentions(each.last_message(), "(second derivative -2.2")) << each.last_message();
    const fmi2ValueReference x_star = each.reference("x_star[1,1]");
    double value = 7.0;
    EXPECT_EQ(fmi2GetReal(each.component, &x_star, 1, &value), fmi2Error);
    EXPECT_EQ(value, 7.0);
    ASSERT_EQ(each.set("cost_quadratic[2]", 1.7), fmi2OK);
    EXPECT_EQ(judged(), fmi2OK) << each.last_message();
  };
  ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
  break_and_mend(slave, "exit of initialization", [&] { return fmi2ExitInitializationMode(slave.component); });
  break_and_mend(slave, "step", [&] { return slave.step(0.0, 0.1); });
  ASSERT_EQ(fmi2EnterInitializationMode(importer.component), fmi2OK);
  ASSERT_EQ(fmi2ExitInitializationMode(importer.component), fmi2OK);
  break_and_mend(importer, "end of event mode", [&] { return fmi2EnterContinuousTimeMode(importer.component); });
}

TEST(Behaviour11Overflow, NeverGivesNonFiniteOutputs) {
  Slave slave;
  ASSERT_EQ(slave.set("k1", 1e300), fmi2OK);
  ASSERT_EQ(slave.set("x0[1,1]", 1e300), fmi2OK);
  double value = 7.0;
  const fmi2ValueReference u = slave.reference("u[1,1]");
  EXPECT_EQ(fmi2GetReal(slave.component, &u, 1, &value), fmi2Error);
  EXPECT_TRUE(mentions(slave.last_message(), "u[1,1]")) << slave.last_message();
  EXPECT_EQ(value, 7.0);
  ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
  EXPECT_EQ(fmi2ExitInitializationMode(slave.component), fmi2Error);
  ASSERT_EQ(slave.set("x0[1,1]", 0.8), fmi2OK);
  ASSERT_EQ(slave.set("k1", 6.0), fmi2OK);
  EXPECT_EQ(fmi2ExitInitializationMode(slave.component), fmi2OK) << slave.last_message();
  EXPECT_EQ(slave.step(0.0, 0.1), fmi2OK);
}
