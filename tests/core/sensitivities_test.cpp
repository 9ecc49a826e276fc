#include "integration/sensitivities.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <sstream>

#include "game/game.hpp"
#include "integration/integrator.hpp"
#include "larger.hpp"
#include "random_game.hpp"

namespace mixed_order_game {
namespace {

std::string text_of(const std::string& path) {
  std::ifstream file(std::string(MIXED_ORDER_GAME_SOURCE_DIR) + "/" + path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

const std::string paper_game = "modelDescription/games/five_vehicles.toml";
const std::string busy_game = "tests/reference/games/small_weight_bound.toml";  // enters and leaves the sphere often
const std::string switching_game = "tests/reference/games/switching.toml";      // restarts where expressions jump

/// Adds h times a direction to parameters, whose size in the game is the scale of its changes.
struct Move {
  std::string name;
  Real scale;
  std::function<void(Parameters&, Real h)> add;
};

std::vector<Move> moves_of_gains(const Parameters& parameters) {
  std::vector<Move> moves;
  for (std::size_t k = 0; k < declared_gains.size(); ++k) {
    const auto member = Gains::members()[k];
    Real size = (parameters.gains.*member)[0];
    if (declared_gains[k].name == std::string("epsilon")) size *= 4.0;  // so small that runs' errors would show
    if (size == 0.0) continue;
    moves.push_back({declared_gains[k].name, size, [member](Parameters& moved, Real h) {
                       for (Real& gain : moved.gains.*member) gain += h;
                     }});
  }
  return moves;
}

using Table = std::vector<std::vector<Real>>;  // actions by time

constexpr int times = 4;

template <typename Row>
Table run(const Parameters& parameters, Real stop, Real tolerance, StepFollower* follower, const Row& row_at) {
  const ClosedLoop loop(parameters);
  const Inputs input(loop.shape().actions());
  Integrator integrator(loop, input, make_structured_newton());
  integrator.set_follower(follower);
  integrator.start(0.0, {tolerance, 0.01 * tolerance});
  Table table;
  for (int k = 1; k <= times; ++k) {
    integrator.advance(stop * k / times);
    const Real* row = row_at(integrator);
    table.emplace_back(row, row + loop.shape().actions());
  }
  return table;
}

Table actions(const Parameters& parameters, Real stop) {
  return run(parameters, stop, 1e-12, nullptr, [](const Integrator& integrator) { return integrator.state(); });
}

/// Sensitivities of the actions, beside differences of tight runs, to a part of the largest of them.
void expect_differences(const Parameters& parameters, const std::vector<Move>& moves, Real stop, Real part) {
  std::vector<Parameters> directions;
  for (const Move& move : moves) {
    directions.push_back(parameters.zero_direction());
    move.add(directions.back(), 1.0);
    directions.back().refresh();
  }
  const ClosedLoop loop(parameters);
  const Inputs input(loop.shape().actions());
  Sensitivities sensitivities(loop, input, directions);
  for (std::size_t m = 0; m < moves.size(); ++m) {
    const Table found = run(parameters, stop, 3e-12, &sensitivities, [&](const Integrator& integrator) {
      return sensitivities.at_time(integrator.time(), static_cast<int>(m));
    });
    // (8 (x(h) - x(-h)) - (x(2 h) - x(-2 h))) / (12 h)
    const Real h = 5e-4 * moves[m].scale;
    const auto moved_by = [&](Real by) {
      Parameters moved = parameters;
      moves[m].add(moved, by);
      return actions(moved, stop);
    };
    const Table near[] = {moved_by(-h), moved_by(h)};
    const Table far[] = {moved_by(-2.0 * h), moved_by(2.0 * h)};
    Real largest = 0.0;
    Real error = 0.0;
    for (std::size_t k = 0; k < found.size(); ++k) {
      for (std::size_t p = 0; p < found[k].size(); ++p) {
        const Real difference = (8.0 * (near[1][k][p] - near[0][k][p]) - (far[1][k][p] - far[0][k][p])) / (12.0 * h);
        largest = std::max(largest, std::fabs(difference));
        error = testing::larger(error, std::fabs(found[k][p] - difference));
      }
    }
    EXPECT_LE(error, part * largest) << moves[m].name;
  }
}

TEST(Sensitivities, ToGainsAreDifferencesOfRunsInThePapersGame) {
  const Parameters parameters = parse_game(text_of(paper_game)).parameters;
  expect_differences(parameters, moves_of_gains(parameters), 1.0, 5e-6);
}

TEST(Sensitivities, ToGainsAreDifferencesOfRunsWhereWeightsSlideAndExpressionsJump) {
  for (const std::string& game : {busy_game, switching_game}) {
    SCOPED_TRACE(game);
    const Parameters parameters = parse_game(text_of(game)).parameters;
    expect_differences(parameters, moves_of_gains(parameters), 0.75, 5e-6);
  }
}

TEST(Sensitivities, ToGainsAreDifferencesOfRunsInRandomGames) {
  const auto recipes = testing::assorted_recipes();
  for (const std::size_t number : {recipes.size() / 2, recipes.size() - 1}) {
    SCOPED_TRACE(number);
    const Parameters parameters = parse_game(toml_of(testing::random_game(recipes[number]))).parameters;
    expect_differences(parameters, moves_of_gains(parameters), 0.3, 5e-6);
  }
}

TEST(Sensitivities, ToGainsAreDifferencesOfRunsWithCentersOffTheDiagonal) {
  const Parameters parameters = parse_game(text_of("tests/reference/games/vector_centers.toml")).parameters;
  ASSERT_FALSE(parameters.rbf.diagonal);
  expect_differences(parameters, moves_of_gains(parameters), 0.3, 5e-6);
}

/// Every bend of a bounded control costs accuracy, but not what it is worth to know where the bound acts.
TEST(Sensitivities, ToGainsAreDifferencesOfRunsWithBoundedControls) {
  std::string game = text_of(paper_game);
  const std::string bound = "\nu_max = [150.0, 120.0]";
  for (std::size_t at = game.find("\nx0 = "); at != std::string::npos; at = game.find("\nx0 = ", at)) {
    game.insert(at, bound);
    at += bound.size() + 1;
  }
  const Parameters parameters = parse_game(game).parameters;
  expect_differences(parameters, moves_of_gains(parameters), 0.2, 5e-3);
}

/// What sensitivities lose at kinks falls with the tolerance; a wrong time, jump or history at one of them shows in
/// loose runs, and hardly in tight ones. Errors of a run at 1e-8, to a part of the largest sensitivity to each gain.
std::vector<std::pair<std::string, Real>> errors_of_loose_run(const Parameters& parameters) {
  const std::vector<Move> moves = moves_of_gains(parameters);
  std::vector<Parameters> directions;
  for (const Move& move : moves) {
    directions.push_back(parameters.zero_direction());
    move.add(directions.back(), 1.0);
    directions.back().refresh();
  }
  const ClosedLoop loop(parameters);
  const Inputs input(loop.shape().actions());
  std::vector<std::pair<std::string, Real>> errors;
  for (std::size_t m = 0; m < moves.size(); ++m) {
    const auto found = [&](Real tolerance) {
      Sensitivities sensitivities(loop, input, directions);
      return run(parameters, 3.0, tolerance, &sensitivities, [&](const Integrator& integrator) {
        return sensitivities.at_time(integrator.time(), static_cast<int>(m));
      });
    };
    const Table tight = found(3e-12);
    const Table loose = found(1e-8);
    Real largest = 0.0;
    Real error = 0.0;
    for (std::size_t k = 0; k < tight.size(); ++k) {
      for (std::size_t p = 0; p < tight[k].size(); ++p) {
        largest = std::max(largest, std::fabs(tight[k][p]));
        error = testing::larger(error, std::fabs(loose[k][p] - tight[k][p]));
      }
    }
    errors.emplace_back(moves[m].name, error / largest);
  }
  return errors;
}

TEST(Sensitivities, PassKinksWhereErrorsTurnWithTheAccuracyOfTheRun) {
  for (const auto& [gain, error] : errors_of_loose_run(parse_game(text_of(busy_game)).parameters)) {
    EXPECT_LE(error, gain == "k4" ? 1e-5 : 3e-6) << gain;  // k4 moves the actions least
  }
}

/// Two players on the sphere from the start on, whose networks go from the first neuron's weight to the second one's,
/// of the other sign, while the errors keep theirs: w'S turns, and with it what sliding removes.
const std::string turning_networks = R"(
title = "Networks that turn"
dimension = 1
[gains]
k1 = 10.0
k2 = 1.0
k3 = 40.0
k4 = 10.0
beta = 2.0
delta = 0.5
epsilon = 0.1
[rbf]
centers = [-2.0, 2.0]
width = 3.0
W_max = 50.0
[graph]
edges = [[1, 2]]
[[player]]
name = "first"
order = 1
x0 = -2.0
z0 = -2.0
y0 = [-2.0, -2.0]
W0 = [5.0, -5.0]
cost = { quadratic = 0.5, linear = -2.0 }
disturbance = { bias = 20.0 }
[[player]]
name = "second"
order = 2
x0 = -2.0
y0 = [-2.0, -2.0]
W0 = [5.0, -5.0]
cost = { quadratic = 0.5, linear = -2.0 }
disturbance = { bias = 20.0 }
)";

TEST(Sensitivities, PassKinksWhereNetworksTurn) {
  const Parameters parameters = parse_game(turning_networks).parameters;
  expect_differences(parameters, moves_of_gains(parameters), 3.0, 5e-6);
  for (const auto& [gain, error] : errors_of_loose_run(parameters)) {
    EXPECT_LE(error, gain == "epsilon" ? 1e-5 : 1e-6) << gain;  // epsilon moves the actions least
  }
}

TEST(Sensitivities, ToOtherParametersAreDifferencesOfRuns) {
  const Parameters parameters = parse_game(text_of(busy_game)).parameters;
  const std::vector<Move> moves{
      {"a[1,2]", 1.0,
       [](Parameters& moved, Real h) {
         moved.graph.set_weight(0, 1, moved.graph.weight(0, 1) + h);
         moved.graph.refresh();
       }},
      {"W_max", parameters.rbf.W_max[0],
       [](Parameters& moved, Real h) {
         for (Real& bound : moved.rbf.W_max) bound += h;
       }},
      {"rho", parameters.rbf.width[0],
       [](Parameters& moved, Real h) {
         for (Real& width : moved.rbf.width) width += h;
       }},
      {"x0[1,1]", 1.0, [](Parameters& moved, Real h) { moved.initial.x[0] += h; }},
      {"cost_quadratic", 1.0,
       [](Parameters& moved, Real h) {
         moved.cost->coefficients.set(0, 0, moved.cost->coefficients.value(0, 0) + h);
         moved.refresh();
       }},
  };
  expect_differences(parameters, moves, 0.75, 5e-6);
}

TEST(Sensitivities, LeaveNoTraceInTheRun) {
  const Parameters parameters = parse_game(text_of(busy_game)).parameters;
  const ClosedLoop loop(parameters);
  const Inputs input(loop.shape().actions());
  std::vector<Parameters> directions{parameters.zero_direction()};
  directions[0].gains.k2.assign(directions[0].gains.k2.size(), 1.0);
  Sensitivities sensitivities(loop, input, directions);
  const auto state = [](const Integrator& integrator) { return integrator.state(); };
  EXPECT_EQ(run(parameters, 4.0, 1e-6, &sensitivities, state), run(parameters, 4.0, 1e-6, nullptr, state));
}

}  // namespace
}  // namespace mixed_order_game
