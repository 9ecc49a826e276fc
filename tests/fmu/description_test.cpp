// modelDescription.xml: completeness, structure, and dependencies checked against the model's own behaviour.
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <pugixml.hpp>
#include <set>
#include <sstream>

#include "model_description.hpp"
#include "model_structure.hpp"
#include "slave.hpp"

using namespace mixed_order_game;

namespace {

int exit_code(const std::string& arguments) {
  const int status = std::system(("'" MIXED_ORDER_GAME_DESCRIPTION "' " + arguments).c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::string content(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace

TEST(Variables, AreThoseOfTheSpecification) {
  const Model model(small_game());
  const auto count = [&](const char* family) { return model.variables.find(family)->count; };
  const int N = 3;
  const int D = 2;
  const int q = 5;
  for (const char* name : {"k1",
                           "k2",
                           "k3",
                           "k4",
                           "beta",
                           "delta",
                           "epsilon",
                           "W_max",
                           "rho",
                           "robust",
                           "perturbed",
                           "allow_disconnected",
                           "tolerance_relative",
                           "tolerance_absolute",
                           "nash_error",
                           "consensus_error",
                           "gradient_norm",
                           "solver_steps",
                           "solver_rhs_evaluations",
                           "solver_events",
                           "time"}) {
    EXPECT_EQ(count(name), 1) << name;
  }
  for (const char* name : {"disturbance_amplitude", "disturbance_frequency", "disturbance_phase", "disturbance_bias",
                           "cost_linear", "x0", "d_ext", "x", "u", "x_star", "W_norm2", "phi", "nn"}) {
    EXPECT_EQ(count(name), N * D) << name;
  }
  for (const char* name : {"dynamics_gain", "cost_quadratic", "cost", "order"}) EXPECT_EQ(count(name), N) << name;
  EXPECT_EQ(count("center"), q);
  EXPECT_EQ(count("a"), N * (N - 1) / 2);
  EXPECT_EQ(count("cost_coupling"), N * (N - 1));
  EXPECT_EQ(count("v"), D);
  EXPECT_EQ(count("v0"), D);
  EXPECT_EQ(count("z"), 2 * D);
  EXPECT_EQ(count("z0"), 2 * D);
  EXPECT_EQ(count("y"), N * N * D);
  EXPECT_EQ(count("y0"), N * N * D);
  EXPECT_EQ(count("W"), N * q * D);
}

TEST(Variables, GainsAreThoseOfEachPlayerWhereOneStatesItsOwn) {
  Slave slave(small_game_with({{"x0 = [-0.6", "gains = { k4 = 16.0, epsilon = 0.04 }\nx0 = [-0.6"}}));
  const ModelVariables& variables = slave.model().variables;
  for (const auto& [family, players] :
       std::map<const char*, std::vector<int>>{{"k1", {1, 3}}, {"k4", {2}}, {"k2", {1, 2, 3}}, {"delta", {1, 2, 3}}}) {
    ASSERT_EQ(variables.find(family)->count, static_cast<int>(players.size())) << family;
    for (const int i : players) EXPECT_TRUE(variables.find(family, i - 1)) << family << i;
  }
  EXPECT_EQ(slave.get("k1[3]"), 6.0);
  EXPECT_EQ(slave.get("k4[2]"), 16.0);
  EXPECT_EQ(slave.get("epsilon[2]"), 0.04);
  EXPECT_EQ(slave.get("epsilon[3]"), 0.05);
  EXPECT_EQ(slave.set("k3[2]", 0.0), fmi2Error);
  EXPECT_NE(slave.last_message().find("k3[2]"), std::string::npos) << slave.last_message();
  ASSERT_EQ(slave.set("k3[2]", 30.0), fmi2OK);
  EXPECT_EQ(slave.get("k3[1]"), 20.0);
  EXPECT_EQ(slave.get("k3[2]"), 30.0);
}

TEST(Variables, ReadTheRightEntries) {
  Slave slave;
  EXPECT_EQ(slave.get("a[1,2]"), 1.3);
  EXPECT_EQ(slave.get("a[1,3]"), 0.0);
  EXPECT_EQ(slave.get("a[2,3]"), 1.0);
  EXPECT_EQ(slave.get("y0[1,3,2]"), 0.6);
  EXPECT_EQ(slave.get("y0[2,1,1]"), 0.7);
  EXPECT_EQ(slave.get("y0[2,3,2]"), -0.9);
  EXPECT_EQ(slave.get("cost_coupling[2,3]"), 0.6);
  EXPECT_EQ(slave.get("cost_coupling[3,2]"), 0.2);
  EXPECT_EQ(slave.get("cost_linear[3,2]"), 0.35);
  EXPECT_EQ(slave.get("disturbance_phase[2,1]"), 0.6);
  EXPECT_EQ(slave.get("disturbance_frequency[3,2]"), 1.8);
  EXPECT_EQ(slave.get("center[4]"), 0.9);
  EXPECT_EQ(slave.get("v0[2,2]"), -0.35);
  EXPECT_EQ(slave.get("z0[3,2]"), 0.55);
  EXPECT_EQ(slave.get_integer("order[2]"), 2);
  EXPECT_EQ(slave.get_integer("order[3]"), 1);
  slave.initialize();
  slave.run(0.0, 0.7, 3);
  double W_norm2 = 0.0;
  for (int m = 1; m <= 5; ++m) W_norm2 += std::pow(slave.get("W[3," + std::to_string(m) + ",2]"), 2);
  EXPECT_NEAR(slave.get("W_norm2[3,2]"), W_norm2, 1e-15);
  EXPECT_GT(W_norm2, 0.0);
  // f_3 = q |x_3|^2 + l . x_3 + const + c |x_3 - x_2|^2
  const double x31 = slave.get("x[3,1]");
  const double x32 = slave.get("x[3,2]");
  const double x21 = slave.get("x[2,1]");
  const double x22 = slave.get("x[2,2]");
  EXPECT_NEAR(slave.get("cost[3]"),
              2.1 * (x31 * x31 + x32 * x32) + 0.8 * x31 + 0.35 * x32 + 0.1 +
                  0.2 * ((x31 - x21) * (x31 - x21) + (x32 - x22) * (x32 - x22)),
              1e-13);
}

TEST(Variables, OutputsOnlyLeavesOutTheInside) {
  const Model model(small_game_with({{"dimension = 2\n", "dimension = 2\nexpose = \"outputs\"\n"}}));
  for (const char* family : {"y", "y0", "W", "der(x", "der(y"}) EXPECT_EQ(model.variables.find(family), nullptr);
  EXPECT_EQ(model.variables.find("a")->count, 2);
  EXPECT_EQ(model.variables.find("cost_coupling")->count, 4);
  EXPECT_TRUE(model_structure(model).derivatives.empty());
  const Model vectors(vector_centers_game());
  EXPECT_EQ(vectors.variables.find("center"), nullptr);
  EXPECT_EQ(vectors.variables.find("z")->count, 0);
}

TEST(Guid, IsAFingerprintOfTheGame) {
  const std::string guid = Model(small_game()).guid;
  EXPECT_EQ(guid.size(), 38U);
  EXPECT_EQ(guid, Model(small_game()).guid);
  EXPECT_NE(guid, Model(small_game_with({{"k1 = 6.0", "k1 = 6.25"}})).guid);
  EXPECT_NE(guid, Model(small_game_with({{"constant = 0.3", "constant = 0.4"}})).guid);
}

TEST(Description, SameBytesEveryTime) {
  EXPECT_EQ(model_description(Model(five_vehicles())), model_description(Model(five_vehicles())));
}

TEST(Description, DeclaresWhatItUses) {
  pugi::xml_document document;
  ASSERT_TRUE(document.load_string(model_description(Model(small_game())).c_str()));
  const auto root = document.child("fmiModelDescription");
  std::set<std::string> known_units;
  std::set<std::string> known_types;
  for (const auto& unit : root.child("UnitDefinitions").children()) known_units.insert(unit.attribute("name").value());
  for (const auto& type : root.child("TypeDefinitions").children()) known_types.insert(type.attribute("name").value());
  std::set<std::string> names;
  int index = 0;
  for (const auto& node : root.child("ModelVariables").children()) {
    ++index;
    const auto value = node.first_child();
    EXPECT_TRUE(names.insert(node.attribute("name").value()).second);
    EXPECT_FALSE(std::string(node.attribute("description").value()).empty());
    if (value.attribute("unit")) {
      EXPECT_TRUE(known_units.contains(value.attribute("unit").value()));
    }
    if (value.attribute("declaredType")) {
      EXPECT_TRUE(known_types.contains(value.attribute("declaredType").value()));
    }
    if (const auto state = value.attribute("derivative")) {
      auto other = root.child("ModelVariables").first_child();
      for (int k = 1; k < state.as_int(); ++k) other = other.next_sibling();
      EXPECT_EQ(node.attribute("name").value(), "der(" + std::string(other.attribute("name").value()) + ")");
    }
  }
  EXPECT_EQ(root.child("ModelStructure").child("Derivatives").first_child().attribute("index").as_int() > 0, true);
}

// Each initial unknown is moved by exactly the knowns that the structure lists for it.
TEST(Structure, InitialDependenciesAreExact) {
  for (const std::string& game : {small_game(), vector_centers_game()}) {
    Slave slave(game);
    const ModelVariables& variables = slave.model().variables;
    const ModelStructure structure = model_structure(slave.model());
    ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2False, 0.0, 0.2, fmi2False, 0.0), fmi2OK);
    // away from values at which a factor happens to vanish
    int salt = 0;
    const auto generic = [&](const std::string& name, Type type) {
      if (type == Type::real && !name.starts_with("tolerance") && name != "k1" && name != "epsilon") {
        ASSERT_EQ(slave.set(name, slave.get(name) + 0.011 * (1 + ++salt % 7)), fmi2OK) << slave.last_message();
      }
    };
    std::vector<int> knowns;
    for (int k = 0; k < variables.size(); ++k) {
      const Causality causality = variables.family(k).causality;
      if (causality == Causality::parameter || causality == Causality::input) {
        knowns.push_back(k);
        generic(variables.name(k), variables.family(k).type);
      }
    }
    ASSERT_EQ(slave.set("epsilon", 20.0), fmi2OK);  // tanh must not be saturated
    const auto base = slave.all();
    std::map<int, std::set<int>> moved;
    const auto compare = [&](int known) {
      const auto now = slave.all();
      for (const Unknown& unknown : structure.initial_unknowns) {
        if (now[at(unknown.reference)] != base[at(unknown.reference)]) moved[unknown.reference].insert(known);
      }
    };
    for (const int known : knowns) {
      const std::string name = variables.name(known);
      if (variables.family(known).type == Type::boolean) {
        const bool value = slave.get_boolean(name);
        ASSERT_EQ(slave.set_boolean(name, !value), fmi2OK);
        compare(known);
        ASSERT_EQ(slave.set_boolean(name, value), fmi2OK);
      } else {
        const double value = slave.get(name);
        ASSERT_EQ(slave.set(name, value + 0.01), fmi2OK) << slave.last_message();
        compare(known);
        ASSERT_EQ(slave.set(name, value), fmi2OK);
      }
    }
    ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2False, 0.0, 0.35, fmi2False, 0.0), fmi2OK);
    compare(0);  // time
    for (const Unknown& unknown : structure.initial_unknowns) {
      std::set<int> listed;
      for (const Dependency& dependency : unknown.dependencies) listed.insert(dependency.reference);
      for (const int known : moved[unknown.reference]) {
        EXPECT_TRUE(listed.contains(known)) << variables.name(unknown.reference) << " lacks " << variables.name(known);
      }
      for (const int known : listed) {
        EXPECT_TRUE(moved[unknown.reference].contains(known))
            << variables.name(unknown.reference) << " does not depend on " << variables.name(known);
      }
    }
  }
}

TEST(Structure, DerivativesAreInTheOrderOfTheStateVector) {
  const Model model(small_game());
  const auto structure = model_structure(model);
  std::vector<std::string> names;
  for (const Unknown& unknown : structure.derivatives) names.push_back(model.variables.name(unknown.reference));
  ASSERT_EQ(names.size(), static_cast<std::size_t>((2 + 3 + 5) * 6));
  EXPECT_EQ(names[0], "der(x[1,1])");
  EXPECT_EQ(names[1], "der(x[2,1])");
  EXPECT_EQ(names[3], "der(x[1,2])");
  EXPECT_EQ(names[6], "der(z[1,1])");
  EXPECT_EQ(names[7], "der(v[2,1])");
  EXPECT_EQ(names[12], "der(y[1,1,1])");
  EXPECT_EQ(names[13], "der(y[1,2,1])");
  EXPECT_EQ(names[30], "der(W[1,1,1])");
  EXPECT_EQ(names[36], "der(W[1,2,1])");
}

TEST(Tool, WritesChecksAndRefuses) {
  const std::string folder = resources_of(small_game());
  const std::string game = "'" + folder + "/game.toml'";
  const std::string xml = folder + "/out.xml";
  ASSERT_EQ(exit_code(game + " --output '" + xml + "'"), 0);
  EXPECT_EQ(content(xml), model_description(Model(small_game())));
  ASSERT_EQ(exit_code(game + " > '" + folder + "/printed.xml'"), 0);
  EXPECT_EQ(content(folder + "/printed.xml"), content(xml));
  EXPECT_EQ(exit_code("--check " + game), 0);
  EXPECT_EQ(exit_code("--help > /dev/null"), 0);
  EXPECT_EQ(exit_code("2> /dev/null"), 2);
  EXPECT_EQ(exit_code("--nonsense " + game + " 2> /dev/null"), 2);

  const std::string bad_folder = resources_of(small_game_with({{"k1 = 6.0", "k1 = -6.0"}}));
  const std::string bad_xml = bad_folder + "/out.xml";
  const std::string message = bad_folder + "/message";
  EXPECT_EQ(exit_code("'" + bad_folder + "/game.toml' -o '" + bad_xml + "' 2> '" + message + "'"), 1);
  EXPECT_TRUE(content(bad_xml).empty()) << "nothing half-made";
  const std::string told = content(message);
  EXPECT_TRUE(told.starts_with(bad_folder + "/game.toml: ")) << told;
  EXPECT_NE(told.find("k1"), std::string::npos) << told;
  EXPECT_EQ(std::count(told.begin(), told.end(), '\n'), 1);
  EXPECT_EQ(exit_code("--check '" + bad_folder + "/game.toml' 2> /dev/null"), 1);
  EXPECT_EQ(exit_code("/nowhere/game.toml 2> /dev/null"), 1);
  EXPECT_EQ(exit_code(game + " -o /nowhere/out.xml 2> /dev/null"), 1);
}
