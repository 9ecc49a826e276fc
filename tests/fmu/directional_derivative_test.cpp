// Directional derivatives and the dependencies of the model structure: every pair of an unknown and a known against
// derivatives of the reference loop (in a run) or of the FMU's own values (in initialization mode), zero where the
// structure declares none, and nonzero somewhere where it declares one.
#include <cmath>
#include <limits>
#include <set>

#include "importer.hpp"
#include "model_structure.hpp"
#include "reference_loop.hpp"
#include "slave.hpp"
#include "unknowns.hpp"

using namespace mixed_order_game;
using mixed_order_game::testing::assorted_recipes;
using mixed_order_game::testing::LoopSignals;
using mixed_order_game::testing::LoopState;
using mixed_order_game::testing::PlainGame;
using mixed_order_game::testing::random_game;
using mixed_order_game::testing::Recipe;
using mixed_order_game::testing::reference_rate;
using mixed_order_game::testing::Rows;
using mixed_order_game::testing::rows_of;
using mixed_order_game::testing::toml_of;

namespace {

using Values = std::map<std::string, double>;
/// Derivatives of every unknown (inner) with respect to every known (outer).
using Table = std::map<std::string, Values>;
using DependencyTable = std::map<std::string, std::map<std::string, DependencyKind>>;  // by unknown, then known

std::string name_of(const char* family, std::initializer_list<std::size_t> indices) {
  std::string name = family;
  char separator = '[';
  for (const std::size_t index : indices) {
    name += separator;
    name += std::to_string(index + 1);
    separator = ',';
  }
  name += ']';
  return name;
}

std::vector<std::string> names_where(const Model& model, Equations equations,
                                     bool (*holds)(const Model&, int, Equations)) {
  std::vector<std::string> names;
  for (int k = 0; k < model.variables.size(); ++k) {
    if (model.variables.family(k).type == Type::real && holds(model, k, equations)) {
      names.push_back(model.variables.name(k));
    }
  }
  return names;
}

std::vector<fmi2ValueReference> references(const Slave& slave, const std::vector<std::string>& names) {
  std::vector<fmi2ValueReference> references;
  for (const std::string& name : names) references.push_back(slave.reference(name));
  return references;
}

std::vector<double> directional_derivative(Slave& slave, const std::vector<std::string>& unknowns,
                                           const std::vector<std::string>& knowns, const std::vector<double>& changes) {
  std::vector<double> derivatives(unknowns.size(), std::nan(""));
  const auto unknown = references(slave, unknowns);
  const auto known = references(slave, knowns);
  EXPECT_EQ(fmi2GetDirectionalDerivative(slave.component, unknown.data(), unknown.size(), known.data(), known.size(),
                                         changes.data(), derivatives.data()),
            fmi2OK)
      << slave.last_message();
  return derivatives;
}

double directional_derivative(Slave& slave, const std::string& unknown, const std::string& known) {
  return directional_derivative(slave, std::vector{unknown}, {known}, {1.0})[0];
}

Table all_pairs(Slave& slave, Equations equations) {
  const auto unknowns = names_where(slave.model(), equations, is_unknown);
  Table table;
  for (const std::string& known : names_where(slave.model(), equations, is_known)) {
    const auto derivatives = directional_derivative(slave, unknowns, {known}, {1.0});
    for (std::size_t k = 0; k < unknowns.size(); ++k) table[known][unknowns[k]] = derivatives[k];
  }
  return table;
}

/// Of the model structure, with names.
DependencyTable dependencies_of(const Model& model, Equations equations) {
  const ModelStructure structure = model_structure(model);
  std::vector<Unknown> unknowns = structure.initial_unknowns;
  if (equations == Equations::running) {
    unknowns = structure.outputs;
    unknowns.insert(unknowns.end(), structure.derivatives.begin(), structure.derivatives.end());
  }
  DependencyTable dependencies;
  for (const Unknown& unknown : unknowns) {
    auto& known = dependencies[model.variables.name(unknown.reference)];
    for (const Dependency& dependency : unknown.dependencies) {
      known[model.variables.name(dependency.reference)] = dependency.kind;
    }
  }
  return dependencies;
}

void expect_zero_where_not_declared(const Table& table, const DependencyTable& declared) {
  for (const auto& [known, column] : table) {
    for (const auto& [unknown, value] : column) {
      if (!declared.at(unknown).contains(known)) {
        EXPECT_EQ(value, 0.0) << unknown << " does not declare " << known;
      }
    }
  }
}

void expect_close(const Table& computed, const Table& expected, double tolerance) {
  std::map<std::string, double> largest;  // of each unknown
  for (const auto& [known, column] : expected) {
    for (const auto& [unknown, value] : column) largest[unknown] = std::max(largest[unknown], std::abs(value));
  }
  for (const auto& [known, column] : computed) {
    for (const auto& [unknown, value] : column) {
      ASSERT_TRUE(expected.at(known).contains(unknown)) << unknown;
      ASSERT_NEAR(value, expected.at(known).at(unknown), tolerance * (1.0 + largest[unknown]))
          << unknown << " with respect to " << known;
    }
  }
}

/// A run of a random game beside the reference loop at the same state.
class Beside {
 public:
  explicit Beside(const PlainGame& game) : slave(toml_of(game)), game_(game) {}

  Slave slave;

  Table expected() {
    read_point();
    Table table;
    for_each(state_, [&](const std::string& name, double) {
      LoopState<std::complex<double>> moved = complex_state();
      for_each(moved, [&](const std::string& other, std::complex<double>& number) {
        if (other == name) number += std::complex<double>(0.0, step);
      });
      table[name] = along(moved, slave.get("time"));
    });
    for (std::size_t i = 0; i < game_.players; ++i) {
      for (std::size_t l = 0; l < game_.dimension; ++l) {
        Values column = along(complex_state(), slave.get("time"));  // nothing moves
        column[name_of(game_.order[i] == 1 ? "der(x" : "der(v", {i, l}) + ")"] = 1.0;
        table[name_of("d_ext", {i, l})] = column;
      }
    }
    table["time"] = along_time();
    return table;
  }

  int columns_on_sphere = 0;
  int columns_inside = 0;

 private:
  static constexpr double step = 1e-30;

  template <typename Scalar, typename Visit>
  void for_each(LoopState<Scalar>& state, Visit visit) const {
    for (std::size_t i = 0; i < game_.players; ++i) {
      for (std::size_t l = 0; l < game_.dimension; ++l) {
        visit(name_of("x", {i, l}), state.x[i][l]);
        visit(name_of(game_.order[i] == 1 ? "z" : "v", {i, l}), state.reference[i][l]);
        for (std::size_t j = 0; j < game_.players; ++j) visit(name_of("y", {i, j, l}), state.y[i][j][l]);
        for (std::size_t m = 0; m < game_.neurons; ++m) visit(name_of("W", {i, m, l}), state.W[i][m][l]);
      }
    }
  }

  LoopState<std::complex<double>> complex_state() {
    LoopState<std::complex<double>> state(game_);
    const auto flat = state_.flat();
    state.set_flat({flat.begin(), flat.end()});
    return state;
  }

  void read_point() {
    for_each(state_, [&](const std::string& name, double& number) { number = slave.get(name); });
    LoopSignals<double> signals;
    const std::vector<std::vector<int>> inside(game_.players, std::vector<int>(game_.dimension));
    reference_rate(game_, 0.0, state_, rows_of(game_.players, game_.dimension), inside, &signals);
    on_sphere_ = inside;
    for (std::size_t i = 0; i < game_.players; ++i) {
      for (std::size_t l = 0; l < game_.dimension; ++l) {
        const bool reached = std::abs(slave.get(name_of("W_norm2", {i, l})) / game_.W_max[i] - 1.0) < 1e-9;
        const bool on = game_.robust && reached && signals.error[i][l] * signals.network[i][l] >= 0.0;
        on_sphere_[i][l] = on ? 1 : 0;
        ++(on ? columns_on_sphere : columns_inside);
      }
    }
  }

  template <typename Scalar, typename Part>
  Values unknowns(LoopState<Scalar>& state, double t, Part part) {
    LoopSignals<Scalar> signals;
    LoopState<Scalar> rate =
        reference_rate(game_, t, state, rows_of(game_.players, game_.dimension), on_sphere_, &signals);
    Values values;
    for_each(rate, [&](const std::string& name, const Scalar& number) { values["der(" + name + ")"] = part(number); });
    double product = 0.0;
    double squares = 0.0;
    for (std::size_t i = 0; i < game_.players; ++i) {
      for (std::size_t l = 0; l < game_.dimension; ++l) {
        const double distance = state_.x[i][l] - slave.get(name_of("x_star", {i, l}));
        values[name_of("u", {i, l})] = part(signals.control[i][l]);
        values[name_of("x", {i, l})] = part(state.x[i][l]);
        if (game_.order[i] == 2) values[name_of("v", {i, l})] = part(state.reference[i][l]);
        product += distance * part(state.x[i][l]);
        squares += distance * distance;
      }
    }
    values["nash_error"] = product / std::sqrt(squares);
    return values;
  }

  Values along(LoopState<std::complex<double>> moved, double t) {
    return unknowns(moved, t, [](const std::complex<double>& number) { return number.imag() / step; });
  }

  // five points, with an error of the order h^4
  Values along_time() {
    constexpr double h = 1e-3;
    const double t = slave.get("time");
    Values derivatives = along(complex_state(), t);
    const auto rates = [&](double shift) { return unknowns(state_, t + shift, [](double number) { return number; }); };
    const Values near[] = {rates(h), rates(-h)};
    const Values far[] = {rates(2.0 * h), rates(-2.0 * h)};
    for (auto& [name, derivative] : derivatives) {
      if (!name.starts_with("der(")) continue;
      derivative = (8.0 * (near[0].at(name) - near[1].at(name)) - (far[0].at(name) - far[1].at(name))) / (12.0 * h);
    }
    return derivatives;
  }

  PlainGame game_;
  LoopState<double> state_{game_};
  std::vector<std::vector<int>> on_sphere_;
};

/// All but the largest.
std::vector<Recipe> recipes() {
  std::vector<Recipe> recipes = assorted_recipes();
  recipes.pop_back();
  return recipes;
}

/// The same game with expose = "outputs".
std::string outputs_only(std::string game) { return game.insert(game.find("dimension"), "expose = \"outputs\"\n"); }

/// Parameters and inputs away from values at which a factor happens to vanish.
void make_generic(Slave& slave) {
  int salt = 0;
  const ModelVariables& variables = slave.model().variables;
  for (int k = 0; k < variables.size(); ++k) {
    const Family& family = variables.family(k);
    if (family.type != Type::real || family.write == nullptr) continue;
    if (family.name.starts_with("tolerance") || family.name == "W_max") continue;
    const std::string name = variables.name(k);
    const double moved = slave.get(name) + 0.013 * (1 + ++salt % 7);
    ASSERT_EQ(slave.set(name, family.name == "a" ? moved + 0.3 : moved), fmi2OK) << slave.last_message();
  }
}

}  // namespace

class DirectionalDerivativeOfRandomGame : public ::testing::TestWithParam<Recipe> {};

TEST_P(DirectionalDerivativeOfRandomGame, IsThatOfTheEquationsInARun) {
  PlainGame game = random_game(GetParam());
  game.W_max = mixed_order_game::testing::everyone(game, 0.3);  // the sphere is reached and left
  for (auto& rows : game.W0) {
    for (auto& row : rows) {
      for (double& weight : row) weight *= 0.5;
    }
  }
  Beside beside(game);
  Slave& slave = beside.slave;
  const DependencyTable declared = dependencies_of(slave.model(), Equations::running);
  slave.initialize(0.4);
  for (const auto& [start, end] : {std::pair{0.4, 0.401}, {0.401, 1.2}}) {
    ASSERT_EQ(slave.set("d_ext[1,1]", 3.0 * end), fmi2OK);
    slave.run(start, end, 3);
    const Table table = all_pairs(slave, Equations::running);
    expect_close(table, beside.expected(), 1e-10);
    expect_zero_where_not_declared(table, declared);
  }
  if (game.robust) {
    EXPECT_GT(beside.columns_on_sphere, 0);
  }
  EXPECT_GT(beside.columns_inside, 0);
}

// Against the FMU's own initial values as each known moves.
TEST_P(DirectionalDerivativeOfRandomGame, IsThatOfTheInitialValues) {
  constexpr double h = 1e-3;
  constexpr double start = 0.4;
  Slave slave(toml_of(random_game(GetParam())));
  const Model& model = slave.model();
  const auto enter = [](Slave& entering, double start_time) {
    make_generic(entering);
    ASSERT_EQ(fmi2SetupExperiment(entering.component, fmi2False, 0.0, start_time, fmi2False, 0.0), fmi2OK);
    ASSERT_EQ(fmi2EnterInitializationMode(entering.component), fmi2OK);
  };
  const auto unknowns = names_where(model, Equations::initial, is_unknown);
  const auto unknown_references = references(slave, unknowns);
  const auto read = [&](Slave& from) {
    std::vector<double> values(unknowns.size());
    EXPECT_EQ(fmi2GetReal(from.component, unknown_references.data(), values.size(), values.data()), fmi2OK)
        << from.last_message();
    return values;
  };
  enter(slave, start);
  const Table table = all_pairs(slave, Equations::initial);
  Table expected;
  for (const std::string& known : names_where(model, Equations::initial, is_known)) {
    const double value = slave.get(known);
    const auto moved = [&](double shift) {
      if (known == "time") {
        Slave other(toml_of(random_game(GetParam())));
        enter(other, start + shift);
        return read(other);
      }
      // tolerances are small numbers that nothing initial depends on
      const double scale = known.starts_with("tolerance") ? 0.0 : 1.0;
      EXPECT_EQ(slave.set(known, value + scale * shift), fmi2OK) << slave.last_message();
      return read(slave);
    };
    const std::vector<double> near[] = {moved(h), moved(-h)};
    const std::vector<double> far[] = {moved(2.0 * h), moved(-2.0 * h)};
    if (known != "time") {
      ASSERT_EQ(slave.set(known, value), fmi2OK);
    }
    for (std::size_t k = 0; k < unknowns.size(); ++k) {
      expected[known][unknowns[k]] = (8.0 * (near[0][k] - near[1][k]) - (far[0][k] - far[1][k])) / (12.0 * h);
    }
  }
  expect_close(table, expected, 1e-7);
  expect_zero_where_not_declared(table, dependencies_of(model, Equations::initial));
}

INSTANTIATE_TEST_SUITE_P(Assorted, DirectionalDerivativeOfRandomGame, ::testing::ValuesIn(recipes()),
                         [](const auto& instance) { return "seed" + std::to_string(instance.param.seed); });

// In model exchange the FMU itself can be moved: every pair against its own rates and outputs, columns on the sphere
// and inside.
TEST(DirectionalDerivative, OfModelExchangeIsThatOfRatesAndOutputs) {
  constexpr double h = 1e-3;
  for (const std::string& game : {small_game_with({{"epsilon = 0.05", "epsilon = 1.0"}}), vector_centers_game()}) {
    Importer importer(game);
    const Model& model = importer.model();
    importer.begin(0.4);
    importer.integrate(0.9, 1e-3);
    const auto unknowns = names_where(model, Equations::running, is_unknown);
    const auto unknown_references = references(importer, unknowns);
    const auto read = [&] {
      std::vector<double> values(unknowns.size());
      EXPECT_EQ(fmi2GetReal(importer.component, unknown_references.data(), values.size(), values.data()), fmi2OK)
          << importer.last_message();
      return values;
    };
    const double t = importer.time;
    const std::vector<double> state = importer.state();
    const Table table = all_pairs(importer, Equations::running);
    const DependencyTable declared = dependencies_of(model, Equations::running);
    expect_zero_where_not_declared(table, declared);
    std::map<std::string, std::size_t> position;
    const ModelStructure structure = model_structure(model);
    for (std::size_t k = 0; k < structure.derivatives.size(); ++k) {
      const std::string name = model.variables.name(structure.derivatives[k].reference);
      position[name.substr(4, name.size() - 5)] = k;  // of der(x)
    }
    Table expected;
    for (const std::string& known : names_where(model, Equations::running, is_known)) {
      const auto moved = [&](double shift) {
        std::vector<double> other = state;
        if (position.contains(known)) other[position.at(known)] += shift;
        importer.move_to(known == "time" ? t + shift : t, other);
        if (known.starts_with("d_ext")) {
          EXPECT_EQ(importer.set(known, shift), fmi2OK) << importer.last_message();
        }
        return read();
      };
      const std::vector<double> near[] = {moved(h), moved(-h)};
      const std::vector<double> far[] = {moved(2.0 * h), moved(-2.0 * h)};
      moved(0.0);
      for (std::size_t k = 0; k < unknowns.size(); ++k) {
        expected[known][unknowns[k]] = (8.0 * (near[0][k] - near[1][k]) - (far[0][k] - far[1][k])) / (12.0 * h);
      }
    }
    expect_close(table, expected, 1e-7);
    importer.move_to(t, state);
    EXPECT_EQ(all_pairs(importer, Equations::running), table);
    ASSERT_EQ(fmi2EnterEventMode(importer.component), fmi2OK);
    EXPECT_EQ(all_pairs(importer, Equations::running), table) << "in event mode as well";
  }
}

// Every declared dependency acts somewhere, and is of the kind that is declared: the same number always (constant), as
// long as parameters stay (tunable), or not (dependent).
TEST(Structure, DependenciesInARunAreMinimalAndOfTheirKind) {
  const std::string three = small_game_with({{"W_max = 0.5", "W_max = 0.05"}});
  const std::string own_gains =
      small_game_with({{"W_max = 0.5", "W_max = 0.05"}, {"v0 = [0.25", "gains = { k3 = 25.0 }\nv0 = [0.25"}});
  for (const std::string& game : {three, vector_centers_game(), own_gains}) {
    Slave slave(game);
    const DependencyTable declared = dependencies_of(slave.model(), Equations::running);
    std::vector<std::vector<Table>> tables;  // by parameters, then by state
    for (int parameters = 0; parameters < 2; ++parameters) {
      ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
      for (int k = 0; k <= parameters; ++k) make_generic(slave);
      slave.initialize(0.2);
      tables.emplace_back();
      for (int k = 0; k < 12; ++k) {
        slave.run(0.2 + 0.05 * k, 0.2 + 0.05 * (k + 1), 1);
        tables.back().push_back(all_pairs(slave, Equations::running));
      }
    }
    for (const auto& [unknown, dependencies] : declared) {
      for (const auto& [known, kind] : dependencies) {
        SCOPED_TRACE(unknown + " with respect to " + known);
        bool acts = false;
        std::set<double> of_all;
        std::size_t most_of_one = 0;
        for (const auto& states : tables) {
          std::set<double> of_one;
          for (const Table& table : states) of_one.insert(table.at(known).at(unknown));
          most_of_one = std::max(most_of_one, of_one.size());
          of_all.insert(of_one.begin(), of_one.end());
        }
        for (const double value : of_all) acts = acts || value != 0.0;
        EXPECT_TRUE(acts);
        switch (kind) {
          case DependencyKind::constant:
            EXPECT_EQ(of_all.size(), 1U);
            break;
          case DependencyKind::tunable:
            EXPECT_EQ(most_of_one, 1U);
            EXPECT_GT(of_all.size(), 1U) << "could be constant";
            break;
          case DependencyKind::dependent:
            EXPECT_GT(most_of_one, 1U) << "could be tunable";
            break;
        }
      }
    }
  }
}

TEST(Structure, InitialDependenciesAreMinimal) {
  const std::string uncoupled = small_game_with({{"coupling = [[1, 0.3], [3, 0.6]]", "coupling = []"}});
  for (const std::string& game : {small_game(), vector_centers_game(), outputs_only(small_game()),
                                  outputs_only(vector_centers_game()), outputs_only(uncoupled)}) {
    Slave slave(game);
    make_generic(slave);
    ASSERT_EQ(slave.set("epsilon", 20.0), fmi2OK);  // tanh must not be saturated
    ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2False, 0.0, 0.2, fmi2False, 0.0), fmi2OK);
    ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
    const DependencyTable declared = dependencies_of(slave.model(), Equations::initial);
    const Table table = all_pairs(slave, Equations::initial);
    expect_zero_where_not_declared(table, declared);
    for (const auto& [unknown, dependencies] : declared) {
      for (const auto& [known, kind] : dependencies) {
        if (!table.contains(known)) {
          EXPECT_TRUE(known == "robust" || known == "perturbed") << known;
        } else {
          EXPECT_NE(table.at(known).at(unknown), 0.0) << unknown << " declares " << known;
        }
      }
    }
  }
}

// Players 1 and 3 follow player 2 but not each other, and nothing can change that: couplings that are zero do not
// exist.
TEST(Structure, EquilibriaOfPlayersThatAreNotCoupledAreIndependent) {
  const Model model(outputs_only(small_game_with({{"coupling = [[1, 0.3], [3, 0.6]]", "coupling = []"}})));
  const DependencyTable declared = dependencies_of(model, Equations::initial);
  const auto& first = declared.at("x_star[1,2]");
  EXPECT_TRUE(first.contains("cost_linear[2,2]"));
  EXPECT_TRUE(first.contains("cost_coupling[1,2]"));
  EXPECT_FALSE(first.contains("cost_linear[3,2]"));
  EXPECT_FALSE(first.contains("cost_linear[2,1]"));
  EXPECT_FALSE(declared.at("x_star[2,1]").contains("cost_linear[1,1]"));
  EXPECT_TRUE(declared.at("nash_error").contains("cost_linear[3,2]"));
}

TEST(DirectionalDerivative, IsLinear) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 0.6, 2);
  const auto unknowns = names_where(slave.model(), Equations::running, is_unknown);
  const auto knowns = names_where(slave.model(), Equations::running, is_known);
  const Table table = all_pairs(slave, Equations::running);
  std::vector<double> changes;
  for (std::size_t k = 0; k < knowns.size(); ++k) changes.push_back(std::sin(1.0 + 2.0 * static_cast<double>(k)));
  const auto derivatives = directional_derivative(slave, unknowns, knowns, changes);
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    double sum = 0.0;
    double size = 0.0;
    for (std::size_t j = 0; j < knowns.size(); ++j) {
      const double term = changes[j] * table.at(knowns[j]).at(unknowns[k]);
      sum += term;
      size += std::abs(term);
    }
    EXPECT_NEAR(derivatives[k], sum, 1e-13 * size) << unknowns[k];
  }
}

TEST(DirectionalDerivative, OfParametersNamedTwiceIsThatOfTheSum) {
  Slave slave;
  ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2False, 0.0, 0.0, fmi2False, 0.0), fmi2OK);
  ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
  const auto unknowns = names_where(slave.model(), Equations::initial, is_unknown);
  for (const char* known : {"k2", "a[1,2]", "tolerance_relative", "d_ext[2,1]", "time", "y0[1,2,1]"}) {
    EXPECT_EQ(directional_derivative(slave, unknowns, {known, known}, {0.5, 1.5}),
              directional_derivative(slave, unknowns, {known}, {2.0}))
        << known;
  }
}

TEST(DirectionalDerivative, OfTheDistanceIsZeroAtTheEquilibrium) {
  Slave slave;
  for (int i = 1; i <= 3; ++i) {
    for (int l = 1; l <= 2; ++l) {
      ASSERT_EQ(slave.set("x0" + indices(i, l), slave.get("x_star" + indices(i, l))), fmi2OK);
    }
  }
  ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2False, 0.0, 0.0, fmi2False, 0.0), fmi2OK);
  ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
  ASSERT_EQ(slave.get("nash_error"), 0.0);
  EXPECT_EQ(directional_derivative(slave, "nash_error", "x0[1,1]"), 0.0);
  EXPECT_EQ(directional_derivative(slave, "nash_error", "cost_linear[2,1]"), 0.0);
  ASSERT_EQ(fmi2ExitInitializationMode(slave.component), fmi2OK);
  EXPECT_EQ(directional_derivative(slave, "nash_error", "x[1,1]"), 0.0);
}

TEST(DirectionalDerivative, FollowsTunablesResetAndRestore) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 0.3, 1);
  const Table before = all_pairs(slave, Equations::running);
  fmi2FMUstate state = nullptr;
  ASSERT_EQ(fmi2GetFMUstate(slave.component, &state), fmi2OK);
  ASSERT_EQ(slave.set("k3", 35.0), fmi2OK);
  ASSERT_EQ(slave.set("a[1,3]", 0.8), fmi2OK);
  EXPECT_EQ(all_pairs(slave, Equations::running), before) << "parameters act from the next step";
  slave.run(0.3, 0.4, 1);
  const Table after = all_pairs(slave, Equations::running);
  // -k3 (sum_k a_1k + a_12)
  EXPECT_NEAR(after.at("y[1,2,1]").at("der(y[1,2,1])"), -35.0 * (1.3 + 0.8 + 1.3), 1e-12);
  EXPECT_NEAR(after.at("y[3,2,1]").at("der(y[1,2,1])"), 35.0 * 0.8, 1e-12);
  ASSERT_EQ(fmi2SetFMUstate(slave.component, state), fmi2OK);
  EXPECT_EQ(all_pairs(slave, Equations::running), before);
  ASSERT_EQ(fmi2FreeFMUstate(slave.component, &state), fmi2OK);
  ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
  slave.initialize();
  slave.run(0.0, 0.3, 1);
  EXPECT_EQ(all_pairs(slave, Equations::running), before);
  ASSERT_EQ(fmi2Terminate(slave.component), fmi2OK);
  EXPECT_EQ(all_pairs(slave, Equations::running), before) << "after the run as well";
}

TEST(DirectionalDerivative, LeavesTheRunAlone) {
  Slave slave;
  Slave other;
  slave.initialize();
  other.initialize();
  for (int k = 0; k < 10; ++k) {
    slave.run(0.1 * k, 0.1 * (k + 1), 1);
    other.run(0.1 * k, 0.1 * (k + 1), 1);
    all_pairs(slave, Equations::running);
    ASSERT_TRUE(same_values(slave, slave.all(), other.all()));
  }
}

TEST(DirectionalDerivative, WithoutStatesAsVariablesHasInputsAndTimeAsKnowns) {
  Slave slave(outputs_only(small_game()));
  slave.initialize();
  slave.run(0.0, 0.3, 1);
  const Table table = all_pairs(slave, Equations::running);
  EXPECT_EQ(table.size(), 7U);
  expect_zero_where_not_declared(table, dependencies_of(slave.model(), Equations::running));
}

TEST(Behaviour10DirectionalDerivative, WhatIsNoUnknownOrKnownIsRefusedByName) {
  for (const std::string& game : {small_game(), outputs_only(small_game())}) {
    Slave slave(game);
    const Model& model = slave.model();
    const auto check_all = [&](Equations equations) {
      const std::string unknown = "x[1,1]";
      const std::string known = "d_ext[1,1]";
      for (int k = 0; k < model.variables.size(); ++k) {
        const std::string name = model.variables.name(k);
        const bool is_real = model.variables.family(k).type == Type::real;
        const auto reference = static_cast<fmi2ValueReference>(k);
        const auto good_unknown = slave.reference(unknown);
        const auto good_known = slave.reference(known);
        const double change = 1.0;
        double derivative = 7.0;
        const auto expect = [&](bool legal, fmi2Status status) {
          EXPECT_EQ(status, legal ? fmi2OK : fmi2Error) << name;
          if (legal) return;
          EXPECT_EQ(derivative, 7.0) << name;
          EXPECT_NE(slave.last_message().find(name), std::string::npos) << slave.last_message();
        };
        slave.log.clear();
        expect(is_real && is_unknown(model, k, equations),
               fmi2GetDirectionalDerivative(slave.component, &reference, 1, &good_known, 1, &change, &derivative));
        derivative = 7.0;
        expect(is_real && is_known(model, k, equations),
               fmi2GetDirectionalDerivative(slave.component, &good_unknown, 1, &reference, 1, &change, &derivative));
      }
    };
    ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2False, 0.0, 0.0, fmi2False, 0.0), fmi2OK);
    ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
    check_all(Equations::initial);
    ASSERT_EQ(fmi2ExitInitializationMode(slave.component), fmi2OK);
    check_all(Equations::running);
  }
}

// What the model structure lists is what is answered.
TEST(Structure, ListsTheUnknownsAndTheirKnowns) {
  for (const std::string& game : {small_game(), vector_centers_game(), outputs_only(small_game())}) {
    const Model model(game);
    for (const Equations equations : {Equations::initial, Equations::running}) {
      const DependencyTable declared = dependencies_of(model, equations);
      std::set<std::string> listed;
      for (const auto& [unknown, dependencies] : declared) {
        listed.insert(unknown);
        for (const auto& [known, kind] : dependencies) {
          bool found = false;
          for (int k = 0; k < model.variables.size(); ++k) {
            if (model.variables.name(k) == known) found = is_known(model, k, equations);
          }
          EXPECT_TRUE(found) << known;
        }
      }
      const auto names = names_where(model, equations, is_unknown);
      EXPECT_EQ(listed, std::set<std::string>(names.begin(), names.end()));
    }
  }
}

TEST(Behaviour10DirectionalDerivative, NullArraysZeroCountsAndDuplicates) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 0.3, 1);
  fmi2Component c = slave.component;
  const fmi2ValueReference unknown[] = {slave.reference("der(x[1,1])"), slave.reference("der(x[1,1])")};
  const fmi2ValueReference known[] = {slave.reference("d_ext[1,1]"), slave.reference("d_ext[1,1]")};
  const fmi2ValueReference wild = 1U << 31U;
  const double changes[] = {2.0, 3.0};
  double derivatives[] = {7.0, 7.0};
  const auto expect_refused = [&](fmi2Status status, const char* part) {
    EXPECT_EQ(status, fmi2Error);
    EXPECT_NE(slave.last_message().find(part), std::string::npos) << slave.last_message();
    EXPECT_EQ(derivatives[0], 7.0);
    EXPECT_EQ(derivatives[1], 7.0);
  };
  expect_refused(fmi2GetDirectionalDerivative(c, nullptr, 1, known, 1, changes, derivatives), "vUnknown_ref");
  expect_refused(fmi2GetDirectionalDerivative(c, unknown, 1, nullptr, 1, changes, derivatives), "vKnown_ref");
  expect_refused(fmi2GetDirectionalDerivative(c, unknown, 1, known, 1, nullptr, derivatives), "dvKnown");
  expect_refused(fmi2GetDirectionalDerivative(c, unknown, 1, known, 1, changes, nullptr), "dvUnknown");
  expect_refused(fmi2GetDirectionalDerivative(c, &wild, 1, known, 1, changes, derivatives), "2147483648");
  expect_refused(fmi2GetDirectionalDerivative(c, unknown, 1, &wild, 1, changes, derivatives), "2147483648");
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    expect_refused(fmi2GetDirectionalDerivative(c, unknown, 1, known, 1, &bad, derivatives), "d_ext[1,1]");
  }
  const double huge[] = {1e308, 1e308};
  expect_refused(fmi2GetDirectionalDerivative(c, unknown, 2, known, 2, huge, derivatives), "der(x[1,1])");
  EXPECT_EQ(fmi2GetDirectionalDerivative(nullptr, unknown, 1, known, 1, changes, derivatives), fmi2Error);

  EXPECT_EQ(fmi2GetDirectionalDerivative(c, nullptr, 0, nullptr, 0, nullptr, nullptr), fmi2OK);
  EXPECT_EQ(fmi2GetDirectionalDerivative(c, nullptr, 0, known, 2, changes, nullptr), fmi2OK);
  EXPECT_EQ(fmi2GetDirectionalDerivative(c, unknown, 2, nullptr, 0, nullptr, derivatives), fmi2OK);
  EXPECT_EQ(derivatives[0], 0.0);
  EXPECT_EQ(fmi2GetDirectionalDerivative(c, unknown, 2, known, 2, changes, derivatives), fmi2OK);
  EXPECT_EQ(derivatives[0], 5.0) << "a known that is named twice changes by the sum";
  EXPECT_EQ(derivatives[1], 5.0);
}

TEST(Behaviour20DirectionalDerivative, IsRefusedBeforeInitialization) {
  Slave slave;
  const fmi2ValueReference unknown = slave.reference("x[1,1]");
  const fmi2ValueReference known = slave.reference("x0[1,1]");
  const double change = 1.0;
  double derivative = 7.0;
  EXPECT_EQ(fmi2GetDirectionalDerivative(slave.component, &unknown, 1, &known, 1, &change, &derivative), fmi2Error);
  EXPECT_EQ(derivative, 7.0);
}

TEST(Behaviour11DirectionalDerivative, OfAGameWithoutUniqueEquilibriumIsRefusedWhereItMatters) {
  Slave slave;
  ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2False, 0.0, 0.0, fmi2False, 0.0), fmi2OK);
  ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
  for (const char* name : {"cost_quadratic[1]", "cost_quadratic[2]", "cost_quadratic[3]"}) {
    ASSERT_EQ(slave.set(name, 0.0), fmi2OK);
  }
  const fmi2ValueReference unknown = slave.reference("x_star[1,1]");
  const fmi2ValueReference known = slave.reference("cost_linear[1,1]");
  const double change = 1.0;
  double derivative = 7.0;
  EXPECT_EQ(fmi2GetDirectionalDerivative(slave.component, &unknown, 1, &known, 1, &change, &derivative), fmi2Error);
  EXPECT_NE(slave.last_message().find("equilibrium"), std::string::npos) << slave.last_message();
  EXPECT_EQ(directional_derivative(slave, "x[1,1]", "x0[1,1]"), 1.0);
}
