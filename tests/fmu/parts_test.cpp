// The behaviours of an FMU that depend on its game, of players apart and of external plants: inputs that change at
// every communication point, some with derivatives.
#include <cmath>
#include <limits>
#include <pugixml.hpp>

#include "importer.hpp"
#include "larger.hpp"
#include "model_description.hpp"

using mixed_order_game::Causality, mixed_order_game::ModelVariables, mixed_order_game::Type;

namespace {

/// All but the players; their weights reach the bound within the first second.
constexpr const char* head = R"toml(title = "Players apart"
dimension = 2
[gains]
k1 = 6.0
k2 = 0.9
k3 = 20.0
k4 = 15.0
beta = 30.0
delta = 1.5
epsilon = 0.5
[rbf]
centers = [-1.6, -0.7, 0.1, 0.9, 1.8]
width = 3.0
W_max = 0.5
[graph]
)toml";
constexpr const char* first = R"toml(
[[player]]
name = "first"
order = 1
x0 = [0.8, -1.1]
z0 = [0.3, 0.2]
cost = { quadratic = 1.2, linear = [0.4, -0.7], coupling = [[2, 0.5]] }
dynamics = { linear = [[1, [0.5, -0.4]], [3, [0.2, 0.3]]], square = [[2, [0.05, 0.04]]] }
disturbance = { amplitude = [0.9, 1.1], frequency = [2.0, 3.0], phase = [0.1, -0.4], bias = [0.2, -0.3] }
)toml";
constexpr const char* second = R"toml(
[[player]]
name = "second"
order = 2
x0 = [-0.6, 1.4]
v0 = [0.25, -0.35]
gains = { k4 = 12.0, delta = 1.1 }
u_max = [4.0, 9.0]
cost = { expression = "1.4 * (x[2,1]^2 + x[2,2]^2) + 0.3 * exp(0.2 * x[2,1] - 0.1 * x[3,2])" }
dynamics = { expression = "0.4 * sin(x[1,l]) - 0.2 * v[2,l] + 0.1 * x[3,1]" }
disturbance = { expression = "0.8 * square(t, 1.1) + 0.2 * l" }
)toml";
constexpr const char* outside_of_order_1 = R"toml(
[[player]]
name = "third"
order = 1
plant = "external"
z0 = [0.1, -0.3]
cost = { quadratic = 1.7, linear = [-0.6, 0.9], coupling = [[1, 0.3]] }
)toml";
constexpr const char* outside_of_order_2 = R"toml(
[[player]]
name = "third"
order = 2
plant = "external"
cost = { quadratic = 1.3, linear = [-0.2, 0.4], coupling = [[1, 0.25]] }
)toml";
constexpr const char* elsewhere_of_order_1 = "[[player]]\nelsewhere = true\norder = 1\n";
constexpr const char* elsewhere_of_order_2 = "[[player]]\nelsewhere = true\norder = 2\n";

constexpr const char* line = "edges = [[1, 2, 1.3], [2, 3]]\n";
constexpr const char* ring = "directed = true\nedges = [[2, 1, 1.3], [3, 2], [1, 3, 0.7]]\n";

std::string game_of(const char* edges, std::initializer_list<const char*> players) {
  std::string game = head;
  game += edges;
  for (const char* player : players) game += player;
  return game;
}

struct Part {
  const char* name;
  std::string game;
};
std::ostream& operator<<(std::ostream& out, const Part& part) { return out << part.name; }

const std::vector<Part>& parts() {
  static const std::vector<Part> all = {
      {"OnePlayerOfOrder1", game_of("edges = [[1, 2, 1.3]]\n", {first, elsewhere_of_order_2, elsewhere_of_order_1})},
      {"OnePlayerOfOrder2", game_of(line, {elsewhere_of_order_1, second, elsewhere_of_order_1})},
      {"TwoPlayersOfADirectedRing",
       game_of("directed = true\nedges = [[2, 1, 1.3], [3, 2]]\n", {first, second, elsewhere_of_order_1})},
      {"PlantOfOrder1Outside", game_of(line, {first, second, outside_of_order_1})},
      {"PlantOfOrder2Outside", game_of(ring, {first, second, outside_of_order_2})},
      {"OnePlayerWithItsPlantOutside",
       game_of("edges = [[2, 3]]\n", {elsewhere_of_order_1, elsewhere_of_order_2, outside_of_order_2})},
  };
  return all;
}

class BehavioursOfParts : public testing::TestWithParam<Part> {
 protected:
  [[nodiscard]] static const std::string& game() { return GetParam().game; }
};

std::vector<std::string> of_causality(const Slave& slave, Causality causality) {
  std::vector<std::string> names;
  const ModelVariables& variables = slave.model().variables;
  for (int k = 0; k < variables.size(); ++k) {
    if (variables.family(k).causality == causality && variables.family(k).type == Type::real) {
      names.push_back(variables.name(k));
    }
  }
  return names;
}
std::vector<std::string> inputs(const Slave& slave) { return of_causality(slave, Causality::input); }
std::vector<std::string> outputs(const Slave& slave) { return of_causality(slave, Causality::output); }

/// A smooth signal of its own for each input; its derivative.
double signal(std::size_t input, double t) { return 0.6 * std::sin(0.9 * t + 0.7 * static_cast<double>(input)); }
double signal_rate(std::size_t input, double t) { return 0.54 * std::cos(0.9 * t + 0.7 * static_cast<double>(input)); }

/// Values of all inputs, and of every second one its derivative.
void set_inputs(Slave& slave, double t) {
  const auto names = inputs(slave);
  for (std::size_t k = 0; k < names.size(); ++k) {
    ASSERT_EQ(slave.set(names[k], signal(k, t)), fmi2OK) << slave.last_message();
    if (k % 2 == 0) {
      ASSERT_EQ(slave.set_derivative(names[k], 1, signal_rate(k, t)), fmi2OK) << slave.last_message();
    }
  }
}

/// The k-th stretch of a run from t = 0.3 k, in which inputs and tunable parameters change.
constexpr int stretches = 8;
std::vector<double> stretch(Slave& slave, int k) {
  const double t = 0.3 * k;
  if (k != 3) set_inputs(slave, t);  // once they are left alone, so that the polynomials go on
  fmi2Status changed = fmi2OK;
  if (k == 4) {
    for (const std::string& name : of_causality(slave, Causality::parameter)) {
      if (name.starts_with("k3")) changed = std::max(changed, slave.set(name, 1.1 * slave.get(name)));
    }
  }
  EXPECT_EQ(changed, fmi2OK) << slave.last_message();
  EXPECT_EQ(slave.step(t, 0.11), fmi2OK) << slave.last_message();
  EXPECT_EQ(slave.step(t + 0.11, 0.19), fmi2OK) << slave.last_message();
  return slave.all();
}

double largest_difference(Slave& a, Slave& b) {
  double largest = 0.0;
  for (const std::string& name : outputs(a)) {
    largest = mixed_order_game::testing::larger(largest, std::fabs(a.get(name) - b.get(name)));
  }
  return largest;
}

/// Inputs that are polynomials from the start.
void begin_with_inputs(Slave& slave, double tolerance = 1e-6, double start = 0.0) {
  slave.initialize(start, tolerance);
  set_inputs(slave, 0.4);
}

}  // namespace

INSTANTIATE_TEST_SUITE_P(All, BehavioursOfParts, testing::ValuesIn(parts()),
                         [](const auto& part) { return std::string(part.param.name); });

TEST_P(BehavioursOfParts, B01RollbackRepeatsBitForBitInAnyOrder) {
  Slave slave(game());
  slave.initialize();
  std::vector<fmi2FMUstate> saved(stretches, nullptr);
  std::vector<std::vector<double>> seen;
  for (std::size_t k = 0; k < stretches; ++k) {
    ASSERT_EQ(fmi2GetFMUstate(slave.component, &saved[k]), fmi2OK);
    seen.push_back(stretch(slave, static_cast<int>(k)));
  }
  for (const int from : {5, 1, 7, 0, 3, 3}) {
    ASSERT_EQ(fmi2SetFMUstate(slave.component, saved[static_cast<std::size_t>(from)]), fmi2OK);
    for (int k = from; k < stretches; ++k) {
      ASSERT_TRUE(same_values(slave, stretch(slave, k), seen[static_cast<std::size_t>(k)]))
          << "restored at " << from << ", stretch " << k;
    }
  }
  for (fmi2FMUstate& state : saved) EXPECT_EQ(fmi2FreeFMUstate(slave.component, &state), fmi2OK);
}

// Inputs may change in continuous time, where the last step ended.
TEST_P(BehavioursOfParts, B01ByModelExchangeAStepAcceptedWhereInputsChangedIsRestored) {
  Importer importer(game());
  importer.begin();
  importer.integrate(0.1, 1e-2);
  for (const std::string& name : inputs(importer)) ASSERT_EQ(importer.set(name, 0.9), fmi2OK);
  fmi2Boolean enters = fmi2False;
  fmi2Boolean ends = fmi2False;
  ASSERT_EQ(fmi2CompletedIntegratorStep(importer.component, fmi2True, &enters, &ends), fmi2OK);
  const auto bytes = importer.serialized();
  importer.integrate(0.2, 1e-2);
  Importer other(game());
  ASSERT_EQ(other.deserialize_and_set(bytes), fmi2OK) << other.last_message();
  other.time = 0.1;
  other.integrate(0.2, 1e-2);
  EXPECT_TRUE(same_values(other, other.all(), importer.all()));
}

TEST_P(BehavioursOfParts, B02SavingIsNeutralAndB21InstancesAreIndependent) {
  Slave plain(game());
  Slave saving(game());
  plain.initialize();
  saving.initialize();
  fmi2FMUstate state = nullptr;
  for (int k = 0; k < stretches; ++k) {
    ASSERT_EQ(fmi2GetFMUstate(saving.component, &state), fmi2OK);
    const auto values = stretch(plain, k);
    EXPECT_TRUE(same_values(plain, stretch(saving, k), values));
  }
  EXPECT_EQ(fmi2FreeFMUstate(saving.component, &state), fmi2OK);
}

TEST_P(BehavioursOfParts, B03AndB04ABytesContinueInAnotherInstanceAndDamagedOnesAreRefused) {
  Slave slave(game());
  slave.initialize();
  for (int k = 0; k < 3; ++k) stretch(slave, k);
  ASSERT_EQ(slave.set(inputs(slave).back(), 0.77), fmi2OK) << "not acting yet";
  const auto bytes = slave.serialized();
  const auto before = slave.all();
  Slave other(game());
  ASSERT_EQ(other.deserialize_and_set(bytes), fmi2OK) << other.last_message();
  EXPECT_TRUE(same_values(slave, other.all(), before));
  EXPECT_EQ(other.serialized(), bytes);
  for (int k = 3; k < stretches; ++k) {
    const auto values = stretch(slave, k);
    ASSERT_TRUE(same_values(slave, stretch(other, k), values)) << k;
  }
  const auto at_the_end = other.all();
  for (std::size_t k = 0; k < bytes.size(); k += 211) {
    auto damaged = bytes;
    damaged[k] = static_cast<char>(damaged[k] ^ 0x10);
    ASSERT_EQ(other.deserialize_and_set(damaged), fmi2Error) << k;
  }
  EXPECT_TRUE(same_values(slave, other.all(), at_the_end));
}

TEST_P(BehavioursOfParts, B06ResetEqualsAFreshInstance) {
  const auto course = [](Slave& slave) {
    std::vector<double> seen = slave.all();
    slave.initialize();
    for (int k = 0; k < stretches; ++k) {
      const auto values = stretch(slave, k);
      seen.insert(seen.end(), values.begin(), values.end());
    }
    return seen;
  };
  Slave fresh(game());
  const auto expected = course(fresh);
  Slave slave(game());
  set_inputs(slave, 2.0);
  for (int k = 0; k < 2; ++k) {
    ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
    EXPECT_EQ(course(slave), expected);
  }
}

TEST_P(BehavioursOfParts, B07StartValuesAreThoseOfTheDescription) {
  Slave slave(game());
  pugi::xml_document document;
  ASSERT_TRUE(document.load_string(model_description(slave.model()).c_str()));
  int checked = 0;
  for (const auto& node : document.child("fmiModelDescription").child("ModelVariables").children("ScalarVariable")) {
    const auto start = node.child("Real").attribute("start");
    if (!start) continue;
    ++checked;
    const std::string name = node.attribute("name").value();
    EXPECT_EQ(slave.get(name), std::strtod(start.value(), nullptr)) << name;
  }
  EXPECT_GE(checked, static_cast<int>(inputs(slave).size()) + 10);
}

TEST_P(BehavioursOfParts, B08InputsOfInitializationModeActOnWhatIsRead) {
  Slave early(game());
  ASSERT_EQ(fmi2SetupExperiment(early.component, fmi2False, 0.0, 0.0, fmi2False, 0.0), fmi2OK);
  ASSERT_EQ(fmi2EnterInitializationMode(early.component), fmi2OK);
  set_inputs(early, 0.4);
  const auto names = outputs(early);
  std::vector<double> before;
  for (const std::string& name : names) before.push_back(early.get(name));
  ASSERT_EQ(fmi2ExitInitializationMode(early.component), fmi2OK);
  for (std::size_t k = 0; k < names.size(); ++k) {
    EXPECT_EQ(early.get(names[k]), before[k]) << names[k] << ": ending initialization changes no value";
  }
  Slave without(game());
  without.initialize();
  bool act = false;
  for (std::size_t k = 0; k < names.size(); ++k) act |= without.get(names[k]) != before[k];
  EXPECT_EQ(act, !early.model().game.parameters.shape.external.empty())
      << "controls depend on measured actions at once, on what is heard later";
}

TEST_P(BehavioursOfParts, B09AndB11WhatCannotBeSetOrIsNotFiniteIsRefusedByName) {
  Slave slave(game());
  begin_with_inputs(slave);
  slave.run(0.0, 0.3, 2);
  const auto before = slave.all();
  const auto refused = [&](const std::string& name, double value) {
    slave.log.clear();
    EXPECT_EQ(slave.set(name, value), fmi2Error) << name;
    EXPECT_NE(slave.last_message().find(name), std::string::npos) << slave.last_message();
    EXPECT_TRUE(same_values(slave, slave.all(), before));
  };
  for (const std::string& name : outputs(slave)) refused(name, 1.0);
  for (const std::string& name : inputs(slave)) {
    for (const double value : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      refused(name, value);
      EXPECT_EQ(slave.set_derivative(name, 1, value), fmi2Error) << name;
    }
  }
  EXPECT_EQ(slave.step(0.3, 0.1), fmi2OK);
}

TEST_P(BehavioursOfParts, B13CommunicationPointsLeaveNoTraceAndInputsNeverActBefore) {
  Slave coarse(game());
  Slave fine(game());
  begin_with_inputs(coarse);
  begin_with_inputs(fine);
  for (int k = 0; k < 8; ++k) {
    const double t = 0.25 * k;
    ASSERT_EQ(coarse.step(t, 0.25), fmi2OK) << coarse.last_message();
    ASSERT_EQ(fine.step(t, 0.0625), fmi2OK);
    ASSERT_EQ(fine.step(t + 0.0625, 0.1875), fmi2OK);
    ASSERT_TRUE(same_values(fine, fine.all(), coarse.all())) << t;
  }
  const auto states = [](Slave& slave) {
    std::vector<double> values;
    for (const int state : slave.model().variables.states()) {
      values.push_back(slave.get(slave.model().variables.name(state)));
    }
    return values;
  };
  const auto before = states(coarse);
  for (const std::string& name : inputs(coarse)) ASSERT_EQ(coarse.set(name, 50.0), fmi2OK);
  EXPECT_EQ(states(coarse), before);
}

TEST_P(BehavioursOfParts, B14OneLongStepAgreesWithManyAndB15WrongStepsLeaveTheStateAlone) {
  Slave one(game());
  Slave many(game());
  begin_with_inputs(one);
  begin_with_inputs(many);
  ASSERT_EQ(one.step(0.0, 3.0), fmi2OK) << one.last_message();
  for (int k = 0; k < 192; ++k) {
    const double t = k / 64.0;
    if (k == 100) {
      const auto before = many.all();
      for (const auto& [from, h] : {std::pair{t, 0.0}, {t, -0.1}, {t + 0.1, 0.1}}) {
        EXPECT_EQ(many.step(from, h), fmi2Error);
      }
      EXPECT_TRUE(same_values(many, many.all(), before));
    }
    ASSERT_EQ(many.step(t, 1.0 / 64.0), fmi2OK) << many.last_message();
  }
  EXPECT_LE(largest_difference(one, many), 1e-12);
}

TEST_P(BehavioursOfParts, B18TheErrorFallsWithTheTolerance) {
  Slave reference(game());
  begin_with_inputs(reference, 1e-11);
  reference.run(0.0, 2.0, 4);
  double last = 1.0;
  for (const double tolerance : {1e-3, 1e-5, 1e-7}) {
    Slave slave(game());
    begin_with_inputs(slave, tolerance);
    slave.run(0.0, 2.0, 4);
    const double error = largest_difference(slave, reference);
    EXPECT_LT(error, 0.5 * last) << tolerance;
    EXPECT_LT(error, 3000.0 * tolerance);  // drives are stiff: the factor is delta^2 K / epsilon and the gains'
    last = error;
  }
}

// A step in which a control leaves its bound, without a restart, ends where the square wave jumps.
TEST(Behaviour18Tolerance, AnyServesWhereAStepWithAnEventEndsAtATimeKnownBeforehand) {
  const std::string game = parts()[3].game;
  for (int k = 0; k < 40; ++k) {
    Slave slave(game);
    begin_with_inputs(slave, 1e-2 * std::pow(10.0, -0.1 * k));
    EXPECT_EQ(slave.step(0.0, 3.0), fmi2OK) << slave.last_message();
  }
}

TEST_P(BehavioursOfParts, B19SettingTheSameValuesAgainLeavesNoTrace) {
  Slave plain(game());
  Slave setting(game());
  for (Slave* slave : {&plain, &setting}) {
    slave->initialize();
    for (const std::string& name : inputs(*slave)) ASSERT_EQ(slave->set(name, 0.3), fmi2OK);
  }
  for (int k = 0; k < 40; ++k) {
    for (const std::string& name : inputs(setting)) {
      ASSERT_EQ(setting.set(name, 7.0), fmi2OK);
      ASSERT_EQ(setting.set(name, 0.3), fmi2OK);
      ASSERT_EQ(setting.set_derivative(name, 1, 0.0), fmi2OK);
    }
    ASSERT_EQ(plain.step(0.05 * k, 0.05), fmi2OK);
    ASSERT_EQ(setting.step(0.05 * k, 0.05), fmi2OK);
  }
  EXPECT_TRUE(same_values(plain, plain.all(), setting.all())) << "the same bits at the same cost";
}

TEST_P(BehavioursOfParts, B19RampsByDerivativesEqualFineSteps) {
  Slave ramp(game());
  ramp.initialize(0.0, 1e-9);
  const auto names = inputs(ramp);
  for (std::size_t k = 0; k < names.size(); ++k) {
    ASSERT_EQ(ramp.set(names[k], signal(k, 0.0)), fmi2OK);
    ASSERT_EQ(ramp.set_derivative(names[k], 1, signal_rate(k, 0.0)), fmi2OK);
  }
  ASSERT_EQ(ramp.step(0.0, 0.4), fmi2OK) << ramp.last_message();
  Slave fine(game());
  fine.initialize(0.0, 1e-9);
  constexpr int steps = 2000;
  constexpr double h = 0.4 / steps;
  for (int n = 0; n < steps; ++n) {
    for (std::size_t k = 0; k < names.size(); ++k) {
      ASSERT_EQ(fine.set(names[k], signal(k, 0.0) + signal_rate(k, 0.0) * (n + 0.5) * h), fmi2OK);
    }
    ASSERT_EQ(fine.step(n * h, h), fmi2OK) << fine.last_message();
  }
  for (const int state : ramp.model().variables.states()) {
    const std::string name = ramp.model().variables.name(state);
    EXPECT_NEAR(fine.get(name), ramp.get(name), 1e-5) << name;
  }
}

TEST_P(BehavioursOfParts, B19OutputDerivativesAreExact) {
  const double h = 2e-5;
  std::vector<std::vector<double>> at;
  for (const double end : {0.7, 0.7 + h, 0.7 + 2.0 * h}) {
    Slave slave(game());
    slave.initialize(0.0, 1e-10);
    const auto names = inputs(slave);
    for (std::size_t k = 0; k < names.size(); ++k) {
      ASSERT_EQ(slave.set(names[k], signal(k, 0.0)), fmi2OK);
      ASSERT_EQ(slave.set_derivative(names[k], 1, signal_rate(k, 0.0)), fmi2OK);
    }
    ASSERT_EQ(slave.step(0.0, end), fmi2OK) << slave.last_message();
    std::vector<double> values;
    for (const std::string& name : outputs(slave)) values.push_back(slave.get(name));
    at.push_back(values);
    if (at.size() != 2) continue;
    std::vector<double> rates;
    for (const std::string& name : outputs(slave)) rates.push_back(slave.output_derivative(name));
    at.push_back(rates);
  }
  Slave names(game());
  for (std::size_t k = 0; k < at[0].size(); ++k) {
    const double difference = (at[3][k] - at[0][k]) / (2.0 * h);
    EXPECT_NEAR(at[2][k], difference, 2e-3 * (1.0 + std::fabs(difference))) << outputs(names)[k];
  }
}

TEST_P(BehavioursOfParts, B17MayStartAtUnixTimeAndB16EndsAtTheStopTime) {
  constexpr double start = 1.76e9;
  Slave slave(game());
  slave.initialize(start, 1e-6, start + 1.0);
  for (int k = 0; k < 64; ++k) {
    const double t = start + k / 64.0;
    set_inputs(slave, k / 64.0);
    ASSERT_EQ(slave.step(t, 1.0 / 64.0), fmi2OK) << slave.last_message();
  }
  EXPECT_EQ(slave.get("time"), start + 1.0);
  const auto before = slave.all();
  EXPECT_EQ(slave.step(start + 1.0, 0.1), fmi2Error);
  EXPECT_TRUE(same_values(slave, slave.all(), before));
}

// Of conditions that a change of inputs or parameters decides anew.
TEST(EventsOfParts, CountThoseAtAChangeInBothInterfaces) {
  std::string player = second;
  const std::string smooth = "0.4 * sin(x[1,l])";
  player.replace(player.find(smooth), smooth.size(), "if(x[1,l] > 0.5, 0.4, -0.4)");
  const std::string game = game_of(line, {elsewhere_of_order_1, player.c_str(), elsewhere_of_order_1});
  Slave slave(game);
  slave.initialize();
  Importer importer(game);
  importer.begin();
  int before = 0;
  for (const double heard : {1.0, 0.0}) {
    ASSERT_EQ(fmi2EnterEventMode(importer.component), fmi2OK);
    for (Slave* one : {&slave, static_cast<Slave*>(&importer)}) {
      for (const char* name : {"x[1,1]", "x[1,2]"}) ASSERT_EQ(one->set(name, heard), fmi2OK);
    }
    importer.finish_event();
    ASSERT_EQ(slave.step(slave.get("time"), 1e-6), fmi2OK) << slave.last_message();
    before += 2;
    EXPECT_EQ(slave.get_integer("solver_events"), before);
    EXPECT_EQ(importer.get_integer("solver_events"), before);
  }
  slave.run(1e-6 * 2.0, 0.01, 1);  // time events begin at 0.55 s
  EXPECT_EQ(slave.get_integer("solver_events"), before);
  ASSERT_EQ(slave.set("u_max[2,2]", 1e-3), fmi2OK);
  ASSERT_EQ(slave.step(0.01, 1e-6), fmi2OK) << slave.last_message();
  EXPECT_EQ(slave.get_integer("solver_events"), before + 1);
}

TEST_P(BehavioursOfParts, B20ARunThatInputsEndNamesTheFirstOfThem) {
  Slave slave(game());
  const auto names = inputs(slave);
  for (const double rate : {0.0, 1e300}) {
    begin_with_inputs(slave);
    slave.run(0.0, 0.1, 1);
    for (const std::string& name : names) {
      ASSERT_EQ(slave.set(name, rate == 0.0 ? 1e30 : 0.1), fmi2OK);
      ASSERT_EQ(slave.set_derivative(name, 3, rate), fmi2OK);
    }
    ASSERT_EQ(slave.step(0.1, 1.0), fmi2Error);
    EXPECT_NE(slave.last_message().find("the input " + names.front() + " is "), std::string::npos)
        << slave.last_message();
    ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
  }
}

TEST_P(BehavioursOfParts, B20AFailedRunIsMendedByResetAndRestore) {
  Slave slave(game());
  begin_with_inputs(slave);
  slave.run(0.0, 0.5, 2);
  const auto bytes = slave.serialized();
  const auto before = slave.all();
  for (const std::string& name : inputs(slave)) ASSERT_EQ(slave.set(name, 1e300), fmi2OK) << slave.last_message();
  ASSERT_EQ(slave.step(0.5, 5.0), fmi2Error);
  EXPECT_FALSE(slave.last_message().empty());
  ASSERT_EQ(slave.deserialize_and_set(bytes), fmi2OK) << slave.last_message();
  EXPECT_TRUE(same_values(slave, slave.all(), before));
  EXPECT_EQ(slave.step(0.5, 0.1), fmi2OK) << slave.last_message();
  ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
  slave.initialize();
  EXPECT_EQ(slave.step(0.0, 0.1), fmi2OK) << slave.last_message();
}

TEST_P(BehavioursOfParts, ByModelExchangeTheRunIsThatOfCoSimulation) {
  Slave slave(game());
  slave.initialize(0.0, 1e-9);
  Importer importer(game());
  ASSERT_EQ(fmi2SetupExperiment(importer.component, fmi2True, 1e-9, 0.0, fmi2False, 0.0), fmi2OK);
  ASSERT_EQ(fmi2EnterInitializationMode(importer.component), fmi2OK);
  const auto names = inputs(slave);
  for (std::size_t k = 0; k < names.size(); ++k) {
    ASSERT_EQ(slave.set(names[k], signal(k, 0.3)), fmi2OK);
    ASSERT_EQ(importer.set(names[k], signal(k, 0.3)), fmi2OK);
  }
  ASSERT_EQ(fmi2ExitInitializationMode(importer.component), fmi2OK);
  importer.finish_event();
  ASSERT_EQ(slave.step(0.0, 0.5), fmi2OK) << slave.last_message();
  importer.integrate(0.5, 1e-3);
  for (const int state : slave.model().variables.states()) {
    const std::string name = slave.model().variables.name(state);
    EXPECT_NEAR(importer.get(name), slave.get(name), 2e-6) << name;
  }
}
