#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "errors.hpp"
#include "families/polynomial_dynamics.hpp"
#include "families/quadratic_cost.hpp"
#include "families/sinusoidal_disturbance.hpp"
#include "game/game.hpp"
#include "reference_loop.hpp"

namespace mixed_order_game {
namespace {

using testing::assorted_recipes;
using testing::flat_actions;
using testing::LoopState;
using testing::PlainGame;
using testing::random_game;
using ::testing::TestWithParam;
using testing::toml_of;

// 3 players in 2 dimensions with 4 neurons
constexpr std::string_view three_players = R"(title = "three players"
dimension = 2
[strategy]
robust = true
[gains]
k1 = 10.0
k2 = 1.0
k3 = 50.0
k4 = 20
beta = 100.0
delta = 0.0
epsilon = 0.01
[rbf]
centers = [-1.0, 0.0, 1, 2.5]
width = 2.0
W_max = 50.0
[graph]
edges = [[1, 2], [2, 3, 0.5]]
[[player]]
name = "first"
order = 1
x0 = [1.0, 2.0]
z0 = [0.1, 0.2]
y0 = [[1.0, 2.0], 3.0, [4.0, 5.0]]
cost = { quadratic = 1.0, linear = [0.5, -0.5], constant = 7.0, coupling = [[3, 2.0]] }
[[player]]
name = "second"
order = 2
x0 = 3.0
v0 = -1
y0 = 0.25
cost = { quadratic = 2.0, linear = -4.0 }
dynamics = { linear = [[1, [1.5, 0.0]], [3, 2.0]], square = [[1, [0.0, -0.25]]] }
[[player]]
name = "third"
order = 1
x0 = [5.0, 6.0]
cost = { quadratic = 3.0, coupling = [[1, 0.25], [2, 0.75]] }
disturbance = { amplitude = [1.0, 2.0], frequency = 3.0, phase = [0.5, 0.0], bias = -1.0 }
)";

std::string edited(std::string_view from, std::string_view to) {
  std::string text(three_players);
  const std::size_t where = text.find(from);
  EXPECT_NE(where, std::string::npos) << from;
  EXPECT_EQ(text.find(from, where + 1), std::string::npos) << from << " is there twice";
  return text.replace(where, from.size(), to);
}

std::string refusal(std::string_view text) {
  try {
    parse_game(text);
  } catch (const GameError& error) {
    return error.what();
  }
  return "(accepted)";
}

TEST(GameDefinition, NumbersLandWhereTheCoreExpectsThem) {
  Game game = parse_game(three_players);
  EXPECT_EQ(game.title, "three players");
  EXPECT_EQ(game.expose, Expose::all);
  EXPECT_EQ(game.player_names, (std::vector<std::string>{"first", "second", "third"}));
  Parameters& p = game.parameters;
  EXPECT_EQ(p.shape, (Shape{.players = 3, .dimension = 2, .neurons = 4, .order = {1, 2, 1}}));
  EXPECT_EQ(p.gains.k1, std::vector<Real>(3, 10.0));
  EXPECT_EQ(p.gains.k2, std::vector<Real>(3, 1.0));
  EXPECT_EQ(p.gains.k3, std::vector<Real>(3, 50.0));
  EXPECT_EQ(p.gains.k4, std::vector<Real>(3, 20.0));
  EXPECT_EQ(p.gains.beta, std::vector<Real>(3, 100.0));
  EXPECT_EQ(p.gains.delta, std::vector<Real>(3, 0.0));
  EXPECT_EQ(p.gains.epsilon, std::vector<Real>(3, 0.01));
  EXPECT_TRUE(p.strategy.robust);
  EXPECT_TRUE(p.strategy.perturbed);
  EXPECT_TRUE(p.rbf.diagonal);
  EXPECT_EQ(p.rbf.centers, (std::vector<Real>{-1.0, -1.0, -1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.5, 2.5, 2.5}));
  EXPECT_EQ(p.rbf.width, std::vector<Real>(3, 2.0));
  EXPECT_EQ(p.rbf.W_max, std::vector<Real>(3, 50.0));
  EXPECT_EQ(p.graph.weight(0, 1), 1.0);
  EXPECT_EQ(p.graph.weight(2, 1), 0.5);
  EXPECT_EQ(p.graph.weight(0, 2), 0.0);
  EXPECT_EQ(p.graph.neighbours().start[3], 4);
  EXPECT_EQ(p.initial.x, (std::vector<Real>{1.0, 3.0, 5.0, 2.0, 3.0, 6.0}));
  EXPECT_EQ(p.initial.reference, (std::vector<Real>{0.1, -1.0, 0.0, 0.2, -1.0, 0.0}));
  EXPECT_EQ(p.initial.y, (std::vector<Real>{1.0, 3.0, 4.0, 2.0, 3.0, 5.0,        // player 1's estimates
                                            0.25, 0.25, 0.25, 0.25, 0.25, 0.25,  // player 2's
                                            0.0, 0.0, 0.0, 0.0, 0.0, 0.0}));     // player 3's
  const Cost& cost = *p.cost;
  EXPECT_EQ(cost.coefficients[QuadraticCost::quadratic], (std::vector<Real>{1.0, 2.0, 3.0}));
  EXPECT_EQ(cost.coefficients[QuadraticCost::linear], (std::vector<Real>{0.5, -4.0, 0.0, -0.5, -4.0, 0.0}));
  EXPECT_EQ(cost.coefficients[QuadraticCost::constant], (std::vector<Real>{7.0, 0.0, 0.0}));
  EXPECT_EQ(cost.coefficients[QuadraticCost::coupling],
            (std::vector<Real>{0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.25, 0.75, 0.0}));
  EXPECT_EQ(cost.hessian_pattern().entries(), 2 * (2 + 1 + 3));  // refreshed
  const Disturbance& disturbance = *p.disturbance;
  EXPECT_EQ(disturbance.coefficients[SinusoidalDisturbance::amplitude],
            (std::vector<Real>{0.0, 0.0, 1.0, 0.0, 0.0, 2.0}));
  EXPECT_EQ(disturbance.coefficients[SinusoidalDisturbance::frequency],
            (std::vector<Real>{0.0, 0.0, 3.0, 0.0, 0.0, 3.0}));
  EXPECT_EQ(disturbance.coefficients[SinusoidalDisturbance::phase], (std::vector<Real>{0.0, 0.0, 0.5, 0.0, 0.0, 0.0}));
  EXPECT_EQ(disturbance.coefficients[SinusoidalDisturbance::bias], (std::vector<Real>{0.0, 0.0, -1.0, 0.0, 0.0, -1.0}));
  const UnknownDynamics& dynamics = *p.dynamics;
  EXPECT_EQ(dynamics.coefficients[PolynomialDynamics::gain], (std::vector<Real>{1.0, 1.0, 1.0}));
  EXPECT_EQ(dynamics.jacobian_pattern().entries(), 4);  // linear and square terms of one entry are merged
  std::vector<Real> g(6);
  dynamics.values(std::vector<Real>{1.0, 2.0, 3.0, 4.0, 5.0, 6.0}.data(), nullptr, g.data());
  EXPECT_EQ(g, (std::vector<Real>{0.0, 1.5 * 1.0 + 2.0 * 3.0, 0.0, 0.0, -0.25 * 16.0 + 2.0 * 6.0, 0.0}));
}

TEST(GameDefinition, PlayersHaveGainsOfTheirOwn) {
  const Gains own = parse_game(edited("v0 = -1", "v0 = -1\ngains = { k4 = 25.0, delta = 3 }")).parameters.gains;
  EXPECT_TRUE(own.per_player);
  EXPECT_FALSE(parse_game(three_players).parameters.gains.per_player);
  EXPECT_EQ(own.k4, (std::vector<Real>{20.0, 25.0, 20.0}));
  EXPECT_EQ(own.delta, (std::vector<Real>{0.0, 3.0, 0.0}));
  EXPECT_EQ(own.k3, std::vector<Real>(3, 50.0));
  // of the defaults' table a player takes what its order has; its own table replaces that one
  std::string text = edited("v0 = -1", "v0 = -1\ngains = { k3 = 7.0 }");
  text.insert(text.find("[[player]]"), "[defaults]\ngains = { k1 = 2.0, k4 = 3.0, k2 = 4.0 }\n");
  const Gains mixed = parse_game(text).parameters.gains;
  EXPECT_EQ(mixed.k1, (std::vector<Real>{2.0, 10.0, 2.0}));
  EXPECT_EQ(mixed.k4, std::vector<Real>(3, 20.0));
  EXPECT_EQ(mixed.k2, (std::vector<Real>{4.0, 1.0, 4.0}));
  EXPECT_EQ(mixed.k3, (std::vector<Real>{50.0, 7.0, 50.0}));
}

TEST(GameDefinition, PlayersHaveNetworksOfTheirOwn) {
  const RbfNetwork own =
      parse_game(edited("v0 = -1", "v0 = -1\nrbf = { W_max = 3, centers = [4, 5.0, 6, 7] }")).parameters.rbf;
  EXPECT_TRUE(own.per_player);
  EXPECT_TRUE(own.diagonal);
  EXPECT_EQ(own.W_max, (std::vector<Real>{50.0, 3.0, 50.0}));
  EXPECT_EQ(own.width, std::vector<Real>(3, 2.0));
  EXPECT_EQ(own.centers, (std::vector<Real>{-1.0, 4.0, -1.0, 0.0, 5.0, 0.0, 1.0, 6.0, 1.0, 2.5, 7.0, 2.5}));
  // vectors of one player make those of all others vectors
  const RbfNetwork mixed = parse_game(edited("v0 = -1",
                                             "v0 = -1\nrbf = { centers = [[1, 2, 3, 4, 5, 6], [0, 0, 0, 0, 0, 0], "
                                             "[7, 7, 7, 7, 7, 7], [8, 8, 8, 8, 8, 9]] }"))
                               .parameters.rbf;
  EXPECT_FALSE(mixed.diagonal);
  ASSERT_EQ(mixed.centers.size(), 4U * 3U * 6U);
  const auto row = [&](int m, int i) {
    const auto first = mixed.centers.begin() + static_cast<std::ptrdiff_t>(mixed.row(m, i) * 6);
    return std::vector<Real>(first, first + 6);
  };
  EXPECT_EQ(row(0, 1), (std::vector<Real>{1.0, 3.0, 5.0, 2.0, 4.0, 6.0}));
  EXPECT_EQ(row(3, 1), (std::vector<Real>{8.0, 8.0, 8.0, 8.0, 8.0, 9.0}));
  EXPECT_EQ(row(3, 2), std::vector<Real>(6, 2.5));
}

TEST(GameDefinition, WeightsBeginWithinTheirBound) {
  const auto begin = [](const std::string& W0) { return edited("v0 = -1", "v0 = -1\nW0 = " + W0); };
  const InitialState initial = parse_game(begin("[1, [2.0, -3], 0.0, 4.0]")).parameters.initial;
  ASSERT_EQ(initial.W.size(), 4U * 6U);
  EXPECT_EQ(initial.W[0 * 6 + 1], 1.0);
  EXPECT_EQ(initial.W[1 * 6 + 1], 2.0);
  EXPECT_EQ(initial.W[1 * 6 + 4], -3.0);
  EXPECT_EQ(initial.W[1 * 6 + 0], 0.0);
  EXPECT_TRUE(parse_game(three_players).parameters.initial.W.empty());
}

TEST(GameDefinition, DirectedGraphsHearOneWay) {
  const CommunicationGraph graph = parse_game(edited("edges = [[1, 2], [2, 3, 0.5]]",
                                                     "directed = true\nedges = [[1, 2], [2, 3, 0.5], [3, 1], [3, 2]]"))
                                       .parameters.graph;
  EXPECT_TRUE(graph.directed());
  EXPECT_EQ(graph.weight(1, 0), 1.0);
  EXPECT_EQ(graph.weight(0, 1), 0.0);
  EXPECT_EQ(graph.weight(2, 1), 0.5);
  EXPECT_EQ(graph.weight(0, 2), 1.0);
  EXPECT_EQ(graph.weight(1, 2), 1.0);
}

TEST(GameDefinition, TermsOfBothKindsAreMerged) {
  const Game game = parse_game(edited("square = [[1, [0.0, -0.25]]]", "square = [[1, [3.0, 0.0]]]"));
  EXPECT_EQ(game.parameters.dynamics->jacobian_pattern().entries(), 3);
  std::vector<Real> g(6);
  game.parameters.dynamics->values(std::vector<Real>{2.0, 0.0, 0.0, 1.0, 0.0, 0.0}.data(), nullptr, g.data());
  EXPECT_EQ(g, (std::vector<Real>{0.0, 1.5 * 2.0 + 3.0 * 4.0, 0.0, 0.0, 0.0, 0.0}));
}

TEST(GameDefinition, CentersThatAreVectorsComePlayerByPlayer) {
  const Game game = parse_game(edited("centers = [-1.0, 0.0, 1, 2.5]",
                                      "centers = [[11, 12, 21, 22, 31, 32], [-11.0, -12, -21, -22, -31, -32]]"));
  EXPECT_FALSE(game.parameters.rbf.diagonal);
  EXPECT_EQ(game.parameters.shape.neurons, 2);
  EXPECT_EQ(game.parameters.rbf.centers, (std::vector<Real>{11.0, 21.0, 31.0, 12.0, 22.0, 32.0,  //
                                                            -11.0, -21.0, -31.0, -12.0, -22.0, -32.0}));
}

TEST(GameDefinition, OfTheFiveVehiclesIsThePapersExample) {
  std::ifstream file(MIXED_ORDER_GAME_SOURCE_DIR "/modelDescription/games/five_vehicles.toml");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  Game game = parse_game(text);
  Parameters& p = game.parameters;
  EXPECT_EQ(p.shape, (Shape{.players = 5, .dimension = 2, .neurons = 11, .order = {1, 1, 1, 2, 2}}));
  EXPECT_EQ(game.expose, Expose::all);
  EXPECT_DOUBLE_EQ(p.rbf.width[0] * p.rbf.width[0], 50.0);
  EXPECT_EQ(p.graph.edges(), (std::vector<std::pair<int, int>>{{0, 1}, {0, 4}, {1, 2}, {2, 3}, {3, 4}}));
  // costs at one point: f_i = i |x_i|^2 + i (x_i1 + x_i2) + i + sum_j c_ij |x_i - x_j|^2
  const std::vector<Real> x = p.initial.x;
  EXPECT_EQ(x, (std::vector<Real>{-5.0, -4.0, 1.0, 0.0, -1.0, 8.0, -6.0, 8.0, -8.0, 10.0}));
  EXPECT_EQ(p.cost->value(0, x.data()), 89.0 + 3.0 + 1.0 + (1.0 + 196.0));
  EXPECT_EQ(p.cost->value(3, x.data()), 4.0 * (64.0 - 8.0 + 1.0) + (16.0 + 4.0) + (1.0 + 324.0));
  std::vector<Real> g(10);
  p.dynamics->values(x.data(), nullptr, g.data());
  // g_1 = x_2; g_2 = (x_21^2 + x_31, x_22); g_3 = 3 x_3; g_4 = 4 x_4; g_5 = 5 x_5
  EXPECT_EQ(g, (std::vector<Real>{-4.0, 17.0, 3.0, 0.0, -5.0, -6.0, -6.0, 24.0, -32.0, 50.0}));
  std::vector<Real> d(10);
  p.disturbance->values(0.5, d.data());
  for (std::size_t k = 0; k < 10; ++k) {
    const Real i = static_cast<Real>(k % 5 + 1);
    EXPECT_NEAR(d[k], i * std::sin(0.5 * i), 1e-14);
  }
}

TEST(GameDefinition, OfARandomGameIsReadBack) {
  for (const auto& recipe : assorted_recipes()) {
    const PlainGame plain = random_game(recipe);
    Parameters p = parse_game(toml_of(plain)).parameters;
    EXPECT_EQ(p.strategy.robust, plain.robust);
    EXPECT_EQ(p.strategy.perturbed, plain.perturbed);
    EXPECT_EQ(p.initial.x, flat_actions(plain.x0));
    EXPECT_EQ(p.initial.reference, flat_actions(plain.reference0));
    EXPECT_EQ(p.cost->coefficients[QuadraticCost::linear], flat_actions(plain.linear));
    EXPECT_EQ(p.disturbance->coefficients[SinusoidalDisturbance::phase], flat_actions(plain.phase));
    for (int i = 0; i < p.shape.players; ++i) {
      for (int j = 0; j < p.shape.players; ++j) {
        EXPECT_EQ(p.graph.weight(i, j), plain.adjacency[at(i)][at(j)]);
        EXPECT_EQ(p.cost->coefficients[QuadraticCost::coupling][at(i * p.shape.players + j)],
                  plain.coupling[at(i)][at(j)]);
      }
    }
  }
}

TEST(GameDefinition, OptionalPartsMayBeAbsent) {
  const Parameters p = parse_game(edited("[strategy]\nrobust = true\n", "")).parameters;
  EXPECT_TRUE(p.strategy.robust);
  EXPECT_TRUE(p.strategy.perturbed);
  EXPECT_FALSE(parse_game(edited("robust = true", "perturbed = false")).parameters.strategy.perturbed);
  EXPECT_FALSE(parse_game(edited("robust = true", "robust = false")).parameters.strategy.robust);
}

TEST(GameDefinition, ExposesWhatIsAskedFor) {
  EXPECT_EQ(parse_game(edited("dimension = 2", "dimension = 2\nexpose = \"outputs\"")).expose, Expose::outputs);
  EXPECT_EQ(parse_game(edited("dimension = 2", "dimension = 2\nexpose = \"all\"")).expose, Expose::all);
}

std::string ring_of(int players, int dimension) {
  std::string text = "title = \"ring\"\ndimension = " + std::to_string(dimension) + R"(
[gains]
k1 = 10
k2 = 1
k3 = 50
k4 = 50
beta = 0
delta = 0
epsilon = 1
[rbf]
centers = [0.0]
width = 1
W_max = 1
[graph]
edges = [)";
  for (int i = 1; i < players; ++i) text += '[' + std::to_string(i) + ", " + std::to_string(i + 1) + "], ";
  text += "]\n";
  for (int i = 1; i <= players; ++i) {
    text += "[[player]]\nname = \"" + std::to_string(i) + "\"\norder = 1\nx0 = 0\ncost = { quadratic = 1 }\n";
  }
  return text;
}

TEST(GameDefinition, ExposesByDefaultAllOfASmallGame) {
  // 3.5 N^2 + 18.5 N + 21 variables for N players on a line with one neuron: 19,497 for 72, 20,023 for 73
  EXPECT_EQ(parse_game(ring_of(10, 1)).expose, Expose::all);
  EXPECT_EQ(parse_game(ring_of(72, 1)).expose, Expose::all);
  EXPECT_EQ(parse_game(ring_of(73, 1)).expose, Expose::outputs);
  EXPECT_EQ(parse_game(ring_of(72, 2)).expose, Expose::outputs);
}

TEST(GameDefinition, ReadsWindowsLineEndings) {
  std::string text;
  for (const char c : three_players) text += c == '\n' ? std::string("\r\n") : std::string(1, c);
  EXPECT_EQ(parse_game(text).player_names, parse_game(three_players).player_names);
}

struct Refusal {
  const char* from;
  const char* to;
  const char* message;
};

class GameDefinitionRefuses : public TestWithParam<Refusal> {};

TEST_P(GameDefinitionRefuses, WithOneSentence) {
  const auto& [from, to, message] = GetParam();
  EXPECT_EQ(refusal(edited(from, to)), message);
}

const Refusal syntax[] = {
    {"k1 = 10.0", "k1 = = 10.0",
     "line 6, column 6 of the game definition is not TOML: Error while parsing value: could not determine value type"},
    {"[gains]", "[gains",
     "line 5, column 7 of the game definition is not TOML: Error while parsing table header: expected ']', saw '\\n'"},
    {"k2 = 1.0", "k1 = 1.0",
     "line 7, column 6 of the game definition is not TOML: Error while parsing key-value pair: cannot redefine "
     "existing "
     "floating-point 'k1'"},
};
INSTANTIATE_TEST_SUITE_P(Syntax, GameDefinitionRefuses, ::testing::ValuesIn(syntax));

const Refusal keys[] = {
    {"dimension = 2", "dimensions = 2",
     "\"dimensions\" is an unknown key of the game definition, the closest known key is dimension"},
    {"dimension = 2", "", "dimension is missing, expected an integer from 1 to 100"},
    {"title = \"three players\"", "", "title is missing, expected text"},
    {"title = \"three players\"\n", "colour = \"red\"\n",
     "\"colour\" is an unknown key of the game definition, expected one of title, dimension, expose, strategy, gains, "
     "rbf, graph, parameters, defaults, equilibrium, player"},
    {"k1 = 10.0\n", "", "gains.k1 is missing, expected a positive number"},
    {"k1 = 10.0", "k5 = 10.0",
     "\"k5\" is an unknown key of gains, expected one of k1, k2, k3, k4, beta, delta, epsilon"},
    {"beta = 100.0", "betta = 100.0", "\"betta\" is an unknown key of gains, the closest known key is beta"},
    {"robust = true", "robuts = true", "\"robuts\" is an unknown key of strategy, the closest known key is robust"},
    {"centers = ", "centres = ", "\"centres\" is an unknown key of rbf, the closest known key is centers"},
    {"W_max = 50.0", "w_max = 50.0", "\"w_max\" is an unknown key of rbf, the closest known key is W_max"},
    {"edges = ", "\"edge\\ns\" = ", "\"edge s\" is an unknown key of graph, the closest known key is edges"},
    {"edges = [[1, 2], [2, 3, 0.5]]", "", "graph.edges is missing, expected a list of edges [i, j] or [i, j, weight]"},
    {"name = \"first\"\n", "", "player[1].name is missing, expected text"},
    {"order = 2", "ordre = 2", "\"ordre\" is an unknown key of player[2], the closest known key is order"},
    {"order = 2\n", "", "player[2].order is missing, expected an integer from 1 to 2"},
    {"x0 = 3.0\n", "",
     "player[2].x0 is missing, expected a list of 2 numbers or one number that stands for all of them"},
    {"constant = 7.0", "constants = 7.0",
     "\"constants\" is an unknown key of player[1].cost, the closest known key is constant"},
    {"square = [", "cubic = [",
     "\"cubic\" is an unknown key of player[2].dynamics, expected one of expression, linear, square"},
    {"phase = [", "fase = [", "\"fase\" is an unknown key of player[3].disturbance, the closest known key is phase"},
    {"title = ", "this_key_is_so_long_that_it_must_be_cut_somewhere = ",
     "\"this_key_is_so_long_that_it_must_be_cut_...\" is an unknown key of the game definition, expected one of title, "
     "dimension, expose, strategy, gains, rbf, graph, parameters, defaults, equilibrium, player"},
};
INSTANTIATE_TEST_SUITE_P(Keys, GameDefinitionRefuses, ::testing::ValuesIn(keys));

const Refusal types[] = {
    {"title = \"three players\"", "title = 3", "title is 3, expected text"},
    {"title = \"three players\"", "title = \"two\\nlines\"",
     "title is \"two lines\", expected text without control characters"},
    {"dimension = 2", "dimension = 2.0", "dimension is 2, expected an integer from 1 to 100"},
    {"dimension = 2", "dimension = \"2\"", "dimension is \"2\", expected an integer from 1 to 100"},
    {"dimension = 2", "dimension = 0", "dimension is 0, expected an integer from 1 to 100"},
    {"dimension = 2", "dimension = 2\nexpose = \"some\"", "expose is \"some\", expected \"all\" or \"outputs\""},
    {"dimension = 2", "dimension = 2\nexpose = true", "expose is true, expected text"},
    {"robust = true", "robust = 1", "strategy.robust is 1, expected true or false"},
    {"[strategy]\nrobust = true", "strategy = 4", "strategy is 4, expected a table"},
    {"[rbf]\n", "[gains.more]\n[rbf]\n",
     "\"more\" is an unknown key of gains, expected one of k1, k2, k3, k4, beta, delta, epsilon"},
    {"k2 = 1.0", "k2 = \"fast\"", "gains.k2 is \"fast\", expected a positive number"},
    {"k2 = 1.0", "k2 = true", "gains.k2 is true, expected a positive number"},
    {"k2 = 1.0", "k2 = 1979-05-27", "gains.k2 is a date or time, expected a positive number"},
    {"k2 = 1.0", "k2 = { a = 1 }", "gains.k2 is a table, expected a positive number"},
    {"width = 2.0", "width = [2.0]", "rbf.width is [2], expected a positive number"},
    {"edges = [[1, 2], [2, 3, 0.5]]", "edges = 3",
     "graph.edges is 3, expected a list of edges [i, j] or [i, j, weight]"},
    {"[1, 2], [2, 3, 0.5]", "[1, 2], 7", "graph.edges[2] is 7, expected an edge [i, j] or [i, j, weight]"},
    {"name = \"second\"", "name = 2", "player[2].name is 2, expected text"},
    {"order = 2", "order = \"2\"", "player[2].order is \"2\", expected an integer from 1 to 2"},
    {"x0 = [5.0, 6.0]", "x0 = [5.0, \"six\"]", "player[3].x0[2] is \"six\", expected a finite number"},
    {"x0 = [5.0, 6.0]", "x0 = \"here\"",
     "player[3].x0 is \"here\", expected a list of 2 numbers or one number that stands for all of them"},
    {"cost = { quadratic = 2.0, linear = -4.0 }", "cost = 1.0", "player[2].cost is 1, expected a table"},
    {"coupling = [[3, 2.0]]", "coupling = 2.0", "player[1].cost.coupling is 2, expected a list of pairs [j, c_ij]"},
    {"coupling = [[3, 2.0]]", "coupling = [3, 2.0]", "player[1].cost.coupling[1] is 3, expected a pair [j, c_ij]"},
    {"coupling = [[3, 2.0]]", "coupling = [[3.0, 2.0]]",
     "player[1].cost.coupling[1][1] is 3, expected an integer from 1 to 3"},
    {"coupling = [[3, 2.0]]", "coupling = [[3, [2.0, 2.0]]]",
     "player[1].cost.coupling[1][2] is [2, 2], expected a finite number"},
    {"centers = [-1.0, 0.0, 1, 2.5]", "centers = 1.0", "rbf.centers is 1, expected a list of 1 to 10000 centers"},
    {"centers = [-1.0, 0.0, 1, 2.5]", "centers = [1.0, [1.0]]", "rbf.centers[2] is [1], expected a finite number"},
    {"centers = [-1.0, 0.0, 1, 2.5]", "centers = [[1, 2, 3, 4, 5, 6], 3]",
     "rbf.centers[2] is 3, expected a list of 6 numbers, player by player, as the first center is a list"},
};
INSTANTIATE_TEST_SUITE_P(Types, GameDefinitionRefuses, ::testing::ValuesIn(types));

const Refusal lengths[] = {
    {"x0 = [1.0, 2.0]", "x0 = [1.0, 2.0, 3.0]",
     "player[1].x0 is [1, 2, 3], expected a list of 2 numbers or one number that stands for all of them"},
    {"x0 = [1.0, 2.0]", "x0 = []",
     "player[1].x0 is [], expected a list of 2 numbers or one number that stands for all of them"},
    {"x0 = [1.0, 2.0]", "x0 = [1, 2, 3, 4, 5, 6]",
     "player[1].x0 is a list of 6, expected a list of 2 numbers or one number that stands for all of them"},
    {"linear = [0.5, -0.5]", "linear = [0.5]",
     "player[1].cost.linear is [0.5], expected a list of 2 numbers or one number that stands for all of them"},
    {"v0 = -1", "v0 = [-1]",
     "player[2].v0 is [-1], expected a list of 2 numbers or one number that stands for all of them"},
    {"y0 = [[1.0, 2.0], 3.0, [4.0, 5.0]]", "y0 = [[3.0], [4.0]]",
     "player[1].y0 is a list of 2, expected \"x0\", a list of 3 estimates, one for each player, a list of 2 numbers, "
     "or one "
     "number"},
    {"y0 = [[1.0, 2.0], 3.0, [4.0, 5.0]]", "y0 = [3.0, 4.0, [1.0]]",
     "player[1].y0[3] is [1], expected a list of 2 numbers or one number that stands for all of them"},
    {"[3, 2.0]], square", "[3, [1.0, 2.0, 3.0]]], square",
     "player[2].dynamics.linear[2][2] is [1, 2, 3], expected a list of 2 numbers or one number that stands for all of "
     "them"},
    {"[3, 2.0]], square", "[3]], square", "player[2].dynamics.linear[2] is [3], expected a pair [j, coefficients]"},
    {"amplitude = [1.0, 2.0]", "amplitude = [1.0, 2.0, 3.0]",
     "player[3].disturbance.amplitude is [1, 2, 3], expected a list of 2 numbers or one number that stands for all of "
     "them"},
    {"coupling = [[3, 2.0]]", "coupling = [[3, 2.0, 1.0]]",
     "player[1].cost.coupling[1] is [3, 2, 1], expected a pair [j, c_ij]"},
    {"[1, 2], [2, 3, 0.5]", "[1, 2], [2, 3, 0.5, 1]",
     "graph.edges[2] is [2, 3, 0.5, 1], expected an edge [i, j] or [i, j, weight]"},
    {"[1, 2], [2, 3, 0.5]", "[1], [2, 3, 0.5]", "graph.edges[1] is [1], expected an edge [i, j] or [i, j, weight]"},
    {"centers = [-1.0, 0.0, 1, 2.5]", "centers = []", "rbf.centers is [], expected a list of 1 to 10000 centers"},
    {"centers = [-1.0, 0.0, 1, 2.5]", "centers = [[1, 2, 3]]",
     "rbf.centers[1] is [1, 2, 3], expected a list of 6 numbers, player by player, as the first center is a list"},
};
INSTANTIATE_TEST_SUITE_P(Lengths, GameDefinitionRefuses, ::testing::ValuesIn(lengths));

const Refusal ranges[] = {
    {"k1 = 10.0", "k1 = 0.0", "gains.k1 is 0, expected a positive number"},
    {"k2 = 1.0", "k2 = -1.5", "gains.k2 is -1.5, expected a positive number"},
    {"k3 = 50.0", "k3 = nan", "gains.k3 is nan, expected a positive number"},
    {"k4 = 20", "k4 = -inf", "gains.k4 is -inf, expected a positive number"},
    {"beta = 100.0", "beta = -1", "gains.beta is -1, expected a number that is not negative"},
    {"delta = 0.0", "delta = -0.5", "gains.delta is -0.5, expected a number that is not negative"},
    {"epsilon = 0.01", "epsilon = 0", "gains.epsilon is 0, expected a positive number"},
    {"width = 2.0", "width = -2.0", "rbf.width is -2, expected a positive number"},
    {"W_max = 50.0", "W_max = 0.0", "rbf.W_max is 0, expected a positive number"},
    {"W_max = 50.0", "W_max = inf", "rbf.W_max is inf, expected a positive number"},
    {"centers = [-1.0, 0.0, 1, 2.5]", "centers = [-1.0, nan]", "rbf.centers[2] is nan, expected a finite number"},
    {"order = 2", "order = 3", "player[2].order is 3, expected an integer from 1 to 2"},
    {"order = 2", "order = 0", "player[2].order is 0, expected an integer from 1 to 2"},
    {"x0 = [1.0, 2.0]", "x0 = [1.0, nan]", "player[1].x0[2] is nan, expected a finite number"},
    {"x0 = 3.0", "x0 = inf",
     "player[2].x0 is inf, expected a list of 2 numbers or one number that stands for all of them"},
    {"constant = 7.0", "constant = inf", "player[1].cost.constant is inf, expected a finite number"},
    {"bias = -1.0", "bias = [0.0, nan]", "player[3].disturbance.bias[2] is nan, expected a finite number"},
    {"[1, 2], [2, 3, 0.5]", "[1, 2], [2, 3, -0.5]", "graph.edges[2][3] is -0.5, expected a positive number"},
    {"[1, 2], [2, 3, 0.5]", "[1, 2], [2, 3, 0]", "graph.edges[2][3] is 0, expected a positive number"},
    {"[1, 2], [2, 3, 0.5]", "[1, 2], [2, 4]", "graph.edges[2][2] is 4, expected an integer from 1 to 3"},
    {"[1, 2], [2, 3, 0.5]", "[0, 2], [2, 3]", "graph.edges[1][1] is 0, expected an integer from 1 to 3"},
    {"[1, 2], [2, 3, 0.5]", "[1, 2.0], [2, 3]", "graph.edges[1][2] is 2, expected an integer from 1 to 3"},
    {"coupling = [[3, 2.0]]", "coupling = [[1000000000, 2.0]]",
     "player[1].cost.coupling[1][1] is 1000000000, expected an integer from 1 to 3"},
    {"linear = [[1, [1.5, 0.0]]", "linear = [[-1, [1.5, 0.0]]",
     "player[2].dynamics.linear[1][1] is -1, expected an integer from 1 to 3"},
    {"dimension = 2", "dimension = 1000000000", "dimension is 1000000000, expected an integer from 1 to 100"},
    {"dimension = 2", "dimension = -9223372036854775808",
     "dimension is -9223372036854775808, expected an integer from 1 to 100"},
};
INSTANTIATE_TEST_SUITE_P(Ranges, GameDefinitionRefuses, ::testing::ValuesIn(ranges));

const Refusal relations[] = {
    {"[1, 2], [2, 3, 0.5]", "[1, 2], [2, 2]",
     "graph.edges[2] is [2, 2], expected an edge between two different players"},
    {"[1, 2], [2, 3, 0.5]", "[1, 2], [2, 3], [1, 2]",
     "graph.edges[3] is [1, 2], expected each edge once, in one of its directions"},
    {"[1, 2], [2, 3, 0.5]", "[1, 2], [2, 3], [2, 1, 0.5]",
     "graph.edges[3] is [2, 1, 0.5], expected each edge once, in one of its directions"},
    {"[1, 2], [2, 3, 0.5]", "[1, 2]",
     "graph.edges leaves the players in separate groups {1, 2}, {3}, expected a connected graph"},
    {"[1, 2], [2, 3, 0.5]", "",
     "graph.edges leaves the players in separate groups {1}, {2}, {3}, expected a connected graph"},
    {"name = \"second\"", "name = \"first\"", "player[2].name is \"first\", expected a name that no other player has"},
    {"name = \"second\"", "name = \"\"", "player[2].name is \"\", expected a name that is not empty"},
    {"coupling = [[3, 2.0]]", "coupling = [[3, 2.0], [2, 1.0], [3, 2.0]]",
     "player[1].cost.coupling[3] is [3, 2], expected each player once, and player 3 comes twice"},
    {"coupling = [[3, 2.0]]", "coupling = [[1, 2.0]]",
     "player[1].cost.coupling[1][2] is 2, expected no coupling of player 1 with itself"},
    {"[3, 2.0]], square", "[1, 2.0]], square",
     "player[2].dynamics.linear[2] is [1, 2], expected each player once, and player 1 comes twice"},
    {"square = [[1, [0.0, -0.25]]]", "square = [[1, 0.5], [1, 0.5]]",
     "player[2].dynamics.square[2] is [1, 0.5], expected each player once, and player 1 comes twice"},
    {"[1, 2], [2, 3, 0.5]]", "[1, 2], [2, 3, 0.5]]\ndirected = true",
     "graph.edges lets nothing of player 2 reach player 1, expected a strongly connected graph"},
    {"[1, 2], [2, 3, 0.5]]", "[1, 2], [3, 1], [1, 2]]\ndirected = true",
     "graph.edges[3] is [1, 2], expected each edge once"},
    {"[1, 2], [2, 3, 0.5]]", "[1, 2], [2]]\ndirected = true",
     "graph.edges[2] is [2], expected an edge [from, to] or [from, to, weight]"},
    {"[1, 2], [2, 3, 0.5]]", "[1, 2], [2, 3]]\ndirected = 1", "graph.directed is 1, expected true or false"},
    {"v0 = -1", "rbf = { centers = [1.0] }",
     "player[2].rbf.centers is [1], expected a list of 4 centers, as rbf.centers is"},
    {"v0 = -1", "rbf = { width = 0 }", "player[2].rbf.width is 0, expected a positive number"},
    {"v0 = -1", "rbf = { rho = 1 }",
     "\"rho\" is an unknown key of player[2].rbf, expected one of centers, width, W_max"},
    {"v0 = -1", "W0 = 1.0", "player[2].W0 is 1, expected a list of 4 numbers or of as many lists of 2 numbers"},
    {"v0 = -1", "W0 = [1.0, 2.0]",
     "player[2].W0 is [1, 2], expected a list of 4 numbers or of as many lists of 2 numbers"},
    {"v0 = -1", "W0 = [[0, 7.0], [0, 2.0], 0, 0]",
     "the initial weights W0 of player 2, coordinate 2, have the squared norm 53, expected at most W_max, 50"},
    {"v0 = -1", "gains = { k1 = 3.0 }", "player[2].gains.k1 is 3, expected no k1 of a player of order 2, which has k4"},
    {"v0 = -1", "gains = { k3 = 0 }", "player[2].gains.k3 is 0, expected a positive number"},
    {"v0 = -1", "gains = { kappa = 1 }",
     "\"kappa\" is an unknown key of player[2].gains, expected one of k1, k2, k3, k4, beta, delta, epsilon"},
    {"v0 = -1", "gains = 3.0", "player[2].gains is 3, expected a table"},
    {"v0 = -1", "z0 = -1", "player[2].z0 is -1, expected no z0 for a player of order 2, which has v0"},
    {"z0 = [0.1, 0.2]", "v0 = [0.1, 0.2]",
     "player[1].v0 is [0.1, 0.2], expected no v0 for a player of order 1, which has z0"},
    {"cost = { quadratic = 2.0, linear = -4.0 }", "",
     "the game has no unique Nash equilibrium: the Jacobian of its pseudo-gradient is singular (reciprocal condition "
     "number below 1e-13 with its rows and columns balanced), expected cost parameters that make it regular"},
    {"cost = { quadratic = 2.0, linear = -4.0 }", "cost = { quadratic = -2.0, linear = -4.0 }",
     "player[2].cost is concave in the player's own action (second derivative -4), expected one of at least 0: where "
     "all gradients vanish, player 2 can lower its cost, and that is no Nash equilibrium"},
};
INSTANTIATE_TEST_SUITE_P(Relations, GameDefinitionRefuses, ::testing::ValuesIn(relations));

TEST(GameDefinition, NeedsTwoPlayers) {
  const std::string head(three_players.substr(0, three_players.find("[[player]]")));
  EXPECT_EQ(refusal(head), "player is missing, expected 2 to 1000 tables [[player]]");
  EXPECT_EQ(refusal(head + "[[player]]\nname = \"alone\"\n"),
            "player is a list of 1, expected 2 to 1000 tables [[player]]");
  EXPECT_EQ(refusal(head + "[player]\nname = \"alone\"\n"), "player is a table, expected 2 to 1000 tables [[player]]");
  EXPECT_EQ(refusal("player = [1, 2]\n" + head), "player[1] is 1, expected a table");
  EXPECT_EQ(refusal(""), "title is missing, expected text");
}

TEST(GameDefinition, NamesOnlySomeOfManySeparateGroups) {
  std::string text = ring_of(200, 1);
  const std::size_t edges = text.find("edges = ");
  text.replace(edges, text.find('\n', edges) - edges, "edges = []");
  const std::string message = refusal(text);
  EXPECT_EQ(message.find("graph.edges leaves the players in separate groups {1}, {2}, {3}, "), 0U);
  EXPECT_NE(message.find("}, ..., expected a connected graph"), std::string::npos) << message;
  EXPECT_LT(message.size(), 320U);
}

TEST(GameDefinition, RefusesGraphsWhoseFactorsTakeTooMuchMemory) {
  constexpr int players = 1000;
  std::string edges = "edges = [";
  for (int i = 1; i <= players; ++i) {
    for (int span = 1; span <= players / 2; span += 3) {
      edges += '[' + std::to_string(i) + ',' + std::to_string((i + span - 1) % players + 1) + "],";
    }
  }
  std::string text = ring_of(players, 1);
  const std::size_t ring = text.find("edges = ");
  text.replace(ring, text.find('\n', ring) - ring, edges + ']');
  const std::string message = refusal(text);
  EXPECT_EQ(message.find("the graph of 1000 players and "), 0U) << message;
  EXPECT_NE(message.find(" bytes for factors of the estimates' equations, expected at most 2147483648"),
            std::string::npos)
      << message;
}

std::string repeated(std::string_view part, std::size_t times) {
  std::string text;
  text.reserve(part.size() * times);
  for (std::size_t k = 0; k < times; ++k) text += part;
  return text;
}

TEST(HostileGameDefinition, IsRefusedBeforeItsSizesAreAllocated) {
  EXPECT_EQ(refusal(ring_of(1001, 1)), "player is a list of 1001, expected 2 to 1000 tables [[player]]");
  EXPECT_EQ(refusal(ring_of(1000, 100)),
            "the game of 1000 players, dimension 100 and 1 centers has 100300000 states, expected at most 20000000");
  EXPECT_EQ(refusal(edited("centers = [-1.0, 0.0, 1, 2.5]", "centers = [" + repeated("0,", 10001) + "]")),
            "rbf.centers is a list of 10001, expected a list of 1 to 10000 centers");
  EXPECT_EQ(refusal(edited("[1, 2], [2, 3, 0.5]", repeated("[1, 2],", 100000))),
            "graph.edges[2] is [1, 2], expected each edge once, in one of its directions");
  EXPECT_EQ(
      refusal(edited("x0 = [1.0, 2.0]", "x0 = [" + repeated("0,", 1000000) + "]")),
      "player[1].x0 is a list of 1000000, expected a list of 2 numbers or one number that stands for all of them");
  EXPECT_EQ(refusal(repeated("#", (std::size_t{32} << 20) + 1)),
            "the game definition has 33554433 bytes, expected at most 33554432");
}

TEST(HostileGameDefinition, CannotExhaustTheStack) {
  const std::string too_deep =
      " of the game definition is not TOML: Error while parsing value: exceeded maximum nested value depth of 32 "
      "(TOML_MAX_NESTED_VALUES)";
  EXPECT_EQ(refusal("a = " + repeated("[", 1000000)), "line 1, column 37" + too_deep);
  EXPECT_EQ(refusal("a = " + repeated("{a = ", 1000000)), "line 1, column 165" + too_deep);
  const std::string dots = "line 2 of the game definition has a key of more than 16 dots, expected the keys of a game";
  const std::string key = repeated("a.", 1000000) + "a";
  EXPECT_EQ(refusal("\n" + key + " = 1"), dots);
  EXPECT_EQ(refusal("\n[" + key + "]"), dots);
  EXPECT_EQ(refusal("\n[[" + key + "]]"), dots);
  EXPECT_EQ(refusal("\nb = {" + key + " = 1}"), dots);
  EXPECT_EQ(refusal("\n" + repeated("\"\" . ", 1000000) + "a = 1"), dots);
  // behind strings that end in unusual ways
  for (const std::string string : {R"("")", R"('')", R"("""""")", R"("""x"""")", R"("""x""""")", R"("\"")", R"('\')",
                                   R"('''x'''')", R"("""\"""")", R"("#")", R"("""'""")"}) {
    EXPECT_EQ(refusal("b = " + string + "\n" + key + " = 1"), dots) << string;
    EXPECT_EQ(refusal("\nb = {c = " + string + ", " + key + " = 1}"), dots) << string;
  }
  EXPECT_EQ(refusal("# don't \"\"\"\n" + key + " = 1"), dots);
}

TEST(HostileGameDefinition, DotsElsewhereAreNoKeys) {
  const std::string many = repeated(".", 50);
  EXPECT_EQ(refusal(edited("title = \"three players\"", "# " + many + "\ntitle = \"" + many + "\" # " + many)),
            "(accepted)");
  EXPECT_EQ(refusal(edited("title = \"three players\"", "title = '''" + many + "'''")), "(accepted)");
  EXPECT_EQ(refusal(edited("title = \"three players\"", "title = \"\"\"\\\n" + many + "\\\n\"\"\"")), "(accepted)");
}

TEST(GameDefinition, MayBeginWithAByteOrderMark) {
  const std::string mark = "\xEF\xBB\xBF";
  EXPECT_EQ(refusal(mark + std::string(three_players)), "(accepted)");
  EXPECT_EQ(refusal(mark + "title = 1\n"), refusal("title = 1\n"));
  for (const std::string other : {"\xFF\xFE", "\xFE\xFF"}) {
    EXPECT_EQ(refusal(other + "t"), "the game definition is UTF-16 text, expected UTF-8");
  }
}

TEST(HostileGameDefinition, OfBytesThatAreNoTextIsRefused) {
  using namespace std::string_view_literals;
  EXPECT_NE(refusal("title = \"\xff\xfe\""sv).find("line 1, column"), std::string::npos);
  EXPECT_NE(refusal("title = \0"sv).find("line 1, column"), std::string::npos);
  EXPECT_NE(refusal("\"\"\""sv).find("not TOML"), std::string::npos);
  EXPECT_NE(refusal("'"sv).find("not TOML"), std::string::npos);
  EXPECT_NE(refusal("a = \"\\"sv).find("not TOML"), std::string::npos);
  // a long value is cut between two characters
  const std::string umlauts = repeated("\xc3\xa4", 100);
  EXPECT_EQ(refusal(edited("dimension = 2", "dimension = \"a" + umlauts + "\"")),
            "dimension is \"a" + repeated("\xc3\xa4", 19) + "...\", expected an integer from 1 to 100");
}

TEST(HostileGameDefinition, OfOverflowingCostsIsRefused) {
  EXPECT_EQ(refusal(edited("cost = { quadratic = 2.0, linear = -4.0 }", "cost = { quadratic = 1e308 }"))
                .find("the game has no unique Nash equilibrium"),
            0U);
}

// Any cut of a valid definition is either a game or a clean refusal.
TEST(HostileGameDefinition, CutAnywhereIsHandled) {
  for (std::size_t length = 0; length < three_players.size(); length += 3) {
    const std::string message = refusal(three_players.substr(0, length));
    EXPECT_FALSE(message.empty());
  }
}

}  // namespace
}  // namespace mixed_order_game
