#include "loop/measures.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "game/game.hpp"
#include "reference_loop.hpp"

namespace mixed_order_game {
namespace {

using testing::flat_actions;
using testing::LoopState;
using testing::PlainGame;
using testing::random_game;

class Measures : public ::testing::Test {
 protected:
  Measures() {
    testing::RandomNumbers random(4);
    state_ = testing::random_state(game_, random, on_sphere_);
  }
  PlainGame game_ = random_game({.seed = 30, .players = 3, .dimension = 2, .neurons = 5, .order = {2, 1, 1}});
  ClosedLoop loop_{parse_game(testing::toml_of(game_)).parameters};
  std::vector<std::vector<int>> on_sphere_;
  LoopState<Real> state_{game_};
};

TEST_F(Measures, NashErrorIsTheDistance) {
  const std::vector<Real> x{1.0, 2.0, 3.0};
  const std::vector<Real> x_star{1.0, 5.0, -1.0};
  EXPECT_DOUBLE_EQ(nash_error(x.data(), x_star.data(), 3), 5.0);
}

TEST_F(Measures, ConsensusErrorComparesEstimatesWithSharedSignals) {
  Signals signals(loop_.shape());
  std::vector<Real> rate(at(loop_.layout().size()));
  const std::vector<Real> state = state_.flat();
  const std::vector<Real> no_input(6, 0.0);
  loop_.evaluate(0.0, state.data(), no_input.data(), Modes(6, 0), signals, rate.data());
  Real squares = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t l = 0; l < 2; ++l) {
        const Real shared = game_.order[j] == 1 ? state_.reference[j][l] : state_.x[j][l];
        squares += std::pow(state_.y[i][j][l] - shared, 2);
      }
    }
  }
  EXPECT_NEAR(consensus_error(loop_, state.data(), signals), std::sqrt(squares), 1e-13 * std::sqrt(squares));
}

TEST(NashError, MovesAlongADirection) {
  const Real x[] = {3.0, 4.0};
  const Real x_star[] = {0.0, 0.0};
  const Real x_along[] = {1.0, 0.5};
  const Real x_star_along[] = {-1.0, 0.0};
  EXPECT_NEAR(nash_error_along(x, x_star, x_along, x_star_along, 2), (3.0 * 2.0 + 4.0 * 0.5) / 5.0, 1e-15);
  EXPECT_EQ(nash_error_along(x, x, x_along, x_star_along, 2), 0.0) << "at the equilibrium";
}

TEST_F(Measures, GradientNormIsThatOfThePseudoGradientAtX) {
  Real squares = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t l = 0; l < 2; ++l) {
      testing::RowsOf<std::complex<Real>> x(3, std::vector<std::complex<Real>>(2));
      for (std::size_t j = 0; j < 3; ++j) {
        for (std::size_t h = 0; h < 2; ++h) x[j][h] = state_.x[j][h];
      }
      x[i][l] += std::complex<Real>(0.0, 1e-30);
      squares += std::pow(std::imag(testing::reference_cost(game_, i, x)) / 1e-30, 2);
    }
  }
  const Real expected = std::sqrt(squares);
  EXPECT_NEAR(gradient_norm(loop_, flat_actions(state_.x).data()), expected, 1e-13 * expected);
}

}  // namespace
}  // namespace mixed_order_game
