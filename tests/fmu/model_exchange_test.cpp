// Model exchange: legal calls, hostile values, states on the sphere, and runs that equal co-simulation.
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <thread>

#include "angle_reduction.hpp"
#include "importer.hpp"
#include "larger.hpp"

namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

bool mentions(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

struct NamedCall {
  std::string name;
  std::function<fmi2Status(fmi2Component)> call;
};

/// Each with arguments that are fine, so that a refusal is one of the lifecycle.
std::vector<NamedCall> model_exchange_calls(Importer& importer) {
  static double scratch[1000];
  static fmi2Boolean flag;
  static fmi2EventInfo info;
  const std::size_t nx = importer.states();
  const std::size_t nz = importer.indicators();
  return {
      {"EnterEventMode", fmi2EnterEventMode},
      {"NewDiscreteStates", [](fmi2Component c) { return fmi2NewDiscreteStates(c, &info); }},
      {"EnterContinuousTimeMode", fmi2EnterContinuousTimeMode},
      {"CompletedIntegratorStep",
       [](fmi2Component c) { return fmi2CompletedIntegratorStep(c, fmi2True, &flag, &flag); }},
      {"SetTime", [](fmi2Component c) { return fmi2SetTime(c, 0.0); }},
      {"GetContinuousStates", [=](fmi2Component c) { return fmi2GetContinuousStates(c, scratch, nx); }},
      {"SetContinuousStates",
       [=](fmi2Component c) {
         std::fill_n(scratch, nx, 0.25);
         return fmi2SetContinuousStates(c, scratch, nx);
       }},
      {"GetDerivatives", [=](fmi2Component c) { return fmi2GetDerivatives(c, scratch, nx); }},
      {"GetEventIndicators", [=](fmi2Component c) { return fmi2GetEventIndicators(c, scratch, nz); }},
      {"GetNominals", [=](fmi2Component c) { return fmi2GetNominalsOfContinuousStates(c, scratch, nx); }},
  };
}

std::vector<NamedCall> co_simulation_calls(const Slave& slave) {
  static double scratch[1];
  static fmi2Status last;
  static fmi2Integer order = 1;
  static fmi2Boolean flag;
  static fmi2String text;
  const fmi2ValueReference input = slave.reference("d_ext[1,1]");
  const fmi2ValueReference output = slave.reference("x[1,1]");
  return {
      {"DoStep", [](fmi2Component c) { return fmi2DoStep(c, 0.0, 0.01, fmi2True); }},
      {"CancelStep", fmi2CancelStep},
      {"GetStatus", [](fmi2Component c) { return fmi2GetStatus(c, fmi2DoStepStatus, &last); }},
      {"GetRealStatus", [](fmi2Component c) { return fmi2GetRealStatus(c, fmi2LastSuccessfulTime, scratch); }},
      {"GetIntegerStatus", [](fmi2Component c) { return fmi2GetIntegerStatus(c, fmi2DoStepStatus, &order); }},
      {"GetBooleanStatus", [](fmi2Component c) { return fmi2GetBooleanStatus(c, fmi2Terminated, &flag); }},
      {"GetStringStatus", [](fmi2Component c) { return fmi2GetStringStatus(c, fmi2PendingStatus, &text); }},
      {"SetRealInputDerivatives",
       [=](fmi2Component c) { return fmi2SetRealInputDerivatives(c, &input, 1, &order, scratch); }},
      {"GetRealOutputDerivatives",
       [=](fmi2Component c) { return fmi2GetRealOutputDerivatives(c, &output, 1, &order, scratch); }},
  };
}

/// Brings an instance into a state of the lifecycle.
const std::vector<std::pair<std::string, std::function<void(Importer&)>>> phases = {
    {"instantiated", [](Importer&) {}},
    {"initialization mode",
     [](Importer& importer) { ASSERT_EQ(fmi2EnterInitializationMode(importer.component), fmi2OK); }},
    {"event mode", [](Importer& importer) { importer.initialize(); }},
    {"continuous-time mode", [](Importer& importer) { importer.begin(); }},
    {"terminated",
     [](Importer& importer) {
       importer.begin();
       ASSERT_EQ(fmi2Terminate(importer.component), fmi2OK);
     }},
};

constexpr double W_max = 0.5;
std::vector<std::string> columns() {
  std::vector<std::string> names;
  for (int i = 1; i <= 3; ++i) {
    for (int l = 1; l <= 2; ++l) names.push_back("W_norm2" + indices(i, l));
  }
  return names;
}

void expect_close(Slave& a, Slave& b, double tolerance) {
  for (const char* name : {"x[1,1]",   "x[1,2]", "x[2,1]", "x[2,2]",     "x[3,1]",       "x[3,2]",         "v[2,1]",
                           "v[2,2]",   "z[1,1]", "z[3,2]", "y[1,2,1]",   "y[3,1,2]",     "W[1,2,1]",       "W[2,5,2]",
                           "W[3,3,1]", "u[1,1]", "u[2,2]", "nash_error", "W_norm2[2,1]", "consensus_error"}) {
    EXPECT_NEAR(a.get(name), b.get(name), tolerance * std::max(1.0, std::fabs(b.get(name)))) << name;
  }
}

}  // namespace

TEST(ModelExchangeLifecycle, EachCallIsLegalWhereTheStandardSaysSo) {
  const std::map<std::string, std::set<std::string>> legal = {
      {"EnterEventMode", {"event mode", "continuous-time mode"}},
      {"NewDiscreteStates", {"event mode"}},
      {"EnterContinuousTimeMode", {"event mode"}},
      {"CompletedIntegratorStep", {"continuous-time mode"}},
      {"SetTime", {"event mode", "continuous-time mode"}},
      {"SetContinuousStates", {"continuous-time mode"}},
      {"GetContinuousStates", {"initialization mode", "event mode", "continuous-time mode", "terminated"}},
      {"GetDerivatives", {"initialization mode", "event mode", "continuous-time mode", "terminated"}},
      {"GetEventIndicators", {"initialization mode", "event mode", "continuous-time mode", "terminated"}},
      {"GetNominals", {"instantiated", "initialization mode", "event mode", "continuous-time mode", "terminated"}},
  };
  for (const auto& [phase, enter] : phases) {
    Importer shape;
    for (std::size_t k = 0; k < model_exchange_calls(shape).size(); ++k) {
      Importer importer;
      const NamedCall call = model_exchange_calls(importer)[k];
      SCOPED_TRACE(call.name + " in " + phase);
      enter(importer);
      const bool is_legal = legal.at(call.name).contains(phase);
      EXPECT_EQ(call.call(importer.component), is_legal ? fmi2OK : fmi2Error) << importer.last_message();
      if (is_legal) continue;
      EXPECT_TRUE(mentions(importer.last_message(), "not allowed in the state " + phase)) << importer.last_message();
    }
    Importer importer;
    enter(importer);
    for (const NamedCall& call : co_simulation_calls(importer)) {
      EXPECT_EQ(call.call(importer.component), fmi2Error) << call.name << " in " << phase;
      EXPECT_TRUE(mentions(importer.last_message(), "belongs to co-simulation")) << importer.last_message();
    }
  }
}

TEST(ModelExchangeLifecycle, CoSimulationHasNoneOfItsCalls) {
  Importer shape;
  for (const NamedCall& call : model_exchange_calls(shape)) {
    Slave slave;
    const auto refused = [&] {
      EXPECT_EQ(call.call(slave.component), fmi2Error) << call.name;
      EXPECT_TRUE(mentions(slave.last_message(), "belongs to model exchange")) << slave.last_message();
    };
    refused();
    ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
    refused();
    ASSERT_EQ(fmi2ExitInitializationMode(slave.component), fmi2OK);
    refused();
    ASSERT_EQ(slave.step(0.0, 0.1), fmi2OK);
    refused();
    ASSERT_EQ(fmi2Terminate(slave.component), fmi2OK);
    refused();
  }
}

TEST(ModelExchangeLifecycle, CallsOfBothInterfacesFollowTheSameTable) {
  Importer importer;
  const fmi2Component c = importer.component;
  EXPECT_EQ(fmi2Terminate(c), fmi2Error);
  EXPECT_EQ(fmi2ExitInitializationMode(c), fmi2Error);
  importer.initialize();
  EXPECT_EQ(fmi2EnterInitializationMode(c), fmi2Error);
  EXPECT_EQ(fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0), fmi2Error);
  EXPECT_TRUE(mentions(importer.last_message(), "only in instantiated")) << importer.last_message();
  ASSERT_EQ(fmi2Terminate(c), fmi2OK) << "from event mode";
  EXPECT_EQ(fmi2Terminate(c), fmi2Error);
  EXPECT_TRUE(mentions(importer.last_message(), "only in event mode or continuous-time mode"));
  EXPECT_EQ(importer.set("d_ext[1,1]", 1.0), fmi2Error);
  EXPECT_EQ(importer.get("x[1,1]"), 0.8);
  ASSERT_EQ(fmi2Reset(c), fmi2OK);
  importer.begin();
  ASSERT_EQ(fmi2Terminate(c), fmi2OK) << "from continuous-time mode";
}

TEST(ModelExchangeInstantiate, NeedsAllStatesAsVariables) {
  const std::string game = small_game_with({{"dimension = 2\n", "dimension = 2\nexpose = \"outputs\"\n"}});
  Slave slave(game);
  std::vector<LogEntry> told;
  fmi2CallbackFunctions callbacks{};
  callbacks.componentEnvironment = &told;
  callbacks.logger = record;
  EXPECT_EQ(fmi2Instantiate("name", fmi2ModelExchange, slave.model().guid.c_str(),
                            ("file://" + resources_of(game)).c_str(), &callbacks, fmi2False, fmi2False),
            nullptr);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_TRUE(mentions(told[0].message, "expose")) << told[0].message;
}

TEST(ModelExchangeStates, AreTheVariablesThatTheDescriptionNames) {
  Importer importer;
  importer.begin();
  importer.integrate(0.3, 0.002);
  const auto& variables = importer.model().variables;
  const auto state = importer.state();
  const auto rate = importer.rate();
  std::vector<double> nominals(importer.states());
  ASSERT_EQ(fmi2GetNominalsOfContinuousStates(importer.component, nominals.data(), nominals.size()), fmi2OK);
  std::set<int> distinct;
  for (std::size_t k = 0; k < state.size(); ++k) {
    const int reference = variables.states()[k];
    const std::string name = variables.name(reference);
    distinct.insert(reference);
    EXPECT_EQ(state[k], importer.get(name)) << name;
    EXPECT_EQ(rate[k], importer.get("der(" + name + ")")) << name;
    EXPECT_EQ(nominals[k], variables.family(reference).nominal) << name;
    EXPECT_EQ(nominals[k], name[0] == 'W' ? std::sqrt(W_max) : 1.0) << name;
  }
  EXPECT_EQ(distinct.size(), importer.states());
  EXPECT_EQ(importer.states(), 3U * 2 * (2 + 3 + 5));
}

TEST(ModelExchangeStates, HostileValuesAreRefusedAndChangeNothing) {
  Importer importer;
  importer.begin();
  importer.integrate(0.2, 0.002);
  const fmi2Component c = importer.component;
  const auto state = importer.state();
  const auto before = importer.all();
  const auto refused = [&](fmi2Status status, const char* part) {
    EXPECT_EQ(status, fmi2Error);
    EXPECT_TRUE(mentions(importer.last_message(), part)) << importer.last_message();
    EXPECT_TRUE(same_values(importer, importer.all(), before));
  };
  const std::size_t nx = importer.states();
  const std::size_t nz = importer.indicators();
  for (const double bad : {not_a_number, infinity, -infinity}) {
    refused(fmi2SetTime(c, bad), "time");
    auto hostile = state;
    hostile[nx - 1] = bad;
    refused(fmi2SetContinuousStates(c, hostile.data(), nx), "W[3,5,2]");
    hostile = state;
    hostile[1] = bad;
    refused(fmi2SetContinuousStates(c, hostile.data(), nx), "x[2,1]");
  }
  std::vector<double> values(2 * nx);
  for (const std::size_t length : {std::size_t{0}, nx - 1, nx + 1}) {
    refused(fmi2SetContinuousStates(c, values.data(), length), "expected 60");
    refused(fmi2GetContinuousStates(c, values.data(), length), "expected 60");
    refused(fmi2GetDerivatives(c, values.data(), length), "expected 60");
    refused(fmi2GetNominalsOfContinuousStates(c, values.data(), length), "expected 60");
    refused(fmi2GetEventIndicators(c, values.data(), length), "expected 6");
  }
  refused(fmi2SetContinuousStates(c, nullptr, nx), "null");
  refused(fmi2GetContinuousStates(c, nullptr, nx), "null");
  refused(fmi2GetDerivatives(c, nullptr, nx), "null");
  refused(fmi2GetNominalsOfContinuousStates(c, nullptr, nx), "null");
  refused(fmi2GetEventIndicators(c, nullptr, nz), "null");
  fmi2Boolean flag = fmi2False;
  refused(fmi2CompletedIntegratorStep(c, fmi2True, nullptr, &flag), "null");
  refused(fmi2CompletedIntegratorStep(c, fmi2True, &flag, nullptr), "null");
  ASSERT_EQ(fmi2EnterEventMode(c), fmi2OK);
  refused(fmi2NewDiscreteStates(c, nullptr), "null");
}

TEST(ModelExchangeStates, OverflowIsDiscardedSoThatTheImporterTriesAShorterStep) {
  Importer importer(small_game(), true);
  importer.begin();
  const auto state = importer.state();
  auto huge = state;
  huge[0] = 1e300;
  huge[6] = -1e300;
  ASSERT_EQ(fmi2SetContinuousStates(importer.component, huge.data(), huge.size()), fmi2OK);
  std::vector<double> values(importer.states(), 7.0);
  EXPECT_EQ(fmi2GetDerivatives(importer.component, values.data(), values.size()), fmi2OK);
  std::fill_n(huge.begin(), huge.size(), 1.5e308);
  ASSERT_EQ(fmi2SetContinuousStates(importer.component, huge.data(), huge.size()), fmi2OK);
  values.assign(importer.states(), 7.0);
  EXPECT_EQ(fmi2GetDerivatives(importer.component, values.data(), values.size()), fmi2Discard);
  EXPECT_EQ(importer.log.back().status, fmi2Discard);
  EXPECT_EQ(importer.log.back().category, "logStatusDiscard");
  EXPECT_TRUE(mentions(importer.last_message(), "derivative of")) << importer.last_message();
  EXPECT_EQ(fmi2GetEventIndicators(importer.component, values.data(), importer.indicators()), fmi2Discard);
  double value = 7.0;
  const fmi2ValueReference norm2 = importer.reference("W_norm2[1,1]");
  EXPECT_EQ(fmi2GetReal(importer.component, &norm2, 1, &value), fmi2Discard);
  for (const double untouched : values) EXPECT_EQ(untouched, 7.0);
  EXPECT_EQ(value, 7.0);
  ASSERT_EQ(fmi2EnterEventMode(importer.component), fmi2OK);
  fmi2EventInfo info{};
  EXPECT_EQ(fmi2NewDiscreteStates(importer.component, &info), fmi2Discard);
  EXPECT_EQ(importer.state(), huge) << "the weights are as they were set";
  ASSERT_EQ(fmi2EnterContinuousTimeMode(importer.component), fmi2OK);
  importer.move_to(0.0, state);
  importer.integrate(0.1, 0.002);
  EXPECT_GT(importer.time, 0.09) << "the instance goes on";
}

TEST(ModelExchangeDerivatives, AlongTheRunAreThoseOfTheRates) {
  Importer importer;
  ASSERT_EQ(fmi2EnterInitializationMode(importer.component), fmi2OK);
  const fmi2ValueReference x0 = importer.reference("x0[1,1]");
  const fmi2ValueReference x = importer.reference("x[1,1]");
  const double one = 1.0;
  double derivative = 0.0;
  ASSERT_EQ(fmi2GetDirectionalDerivative(importer.component, &x, 1, &x0, 1, &one, &derivative), fmi2OK);
  EXPECT_EQ(derivative, 1.0);
  ASSERT_EQ(fmi2ExitInitializationMode(importer.component), fmi2OK);
  importer.finish_event();
  importer.integrate(0.9, 0.002);
  ASSERT_GE(importer.get_integer("solver_events"), 1);
  std::vector<fmi2ValueReference> knowns(importer.model().variables.states().begin(),
                                         importer.model().variables.states().end());
  const auto state = importer.state();
  const auto rate = importer.rate();
  std::vector<fmi2ValueReference> unknowns;
  for (const fmi2ValueReference known : knowns) {
    unknowns.push_back(importer.reference("der(" + importer.model().variables.name(static_cast<int>(known)) + ")"));
  }
  std::vector<double> along(unknowns.size());
  const auto derivatives = [&] {
    return fmi2GetDirectionalDerivative(importer.component, unknowns.data(), unknowns.size(), knowns.data(),
                                        knowns.size(), rate.data(), along.data());
  };
  ASSERT_EQ(derivatives(), fmi2OK) << importer.last_message();
  constexpr double h = 1e-6;
  std::vector<double> forth(state);
  std::vector<double> back(state);
  for (std::size_t k = 0; k < state.size(); ++k) {
    forth[k] += h * rate[k];
    back[k] -= h * rate[k];
  }
  importer.move_to(0.9, forth);
  const auto ahead = importer.rate();
  importer.move_to(0.9, back);
  const auto behind = importer.rate();
  double largest = 1.0;
  for (const double value : along) largest = std::max(largest, std::fabs(value));
  for (std::size_t k = 0; k < state.size(); ++k) {
    EXPECT_NEAR(along[k], (ahead[k] - behind[k]) / (2.0 * h), 1e-6 * largest) << k;
  }
  ASSERT_EQ(fmi2EnterEventMode(importer.component), fmi2OK);
  EXPECT_EQ(derivatives(), fmi2OK);
  ASSERT_EQ(fmi2Terminate(importer.component), fmi2OK);
  EXPECT_EQ(derivatives(), fmi2OK);
}

TEST(ModelExchangeSetting, FollowsTheMode) {
  Importer importer;
  importer.begin();
  importer.integrate(0.3, 0.002);
  const auto refused = [&](const char* name, const char* reason) {
    const double before = importer.get(name);
    EXPECT_EQ(importer.set(name, 0.125), fmi2Error) << name;
    EXPECT_TRUE(mentions(importer.last_message(), name)) << importer.last_message();
    EXPECT_TRUE(mentions(importer.last_message(), reason)) << importer.last_message();
    EXPECT_EQ(importer.get(name), before);
  };
  refused("k1", "continuous-time mode");
  for (const char* fixed : {"x0[1,1]", "W_max", "tolerance_relative"}) refused(fixed, "continuous-time mode");
  refused("u[1,1]", "output");
  for (const char* local : {"der(x[1,1])", "W_norm2[1,1]"}) refused(local, "local");
  EXPECT_EQ(importer.set("d_ext[1,1]", not_a_number), fmi2Error);

  const double driven = importer.get("der(x[1,1])");
  ASSERT_EQ(importer.set("d_ext[1,1]", 0.75), fmi2OK);
  EXPECT_NEAR(importer.get("der(x[1,1])"), driven + 0.75, 1e-12) << "an input acts at once";
  EXPECT_NEAR(importer.rate()[0], driven + 0.75, 1e-12);

  ASSERT_EQ(fmi2EnterEventMode(importer.component), fmi2OK);
  for (const char* fixed : {"x0[1,1]", "W_max", "tolerance_relative"}) refused(fixed, "event mode");
  const double u = importer.get("u[1,1]");
  const double e = importer.get("x[1,1]") - importer.get("z[1,1]");
  ASSERT_EQ(importer.set("k1", importer.get("k1") + 1.0), fmi2OK);
  EXPECT_NEAR(importer.get("u[1,1]"), u - e, 1e-12) << "a tunable parameter acts at once";
  ASSERT_EQ(importer.set("cost_linear[1,1]", 3.0), fmi2OK);
  ASSERT_EQ(importer.set("d_ext[1,1]", 0.0), fmi2OK);
  importer.finish_event();
  EXPECT_NEAR(importer.rate()[0], driven - e, 1e-12);
}

TEST(ModelExchangeSetting, StatesByNameAreThoseOfTheStateVector) {
  Importer importer;
  const auto refused = [&](const char* name, double value, const char* reason) {
    const auto before = importer.all();
    EXPECT_EQ(importer.set(name, value), fmi2Error) << name;
    EXPECT_TRUE(mentions(importer.last_message(), reason)) << importer.last_message();
    EXPECT_TRUE(same_values(importer, importer.all(), before));
  };
  refused("x[1,1]", 0.5, "x[1,1] is a state, which cannot be set in the state instantiated");
  ASSERT_EQ(fmi2EnterInitializationMode(importer.component), fmi2OK);
  refused("W[1,2,1]", 0.5, "W[1,2,1] is a state, which cannot be set in the state initialization mode");
  ASSERT_EQ(fmi2ExitInitializationMode(importer.component), fmi2OK);

  const auto& variables = importer.model().variables;
  std::vector<fmi2ValueReference> names(variables.states().begin(), variables.states().end());
  std::vector<double> values(names.size());
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = 0.01 * static_cast<double>(k) - 0.3;
  names.push_back(importer.reference("d_ext[2,1]"));
  values.push_back(0.7);
  Importer twin;
  // states that are set in event mode belong to the run that is judged
  const auto but_judgement = [](Importer& one) {
    std::vector<double> all = one.all();
    for (const char* name : {"settling_time", "settled", "control_peak", "error_peak", "overshoot"}) {
      all[one.reference(name)] = 0.0;
    }
    return all;
  };
  const auto compare = [&] {
    ASSERT_EQ(fmi2SetReal(importer.component, names.data(), names.size(), values.data()), fmi2OK)
        << importer.last_message();
    EXPECT_EQ(importer.state(), std::vector<double>(values.begin(), values.end() - 1));
    ASSERT_EQ(twin.set("d_ext[2,1]", values.back()), fmi2OK);
    twin.move_to(0.0, std::vector<double>(values.begin(), values.end() - 1));
    EXPECT_TRUE(same_values(importer, but_judgement(importer), but_judgement(twin)));
    EXPECT_EQ(importer.rate(), twin.rate());
  };
  twin.begin();
  compare();  // in event mode, where CasADi stays
  importer.finish_event();
  values.assign(values.size(), 0.125);
  compare();  // in continuous-time mode

  refused("y[1,2,1]", not_a_number, "y[1,2,1] was set to nan, expected a finite number");
  const auto before = importer.all();
  names = {importer.reference("x[1,1]"), importer.reference("k1")};
  values = {0.5, 7.0};
  EXPECT_EQ(fmi2SetReal(importer.component, names.data(), 2, values.data()), fmi2Error) << "one bad value stops all";
  EXPECT_TRUE(same_values(importer, importer.all(), before));
  names = {importer.reference("x[1,1]"), importer.reference("x[1,1]")};
  values = {0.5, 0.75};
  ASSERT_EQ(fmi2SetReal(importer.component, names.data(), 2, values.data()), fmi2OK);
  EXPECT_EQ(importer.get("x[1,1]"), 0.75) << "the last of duplicates";
  ASSERT_EQ(fmi2Terminate(importer.component), fmi2OK);
  refused("x[1,1]", 0.5, "not allowed in the state terminated");
}

TEST(ModelExchangeSetting, WhatInvolvesSeveralValuesIsJudgedWhenContinuousTimeBegins) {
  Importer importer;
  importer.initialize();
  ASSERT_EQ(importer.set("a[2,3]", 0.0), fmi2OK);
  fmi2EventInfo info{};
  ASSERT_EQ(fmi2NewDiscreteStates(importer.component, &info), fmi2OK);
  EXPECT_EQ(fmi2EnterContinuousTimeMode(importer.component), fmi2Error);
  EXPECT_TRUE(mentions(importer.last_message(), "connected")) << importer.last_message();
  ASSERT_EQ(importer.set("a[1,3]", 0.4), fmi2OK) << "still in event mode";
  EXPECT_EQ(fmi2EnterContinuousTimeMode(importer.component), fmi2OK);
}

TEST(ModelExchangeEvents, AColumnThatEntersIsPutExactlyOnTheSphere) {
  Importer importer;
  importer.begin();
  int entered = 0;
  for (int k = 1; k <= 200; ++k) {
    const int events = importer.get_integer("solver_events");
    const int moved = importer.moved;
    importer.integrate(0.01 * k, 0.002);
    for (const double indicator : importer.event_indicators()) EXPECT_LT(indicator, 0.0);
    for (const std::string& column : columns()) EXPECT_LE(importer.get(column), W_max * (1.0 + 1e-7));
    if (importer.get_integer("solver_events") == events) continue;
    entered += importer.moved - moved;
  }
  EXPECT_GE(entered, 2);
  EXPECT_EQ(importer.step_events, 0) << "located ones are enough";
}

TEST(ModelExchangeEvents, EnteringAndLeavingAreSeenFromTheIndicators) {
  Importer importer;
  importer.begin();
  auto state = importer.state();
  const auto index_of = [&](const std::string& name) {
    const auto& references = importer.model().variables.states();
    const auto found = std::find(references.begin(), references.end(), static_cast<int>(importer.reference(name)));
    return static_cast<std::size_t>(found - references.begin());
  };
  // e = x - z and W'S of the first column, both positive: the column is pushed outward
  state[index_of("x[1,1]")] = 2.0;
  state[index_of("z[1,1]")] = 1.0;
  const auto column = [&](double norm2) {
    for (int m = 1; m <= 5; ++m) state[index_of("W[1," + std::to_string(m) + ",1]")] = std::sqrt(norm2 / 5.0);
  };
  column(0.9 * W_max);
  importer.move_to(0.5, state);
  EXPECT_NEAR(importer.event_indicators()[0], -0.1, 1e-11);
  column(W_max * (1.0 + 1e-3));
  importer.move_to(0.6, state);
  EXPECT_NEAR(importer.event_indicators()[0], 1e-3, 1e-11);
  fmi2Boolean enter = fmi2False;
  fmi2Boolean terminate = fmi2False;
  ASSERT_EQ(fmi2CompletedIntegratorStep(importer.component, fmi2True, &enter, &terminate), fmi2OK);
  EXPECT_EQ(enter, fmi2True) << "an importer that passed it over is told";
  EXPECT_EQ(importer.state(), state) << "states change in event mode only";
  ASSERT_EQ(fmi2EnterEventMode(importer.component), fmi2OK);
  fmi2EventInfo info = importer.finish_event();
  EXPECT_EQ(info.valuesOfContinuousStatesChanged, fmi2True);
  EXPECT_EQ(info.nominalsOfContinuousStatesChanged, fmi2False);
  EXPECT_EQ(info.nextEventTimeDefined, fmi2False);
  EXPECT_EQ(info.terminateSimulation, fmi2False);
  EXPECT_NEAR(importer.get("W_norm2[1,1]"), W_max, 4e-16);
  EXPECT_EQ(importer.get_integer("solver_events"), 1);
  const double product = (importer.get("x[1,1]") - importer.get("z[1,1]")) * importer.get("nn[1,1]");
  EXPECT_GT(product, 0.0);
  EXPECT_NEAR(importer.event_indicators()[0], -2.0 * importer.get("beta") * product / W_max, 1e-10);
  // on the sphere the rate of w'w is zero
  const auto rate = importer.rate();
  state = importer.state();
  double norm2_rate = 0.0;
  for (int m = 1; m <= 5; ++m) {
    const std::size_t k = index_of("W[1," + std::to_string(m) + ",1]");
    norm2_rate += 2.0 * state[k] * rate[k];
  }
  EXPECT_NEAR(norm2_rate, 0.0, 1e-12);

  // pushed inward it leaves once w'w has fallen by the tolerance
  state[index_of("x[1,1]")] = 0.5;
  importer.move_to(0.7, state);
  EXPECT_NEAR(importer.event_indicators()[0], -1e-6, 1e-12) << "the default tolerance";
  column(W_max * (1.0 - 2e-6));
  importer.move_to(0.7, state);
  EXPECT_GT(importer.event_indicators()[0], 0.0);
  ASSERT_EQ(fmi2EnterEventMode(importer.component), fmi2OK);
  importer.finish_event();
  EXPECT_EQ(importer.get_integer("solver_events"), 2);
  EXPECT_NEAR(importer.event_indicators()[0], -2e-6, 1e-12);
  EXPECT_LT(importer.get("der(W[1,1,1])"), 0.0);
}

TEST(ModelExchangeEvents, WithoutTheNetworkThereAreNone) {
  Importer importer(small_game_under("robust = false"));
  importer.begin();
  importer.integrate(1.0, 0.002);
  EXPECT_EQ(importer.state_events + importer.step_events, 0);
  for (const double indicator : importer.event_indicators()) EXPECT_EQ(indicator, -1.0);
}

TEST(ModelExchangeRun, EqualsCoSimulation) {
  for (const std::string& game :
       {small_game(), small_game_under("robust = false"), small_game_under("perturbed = false")}) {
    Slave slave(game);
    slave.initialize(0.0, 1e-10);
    Importer importer(game);
    importer.begin();
    for (int k = 1; k <= 6; ++k) {
      const double t = 0.4 * k;
      if (k == 3) {
        for (Slave* one : {&slave, static_cast<Slave*>(&importer)}) ASSERT_EQ(one->set("d_ext[2,1]", 0.7), fmi2OK);
      }
      if (k == 4) {
        ASSERT_EQ(fmi2EnterEventMode(importer.component), fmi2OK);
        for (Slave* one : {&slave, static_cast<Slave*>(&importer)}) {
          ASSERT_EQ(one->set("a[1,3]", 0.8), fmi2OK);
          ASSERT_EQ(one->set("k2", 1.3), fmi2OK);
        }
        importer.finish_event();
      }
      ASSERT_EQ(slave.step(t - 0.4, 0.4), fmi2OK) << slave.last_message();
      importer.integrate(t, 0.001);
      expect_close(importer, slave, 1e-6);
    }
    EXPECT_EQ(importer.get_integer("solver_events"), slave.get_integer("solver_events"));
    EXPECT_LE(importer.state_events, slave.get_integer("solver_events") + 2);
    EXPECT_EQ(importer.get_integer("solver_steps"), 0) << "the steps are the importer's";
  }
}

TEST(ModelExchangeRun, AnImporterThatLocatesNothingStaysNearTheSphere) {
  // Euler steps and no look at the indicators: only what completed steps ask for
  Importer importer;
  importer.begin();
  const double h = 1e-4;
  double largest = 0.0;
  int asked = 0;
  for (int k = 1; k <= 20000; ++k) {
    auto state = importer.state();
    const auto rate = importer.rate();
    for (std::size_t j = 0; j < state.size(); ++j) state[j] += h * rate[j];
    importer.move_to(h * k, state);
    for (const std::string& column : columns()) {
      largest = mixed_order_game::testing::larger(largest, importer.get(column));
    }
    fmi2Boolean enter = fmi2False;
    fmi2Boolean terminate = fmi2False;
    ASSERT_EQ(fmi2CompletedIntegratorStep(importer.component, fmi2True, &enter, &terminate), fmi2OK);
    if (enter == fmi2False) continue;
    ++asked;
    ASSERT_EQ(fmi2EnterEventMode(importer.component), fmi2OK);
    importer.finish_event();
  }
  Slave slave;
  slave.initialize(0.0, 1e-9);
  slave.run(0.0, 2.0, 1);
  expect_close(importer, slave, 2e-3);
  EXPECT_LT(largest, W_max * 1.02) << "by one step";
  EXPECT_GE(asked, slave.get_integer("solver_events") - 1);
  EXPECT_LE(asked, 2 * slave.get_integer("solver_events"));
}

TEST(ModelExchangeRun, AGrazingColumnDoesNotChatter) {
  // the weights swing with the disturbances; a bound just below one of their peaks is touched again and again
  const auto game = [](double bound) {
    char text[64];
    std::snprintf(text, sizeof text, "W_max = %.17g", bound);
    return small_game_with({{"W_max = 0.5", text}});
  };
  Importer free_run(game(1e6));
  free_run.begin();
  double before = 0.0;
  double last = 0.0;
  std::vector<double> peaks;
  for (int k = 1; k <= 1500; ++k) {
    free_run.integrate(0.004 * k, 0.004);
    const double norm2 = free_run.get("W_norm2[2,1]");
    if (last > before && last > norm2) peaks.push_back(last);
    before = last;
    last = norm2;
  }
  ASSERT_GE(peaks.size(), 2U);
  for (const double below : {1e-4, 1e-7, 1e-10, 1e-13}) {
    const double bound = peaks.back() * (1.0 - below);
    Importer importer(game(bound));
    importer.begin();
    importer.integrate(6.0, 0.004);
    EXPECT_EQ(importer.state_events, importer.get_integer("solver_events")) << below;
    EXPECT_EQ(importer.step_events, 0) << below;
    EXPECT_LE(importer.state_events, 40) << below;
    EXPECT_LE(importer.get("W_norm2[2,1]"), bound * (1.0 + 1e-6)) << below;
  }
}

TEST(ModelExchangeTime, TheStopTimeBoundsStepsNotTrials) {
  Importer importer;
  importer.begin(1.0, 2.0);
  EXPECT_EQ(importer.get("time"), 1.0);
  importer.integrate(2.0, 0.01);
  const auto state = importer.state();
  ASSERT_EQ(fmi2SetTime(importer.component, 2.1), fmi2OK) << "integrators evaluate beyond it";
  fmi2Boolean enter = fmi2False;
  fmi2Boolean terminate = fmi2False;
  EXPECT_EQ(fmi2CompletedIntegratorStep(importer.component, fmi2True, &enter, &terminate), fmi2Error);
  EXPECT_TRUE(mentions(importer.last_message(), "stop time 2")) << importer.last_message();
  importer.move_to(2.0 + 1e-10, state);
  EXPECT_EQ(fmi2CompletedIntegratorStep(importer.component, fmi2True, &enter, &terminate), fmi2OK) << "by rounding";
}

TEST(ModelExchangeTime, DisturbancesFollowTheTimeSet) {
  Importer importer;
  importer.begin(0.0);
  const double now = importer.get("der(x[1,1])");
  ASSERT_EQ(fmi2SetTime(importer.component, 0.7), fmi2OK);
  // d = bias + amplitude sin(frequency t + phase)
  EXPECT_NEAR(importer.get("der(x[1,1])") - now, 0.9 * (std::sin(2.0 * 0.7 + 0.1) - std::sin(0.1)), 1e-13);
  ASSERT_EQ(fmi2SetTime(importer.component, 0.0), fmi2OK);
  EXPECT_EQ(importer.get("der(x[1,1])"), now);
}

TEST(ModelExchangeTime, MayBeUnixTimeFarFromTheStartToo) {
  const double time = 1.76e9 + 0.7;
  Importer started;
  Importer far;
  Importer moved;
  for (int i = 1; i <= 3; ++i) {
    for (int l = 1; l <= 2; ++l) {
      const std::string phase = "disturbance_phase" + indices(i, l);
      const double frequency = 0.7 * i + 0.3 * l;
      for (Importer* each : {&started, &far, &moved}) {
        ASSERT_EQ(each->set("disturbance_frequency" + indices(i, l), frequency), fmi2OK);
      }
      ASSERT_EQ(moved.set(phase, mixed_order_game::reduced_angle(frequency, time, moved.get(phase))), fmi2OK);
    }
  }
  started.begin(1.76e9);
  far.begin(0.0);
  moved.begin(0.0);
  const std::vector<double> expected = moved.rate();
  for (Importer* each : {&started, &far}) {
    const std::vector<double> at_start = each->rate();
    ASSERT_EQ(fmi2SetTime(each->component, time), fmi2OK);
    EXPECT_EQ(each->get("time"), time);
    const std::vector<double> rates = each->rate();
    for (std::size_t k = 0; k < rates.size(); ++k)
      EXPECT_NEAR(rates[k], expected[k], 1e-12 * (1.0 + std::fabs(rates[k])));
    // a state saved there, and the way back
    const std::vector<char> bytes = each->serialized();
    ASSERT_EQ(fmi2SetTime(each->component, each == &far ? 0.0 : 1.76e9), fmi2OK);
    EXPECT_EQ(each->rate(), at_start);
    ASSERT_EQ(each->deserialize_and_set(bytes), fmi2OK);
    EXPECT_EQ(each->rate(), rates);
  }
}

TEST(ModelExchangeState, IsRestoredBitForBitInEveryMode) {
  Importer importer;
  const fmi2Component c = importer.component;
  const auto continued = [&] {
    importer.integrate(1.2, 0.002);
    return importer.all();
  };
  importer.begin();
  importer.integrate(0.9, 0.002);
  ASSERT_GE(importer.get_integer("solver_events"), 1);
  ASSERT_EQ(importer.set("d_ext[1,2]", 0.3), fmi2OK);
  fmi2FMUstate in_continuous_time = nullptr;
  ASSERT_EQ(fmi2GetFMUstate(c, &in_continuous_time), fmi2OK);
  const auto bytes = importer.serialized();
  const auto expected = continued();
  ASSERT_EQ(fmi2EnterEventMode(c), fmi2OK);
  ASSERT_EQ(importer.set("k3", 30.0), fmi2OK);
  fmi2FMUstate in_event_mode = nullptr;
  ASSERT_EQ(fmi2GetFMUstate(c, &in_event_mode), fmi2OK);
  const auto at_event = importer.all();
  importer.finish_event();
  importer.integrate(1.5, 0.002);

  ASSERT_EQ(fmi2SetFMUstate(c, in_continuous_time), fmi2OK) << importer.last_message();
  importer.time = 0.9;
  EXPECT_TRUE(same_values(importer, continued(), expected));
  ASSERT_EQ(fmi2SetFMUstate(c, in_event_mode), fmi2OK);
  EXPECT_TRUE(same_values(importer, importer.all(), at_event));
  EXPECT_EQ(fmi2EnterContinuousTimeMode(c), fmi2OK);
  ASSERT_EQ(fmi2Terminate(c), fmi2OK);
  ASSERT_EQ(fmi2SetFMUstate(c, in_continuous_time), fmi2OK) << importer.last_message();

  Importer other;
  ASSERT_EQ(other.deserialize_and_set(bytes), fmi2OK) << other.last_message();
  EXPECT_EQ(other.serialized(), bytes);
  other.time = 0.9;
  other.integrate(1.2, 0.002);
  EXPECT_TRUE(same_values(other, other.all(), expected));
  ASSERT_EQ(fmi2FreeFMUstate(c, &in_continuous_time), fmi2OK);
  ASSERT_EQ(fmi2FreeFMUstate(c, &in_event_mode), fmi2OK);
}

TEST(ModelExchangeState, ForeignAndDamagedBytesAreRefused) {
  Importer importer;
  importer.begin();
  importer.integrate(0.2, 0.002);
  Slave slave;
  slave.initialize();
  EXPECT_EQ(importer.deserialize_and_set(slave.serialized()), fmi2Error);
  EXPECT_TRUE(mentions(importer.last_message(), "model exchange")) << importer.last_message();
  const auto bytes = importer.serialized();
  EXPECT_EQ(slave.deserialize_and_set(bytes), fmi2Error);
  EXPECT_TRUE(mentions(slave.last_message(), "co-simulation")) << slave.last_message();
  EXPECT_EQ(slave.step(0.0, 0.1), fmi2OK);
  const auto before = importer.all();
  for (std::size_t k = 0; k < bytes.size(); k += k < 100 ? 1 : 31) {
    auto damaged = bytes;
    damaged[k] = static_cast<char>(damaged[k] ^ 0x10);
    ASSERT_EQ(importer.deserialize_and_set(damaged), fmi2Error) << k;
  }
  EXPECT_TRUE(same_values(importer, importer.all(), before));
}

TEST(Behaviour05NoGrowth, SavingAndFreeingInModelExchange) {
  Importer importer;
  importer.begin();
  const auto cycle = [&] {
    fmi2FMUstate state = nullptr;
    ASSERT_EQ(fmi2GetFMUstate(importer.component, &state), fmi2OK);
    ASSERT_EQ(fmi2SetFMUstate(importer.component, state), fmi2OK);
    ASSERT_EQ(importer.rate().size(), importer.states());
    ASSERT_EQ(fmi2FreeFMUstate(importer.component, &state), fmi2OK);
  };
  for (int k = 0; k < 100; ++k) cycle();
  const std::size_t before = mallinfo2().uordblks;
  for (int k = 0; k < 2'000; ++k) cycle();
  EXPECT_LE(mallinfo2().uordblks, before + 16384);
}

TEST(Behaviour21Instances, InThreadsAreIndependentInModelExchange) {
  const auto course = [] {
    Importer importer;
    importer.begin();
    importer.integrate(0.8, 0.004);
    return importer.all();
  };
  const auto expected = course();
  std::vector<std::vector<double>> seen(16);
  std::vector<std::thread> threads;
  for (auto& values : seen) threads.emplace_back([&] { values = course(); });
  for (auto& thread : threads) thread.join();
  for (const auto& values : seen) EXPECT_EQ(values, expected);
}

TEST(ModelExchangeState, ResetEqualsAFreshInstance) {
  const auto course = [](Importer& importer) {
    std::vector<double> seen = importer.all();
    importer.begin();
    importer.integrate(0.8, 0.004);
    const auto values = importer.all();
    seen.insert(seen.end(), values.begin(), values.end());
    return seen;
  };
  Importer fresh;
  const auto expected = course(fresh);
  for (const auto& [phase, enter] : phases) {
    Importer importer;
    ASSERT_EQ(importer.set("k1", 9.0), fmi2OK);
    enter(importer);
    ASSERT_EQ(fmi2Reset(importer.component), fmi2OK);
    EXPECT_EQ(course(importer), expected) << phase;
  }
}
