// Random games with gains, widths and bounds over decades: every run ends or says why it cannot, and none costs much
// more than those at neighbouring tolerances. MIXED_ORDER_GAME_STRESS_GAMES asks for more games than the usual sample.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "errors.hpp"
#include "game/game.hpp"
#include "integration/integrator.hpp"
#include "random_game.hpp"

namespace mixed_order_game {
namespace {

using testing::PlainGame;
using testing::RandomNumbers;

std::uint64_t games(std::uint64_t usual) {
  const char* asked = std::getenv("MIXED_ORDER_GAME_STRESS_GAMES");
  return asked != nullptr ? std::strtoull(asked, nullptr, 10) : usual;
}

/// Ends a run that would go on for ever.
class BoundedSolver final : public NewtonSolver {
 public:
  void refresh(const LoopJacobian& jacobian) override { solver_->refresh(jacobian); }
  bool factor(const LoopJacobian& jacobian, Real gamma) override { return solver_->factor(jacobian, gamma); }
  void solve(Real* b) override {
    if (++solves_ > 200'000) throw Error("the run takes more than 200,000 solves");
    solver_->solve(b);
  }

 private:
  std::unique_ptr<NewtonSolver> solver_ = make_structured_newton();
  std::int64_t solves_ = 0;
};

Real over_decades(RandomNumbers& random, Real low, Real high) { return std::pow(10.0, random.between(low, high)); }

void scale(testing::Rows& rows, Real factor) {
  for (testing::Numbers& row : rows) {
    for (double& number : row) number *= factor;
  }
}

/// Layers down to 1e-10, where the sign of e is below any tolerance, with strong adaptation and bounds that are met.
PlainGame sharp_game(std::uint64_t seed) {
  RandomNumbers random(1000 + seed);
  PlainGame game = testing::random_game({.seed = seed,
                                         .players = 2 + random.below(3),
                                         .dimension = 1 + random.below(2),
                                         .neurons = 1 + random.below(8),
                                         .diagonal = random.chance(0.7)});
  game.k1 = everyone(game, over_decades(random, 0.0, 2.5));
  game.k2 = everyone(game, over_decades(random, -1.0, 1.0));
  game.k3 = everyone(game, over_decades(random, 1.0, 3.0));
  game.k4 = everyone(game, over_decades(random, 0.0, 2.5));
  game.beta = everyone(game, over_decades(random, 0.0, 6.0));
  game.delta = everyone(game, over_decades(random, 0.5, 2.5));
  game.epsilon = everyone(game, over_decades(random, -10.0, -3.0) * 0.2784645427610738 * game.delta[0]);
  game.width = everyone(game, over_decades(random, 0.0, 2.0));
  game.W_max = everyone(game, over_decades(random, -1.0, 3.0));
  game.H = testing::blocks_of(game.players, game.players, game.dimension);
  const Real dynamics = over_decades(random, -2.0, 0.3);
  for (testing::Rows& rows : game.G) scale(rows, dynamics);
  scale(game.amplitude, over_decades(random, -2.0, 1.0));
  return game;
}

/// Anything that a file may state, unstable loops and plants that escape included.
PlainGame wild_game(std::uint64_t seed) {
  RandomNumbers random(5000 + seed);
  PlainGame game = testing::random_game({.seed = seed,
                                         .players = 2 + random.below(11),
                                         .dimension = 1 + random.below(3),
                                         .neurons = 1 + random.below(8),
                                         .diagonal = random.chance(0.7),
                                         .robust = random.chance(0.9),
                                         .perturbed = random.chance(0.9)});
  game.k1 = everyone(game, over_decades(random, 0.0, 2.5));
  game.k2 = everyone(game, over_decades(random, -1.0, 1.0));
  game.k3 = everyone(game, over_decades(random, 0.0, 3.0));
  game.k4 = everyone(game, over_decades(random, -1.0, 2.5));
  game.beta = everyone(game, over_decades(random, -1.0, 6.0));
  game.delta = everyone(game, over_decades(random, -6.0, 3.0));
  game.epsilon = everyone(game, over_decades(random, -6.0, 1.0));
  game.width = everyone(game, over_decades(random, -0.5, 2.0));
  game.W_max = everyone(game, over_decades(random, -4.0, 3.0));
  if (random.chance(0.7)) game.H = testing::blocks_of(game.players, game.players, game.dimension);
  const Real dynamics = over_decades(random, -2.0, 0.3);
  for (testing::Rows& rows : game.G) scale(rows, dynamics);
  scale(game.amplitude, over_decades(random, -2.0, 1.0));
  return game;
}

struct Outcome {
  Statistics statistics;
  std::string message;  ///< of a run that failed
};

Outcome run(const PlainGame& game, Real tolerance, Real end) {
  const ClosedLoop loop(parse_game(testing::toml_of(game)).parameters);
  const Inputs input(loop.shape().actions());
  Integrator integrator(loop, input, std::make_unique<BoundedSolver>());
  std::vector<Real> norm2(at(loop.shape().actions()));
  Outcome outcome;
  try {
    integrator.start(0.0, {tolerance, 0.01 * tolerance});
    for (int k = 1; k <= 10; ++k) {
      integrator.advance(end * k / 10);
      loop.weight_norms(integrator.state(), norm2.data());
      for (const Real norm : norm2) EXPECT_LE(norm, game.W_max[0] * (1.0 + 1e-9));
    }
  } catch (const Error& error) {
    outcome.message = error.what();
  }
  outcome.statistics = integrator.statistics();
  return outcome;
}

TEST(Stress, NoToleranceCostsTenTimesWhatItsNeighboursDo) {
  const std::vector<Real> tolerances = {1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8};
  for (std::uint64_t seed = 1; seed <= games(30); ++seed) {
    const PlainGame game = sharp_game(seed);
    std::vector<std::int64_t> cost;
    for (const Real tolerance : tolerances) {
      const Outcome outcome = run(game, tolerance, 2.0);
      EXPECT_EQ(outcome.message, "") << "game " << seed << " at " << tolerance;
      cost.push_back(outcome.statistics.newton_solves);
    }
    for (std::size_t k = 0; k + 1 < cost.size(); ++k) {
      EXPECT_LE(cost[k], 10 * cost[k + 1]) << "game " << seed << " at " << tolerances[k];
      EXPECT_LE(cost[k + 1], 10 * cost[k]) << "game " << seed << " at " << tolerances[k + 1];
    }
  }
}

TEST(Stress, EveryRunEndsOrSaysWhyItCannot) {
  int failed = 0;
  for (std::uint64_t seed = 1; seed <= games(30); ++seed) {
    const PlainGame game = wild_game(seed);
    for (const Real tolerance : {1e-3, 1e-4, 1e-6, 1e-8}) {
      const Outcome outcome = run(game, tolerance, 2.0);
      if (outcome.message.empty()) continue;
      ++failed;
      std::size_t at_part = 0;
      for (const char* part :
           {"the integration stopped at t = ", " s: player ", " grows without bound: ", " has reached "}) {
        at_part = outcome.message.find(part, at_part);
        ASSERT_NE(at_part, std::string::npos) << "game " << seed << " at " << tolerance << ": " << outcome.message;
      }
    }
  }
  RecordProperty("failed", failed);
}

}  // namespace
}  // namespace mixed_order_game
