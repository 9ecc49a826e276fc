#include "loop/closed_loop.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "game/game.hpp"
#include "reference_loop.hpp"

namespace mixed_order_game {
namespace {

using testing::assorted_recipes;
using testing::flat_actions;
using testing::LoopSignals;
using testing::LoopState;
using testing::PlainGame;
using testing::random_game;
using testing::random_state;
using testing::RandomNumbers;
using testing::Recipe;
using testing::reference_rate;
using testing::Rows;
using testing::rows_of;
using testing::toml_of;

Modes modes_of(const std::vector<std::vector<int>>& on_sphere) {
  Modes modes;
  for (std::size_t l = 0; l < on_sphere[0].size(); ++l) {
    for (const std::vector<int>& row : on_sphere) modes.push_back(row[l] != 0 ? 1 : 0);
  }
  return modes;
}

template <typename Container>
void expect_close(const Container& computed, const std::vector<Real>& expected, const char* what) {
  ASSERT_GE(computed.size(), expected.size()) << what;
  Real largest = 1.0;
  for (const Real number : expected) largest = std::max(largest, std::abs(number));
  for (std::size_t k = 0; k < expected.size(); ++k) {
    const Real tolerance = 1e-13 * (std::abs(expected[k]) + 0.01 * largest);
    EXPECT_NEAR(computed[k], expected[k], tolerance) << what << " number " << k;
  }
}

class ClosedLoopOfRandomGame : public ::testing::TestWithParam<Recipe> {
 protected:
  PlainGame game_ = random_game(GetParam());
  ClosedLoop loop_{parse_game(toml_of(game_)).parameters};
  RandomNumbers random_{1000 + GetParam().seed};
};

TEST_P(ClosedLoopOfRandomGame, StateRatesAndSignalsMeetTheEquations) {
  for (int repeat = 0; repeat < 5; ++repeat) {
    std::vector<std::vector<int>> on_sphere;
    LoopState<Real> state = random_state(game_, random_, on_sphere);
    Rows d_ext = rows_of(game_.players, game_.dimension);
    random_.fill(d_ext, -2.0, 2.0);
    const Real t = random_.between(0.0, 20.0);

    LoopSignals<Real> expected;
    LoopState<Real> expected_rate = reference_rate(game_, t, state, d_ext, on_sphere, &expected);
    const std::vector<Real> flat_state = state.flat();
    ASSERT_EQ(flat_state.size(), at(loop_.layout().size()));
    Signals signals(loop_.shape());
    std::vector<Real> rate(flat_state.size(), 12345.0);
    loop_.evaluate(t, flat_state.data(), flat_actions(d_ext).data(), modes_of(on_sphere), signals, rate.data());

    expect_close(rate, expected_rate.flat(), "rate");
    expect_close(signals.shared, flat_actions(expected.shared), "shared signal");
    expect_close(signals.gradient, flat_actions(expected.gradient), "gradient");
    expect_close(signals.error, flat_actions(expected.error), "seeking error");
    expect_close(signals.network, flat_actions(expected.network), "network");
    expect_close(signals.robust, flat_actions(expected.robust), "robust term");
    expect_close(signals.dynamics, flat_actions(expected.dynamics), "unknown dynamics");
    expect_close(signals.disturbance, flat_actions(expected.disturbance), "disturbance");
    expect_close(signals.control, flat_actions(expected.control), "control");
    if (!game_.robust) continue;
    for (std::size_t m = 0; m < game_.neurons; ++m) {
      for (std::size_t l = 0; l < game_.dimension; ++l) {
        for (std::size_t i = 0; i < game_.players; ++i) {
          const std::size_t p = (m * game_.dimension + l) * game_.players + i;
          EXPECT_NEAR(signals.activation[p], expected.activation[i][m], 1e-14);
        }
      }
    }
  }
}

TEST_P(ClosedLoopOfRandomGame, InitialStateIsThatOfTheDefinition) {
  LoopState<Real> expected(game_);
  expected.x = game_.x0;
  expected.reference = game_.reference0;
  expected.y = game_.y0;
  if (!game_.W0.empty()) expected.W = game_.W0;
  std::vector<Real> state(at(loop_.layout().size()), 12345.0);
  loop_.initial_state(state.data());
  EXPECT_EQ(state, expected.flat());
}

TEST_P(ClosedLoopOfRandomGame, LeavingTheSphereDoesNotChangeTheRates) {
  std::vector<std::vector<int>> on_sphere;
  const std::vector<Real> state = random_state(game_, random_, on_sphere).flat();
  const std::vector<Real> no_input(at(loop_.shape().actions()), 0.0);
  Signals signals(loop_.shape());
  Modes modes(at(loop_.shape().actions()), 1);
  std::vector<Real> on(at(loop_.layout().size()));
  std::vector<Real> off(on.size());
  loop_.evaluate(0.3, state.data(), no_input.data(), modes, signals, on.data());
  for (std::size_t p = 0; p < modes.size(); ++p) {
    if (signals.error[p] * signals.network[p] < 0.0) modes[p] = 0;
  }
  loop_.evaluate(0.3, state.data(), no_input.data(), modes, signals, off.data());
  EXPECT_EQ(on, off);
}

TEST_P(ClosedLoopOfRandomGame, OnTheSphereTheNormNeverGrows) {
  std::vector<std::vector<int>> on_sphere;
  LoopState<Real> state = random_state(game_, random_, on_sphere);
  Signals signals(loop_.shape());
  std::vector<Real> rate(at(loop_.layout().size()));
  const std::vector<Real> no_input(at(loop_.shape().actions()), 0.0);
  loop_.evaluate(0.0, state.flat().data(), no_input.data(), modes_of(on_sphere), signals, rate.data());
  LoopState<Real> rates(game_);
  rates.set_flat(rate);
  for (std::size_t i = 0; i < game_.players; ++i) {
    for (std::size_t l = 0; l < game_.dimension; ++l) {
      if (on_sphere[i][l] == 0) continue;
      Real growth = 0.0;
      Real size = 1e-10;
      for (std::size_t m = 0; m < game_.neurons; ++m) {
        growth += 2.0 * state.W[i][m][l] * rates.W[i][m][l];
        size += std::abs(state.W[i][m][l] * rates.W[i][m][l]);
      }
      const std::size_t p = l * game_.players + i;
      const Real inward = std::min(0.0, 2.0 * game_.beta[i] * signals.error[p] * signals.network[p]);
      EXPECT_NEAR(growth, inward, 1e-12 * size + 1e-10 * game_.W_max[i]) << i << ' ' << l;
    }
  }
}

TEST_P(ClosedLoopOfRandomGame, WeightNormsAreThoseOfTheColumns) {
  std::vector<std::vector<int>> on_sphere;
  LoopState<Real> state = random_state(game_, random_, on_sphere);
  std::vector<Real> norm2(at(loop_.shape().actions()));
  loop_.weight_norms(state.flat().data(), norm2.data());
  for (std::size_t i = 0; i < game_.players; ++i) {
    for (std::size_t l = 0; l < game_.dimension; ++l) {
      Real expected = 0.0;
      for (std::size_t m = 0; m < game_.neurons; ++m) expected += std::pow(state.W[i][m][l], 2);
      EXPECT_NEAR(norm2[l * game_.players + i], expected, 1e-13 * expected);
    }
  }
}

TEST_P(ClosedLoopOfRandomGame, EventFunctionsBelongToTheirStateWhateverTheSignalsHeld) {
  if (!game_.robust) return;
  std::vector<std::vector<int>> on_sphere;
  LoopState<Real> state = random_state(game_, random_, on_sphere);
  on_sphere[0][0] = 1;
  const Modes modes = modes_of(on_sphere);
  LoopSignals<Real> expected;
  reference_rate(game_, 0.0, state, rows_of(game_.players, game_.dimension), on_sphere, &expected);
  const std::vector<Real> error = flat_actions(expected.error);
  const std::vector<Real> network = flat_actions(expected.network);
  std::vector<Real> norm2(modes.size());
  loop_.weight_norms(state.flat().data(), norm2.data());
  Signals signals(loop_.shape());  // of no state yet
  std::vector<Real> values(modes.size());
  constexpr Real tolerance = 1e-4;
  loop_.event_functions(state.flat().data(), nullptr, modes, tolerance, signals, values.data());
  for (std::size_t p = 0; p < modes.size(); ++p) {
    const Real height = norm2[p] / game_.W_max[p % game_.players] - 1.0;
    const Real falling = -2.0 * game_.beta[p % game_.players] * error[p] * network[p] / game_.W_max[p % game_.players];
    const Real value = modes[p] != 0 ? std::min(-tolerance - height, falling) : height;
    EXPECT_NEAR(values[p], value, 2e-12 * (1.0 + std::abs(value))) << "column " << p;
  }
}

INSTANTIATE_TEST_SUITE_P(Assorted, ClosedLoopOfRandomGame, ::testing::ValuesIn(assorted_recipes()),
                         [](const auto& instance) { return "seed" + std::to_string(instance.param.seed); });

// One player of each order on a line, one neuron, so that every number can be followed by hand.
class TwoScalarPlayers : public ::testing::Test {
 protected:
  static PlainGame plain() {
    PlainGame game = random_game({.seed = 77, .players = 2, .dimension = 1, .neurons = 1, .order = {1, 2}});
    game.W_max = testing::everyone(game, 4.0);
    return game;
  }
  PlainGame game_ = plain();
  ClosedLoop loop_{parse_game(toml_of(game_)).parameters};
  StateLayout layout_ = loop_.layout();
  Signals signals_{loop_.shape()};
};

TEST_F(TwoScalarPlayers, SignsOfTheLawsAreThePapers) {
  std::vector<Real> state(at(layout_.size()), 0.0);
  std::vector<Real> rate(state.size());
  const std::vector<Real> no_input(2, 0.0);
  const Modes inside(2, 0);
  const auto changed = [&](int number, Real by) {  // rate after a change of one state
    state[at(number)] += by;
    loop_.evaluate(0.0, state.data(), no_input.data(), inside, signals_, rate.data());
    state[at(number)] -= by;
    return rate;
  };
  const std::vector<Real> at_rest = changed(0, 0.0);
  const int x1 = 0, z1 = 2, v2 = 3, y11 = 4, y12 = 5, y21 = 6, w1 = 8, w2 = 9;
  // u_1 = -k1 e_1 - ...: a larger velocity of player 2 brakes it, a larger z_1 pulls x_1 up
  EXPECT_LT(changed(v2, 1.0)[at(v2)], at_rest[at(v2)]);
  EXPECT_GT(changed(z1, 1.0)[at(x1)], at_rest[at(x1)]);
  // z_1' = -k2 grad: strongly convex in its own action
  EXPECT_LT(changed(y11, 1.0)[at(z1)], at_rest[at(z1)]);
  // consensus: y_12 is drawn to xbar_2 = x_2, and y_21 to xbar_1 = z_1
  EXPECT_GT(changed(1, 1.0)[at(y12)], at_rest[at(y12)]);
  EXPECT_GT(changed(z1, 1.0)[at(y21)], at_rest[at(y21)]);
  EXPECT_EQ(changed(x1, 1.0)[at(y21)], at_rest[at(y21)]);
  // w' = beta S e; the weight acts against the error
  EXPECT_GT(changed(x1, 1.0)[at(w1)], at_rest[at(w1)]);
  EXPECT_LT(changed(w1, 1.0)[at(x1)], at_rest[at(x1)]);
  EXPECT_LT(changed(w2, 1.0)[at(v2)], at_rest[at(v2)]);
}

TEST_F(TwoScalarPlayers, ModesFollowTheNormAndTheDirection) {
  constexpr Real tolerance = 1e-3;
  const int x1 = 0, z1 = 2, w1 = 8;
  std::vector<Real> state(at(layout_.size()), 0.0);
  Modes modes(2, 0);
  // the only neuron's activation is positive, so that e w'S has the sign of e w
  const auto resolved = [&](Real norm2, Real e) {
    state[at(w1)] = std::sqrt(norm2);
    state[at(x1)] = state[at(z1)] + e;
    const Modes before = modes;
    const int changed = loop_.resolve_modes(state.data(), nullptr, tolerance, signals_, modes);
    EXPECT_EQ(changed, before != modes ? 1 : 0);
    return modes;
  };
  const Modes inside{0, 0};
  const Modes on_sphere{1, 0};
  EXPECT_EQ(resolved(3.9, 1.0), inside);
  EXPECT_EQ(resolved(4.0001, 1.0), on_sphere);
  EXPECT_EQ(resolved(3.9, 1e-9), on_sphere);  // pushed outward it stays, whatever the norm drifted to
  EXPECT_EQ(resolved(3.9, 0.0), on_sphere);
  EXPECT_EQ(resolved(4.0 * (1.0 - 0.9e-3), -1.0), on_sphere);  // on its way inward, but not yet by the tolerance
  EXPECT_EQ(resolved(4.0 * (1.0 - 1.1e-3), -1e-9), inside);
  EXPECT_EQ(resolved(4.0 * (1.0 - 1.1e-3), 1.0), inside);  // on its way back
  EXPECT_EQ(resolved(4.0001, -1.0), on_sphere);            // where its rates are those inside
}

TEST_F(TwoScalarPlayers, WithoutTheNetworkNoColumnReachesTheSphere) {
  loop_.parameters().strategy.robust = false;
  const std::vector<Real> state(at(layout_.size()), 10.0);
  Modes modes(2, 0);
  EXPECT_EQ(loop_.resolve_modes(state.data(), nullptr, 1e-6, signals_, modes), 0);
  EXPECT_EQ(modes, (Modes{0, 0}));
}

TEST(ProjectedState, LiesOnTheSphereOrInsideIt) {
  const PlainGame game = random_game({.seed = 78, .players = 2, .dimension = 3, .neurons = 4, .order = {1, 1}});
  const ClosedLoop loop(parse_game(toml_of(game)).parameters);
  RandomNumbers random(5);
  std::vector<std::vector<int>> on_sphere;
  LoopState<Real> before = random_state(game, random, on_sphere);
  const auto norm2 = [](const LoopState<Real>& state, std::size_t i, std::size_t l) {
    Real sum = 0.0;
    for (const auto& row : state.W[i]) sum += row[l] * row[l];
    return sum;
  };
  const Rows wanted = {{1.02, 1e4, 0.98}, {0.0, 0.3, 0.98}};  // of W_max
  on_sphere = {{1, 0, 1}, {1, 0, 1}};
  const Rows outward = {{-1.0, 1.0, 1.0}, {1.0, 1.0, -1.0}};
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t l = 0; l < 3; ++l) {
      const Real factor = std::sqrt(wanted[i][l] * game.W_max[i] / norm2(before, i, l));
      for (auto& row : before.W[i]) row[l] = std::fabs(factor * row[l]);  // so that w'S > 0
      before.x[i][l] = before.reference[i][l] + outward[i][l];
    }
  }
  std::vector<Real> state = before.flat();
  Signals signals(loop.shape());
  loop.project(modes_of(on_sphere), nullptr, signals, state.data());
  LoopState<Real> after(game);
  after.set_flat(state);
  EXPECT_EQ(after.x, before.x);
  EXPECT_EQ(after.reference, before.reference);
  EXPECT_EQ(after.y, before.y);
  // above the bound twice, drifted while it slides; at the origin, inside, on its way inward
  const Rows expected = {{1.0, 1.0, 1.0}, {0.0, 0.3, 0.98}};
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t l = 0; l < 3; ++l) {
      EXPECT_NEAR(norm2(after, i, l), expected[i][l] * game.W_max[i], 1e-14 * game.W_max[i]) << i << ' ' << l;
      const Real factor = wanted[i][l] > 0.0 ? std::sqrt(expected[i][l] / wanted[i][l]) : 1.0;
      for (std::size_t m = 0; m < 4; ++m) {
        EXPECT_NEAR(after.W[i][m][l], factor * before.W[i][m][l], 1e-14 * before.W[i][m][l]) << i << ' ' << l;
      }
    }
  }
}

TEST(ClosedLoop, InitialWeightsAreScaledOntoTheSphere) {
  PlainGame game = random_game({.seed = 51, .players = 3, .dimension = 2, .neurons = 4, .initial_weights = true});
  game.W_max = everyone(game, 7.0);
  for (std::size_t m = 0; m < 4; ++m) game.W0[1][m][1] = 0.5 * std::sqrt(7.0 * (1.0 + 9e-10));
  const ClosedLoop loop(parse_game(toml_of(game)).parameters);
  std::vector<Real> state(at(loop.layout().size())), norm2(6);
  loop.initial_state(state.data());
  loop.weight_norms(state.data(), norm2.data());
  EXPECT_NEAR(norm2[1 * 3 + 1], 7.0, 1e-14);
  EXPECT_EQ(state[at(loop.layout().weights_of(2) + 0)], game.W0[0][2][0]);
}

}  // namespace
}  // namespace mixed_order_game
