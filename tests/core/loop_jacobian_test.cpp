#include "loop/loop_jacobian.hpp"

#include <gtest/gtest.h>

#include "families/quadratic_cost.hpp"
#include "game/game.hpp"
#include "loop_matrix.hpp"
#include "reference_loop.hpp"

namespace mixed_order_game {
namespace {

using testing::assorted_recipes;
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

/// A linearization of the loop beside the derivatives of the reference loop by the complex step.
class Linearized {
 public:
  Linearized(const PlainGame& game, const ClosedLoop& loop, LoopJacobian& jacobian, RandomNumbers& random)
      : game_(game), size_(at(loop.layout().size())), state_(random_state(game, random, on_sphere_)) {
    Modes modes;
    for (std::size_t l = 0; l < game.dimension; ++l) {
      for (std::size_t i = 0; i < game.players; ++i) modes.push_back(on_sphere_[i][l] != 0 ? 1 : 0);
    }
    Signals signals(loop.shape());
    std::vector<Real> rate(size_);
    const std::vector<Real> no_input(at(loop.shape().actions()), 0.0);
    const std::vector<Real> state = state_.flat();
    loop.evaluate(0.7, state.data(), no_input.data(), modes, signals, rate.data());
    jacobian.linearize(state.data(), loop.plants(state.data(), nullptr, signals), signals, modes);
  }

  /// Dense, row by row; the activations held.
  Rows expected() {
    constexpr Real h = 1e-30;
    Rows matrix = rows_of(size_, size_);
    const Rows no_input = rows_of(game_.players, game_.dimension);
    const std::vector<Real> flat = state_.flat();
    for (std::size_t column = 0; column < size_; ++column) {
      std::vector<std::complex<Real>> moved(flat.begin(), flat.end());
      moved[column] += std::complex<Real>(0.0, h);
      LoopState<std::complex<Real>> state(game_);
      state.set_flat(moved);
      const auto rate = reference_rate(game_, 0.7, state, no_input, on_sphere_,
                                       static_cast<testing::LoopSignals<std::complex<Real>>*>(nullptr), true)
                            .flat();
      for (std::size_t row = 0; row < size_; ++row) matrix[row][column] = rate[row].imag() / h;
    }
    return matrix;
  }

 private:
  PlainGame game_;
  std::size_t size_;
  std::vector<std::vector<int>> on_sphere_;
  LoopState<Real> state_;
};

Rows dense(const std::vector<MatrixEntry>& entries, std::size_t size) {
  Rows matrix = rows_of(size, size);
  for (const auto& [row, column, value] : entries) {
    EXPECT_EQ(matrix[at(row)][at(column)], 0.0) << "position " << row << ", " << column << " comes twice";
    matrix[at(row)][at(column)] = value;
  }
  return matrix;
}

void expect_close(const Rows& computed, const Rows& expected) {
  for (std::size_t row = 0; row < expected.size(); ++row) {
    Real largest = 0.0;
    for (const Real entry : expected[row]) largest = std::max(largest, std::abs(entry));
    for (std::size_t column = 0; column < expected.size(); ++column) {
      ASSERT_NEAR(computed[row][column], expected[row][column],
                  1e-11 * (std::abs(expected[row][column]) + 0.01 * largest))
          << "row " << row << ", column " << column;
    }
  }
}

class LoopJacobianOfRandomGame : public ::testing::TestWithParam<Recipe> {
 protected:
  PlainGame game_ = random_game(GetParam());
  ClosedLoop loop_{parse_game(toml_of(game_)).parameters};
  LoopJacobian jacobian_{loop_};
  RandomNumbers random_{2000 + GetParam().seed};
  std::size_t size_ = at(loop_.layout().size());
};

TEST_P(LoopJacobianOfRandomGame, EntriesAreTheDerivatives) {
  for (int repeat = 0; repeat < 2; ++repeat) {
    Linearized linearized(game_, loop_, jacobian_, random_);
    expect_close(dense(matrix_of(jacobian_), size_), linearized.expected());
  }
}

INSTANTIATE_TEST_SUITE_P(Assorted, LoopJacobianOfRandomGame, ::testing::ValuesIn(assorted_recipes()),
                         [](const auto& instance) { return "seed" + std::to_string(instance.param.seed); });

TEST(LoopJacobian, FollowsChangedParametersAfterRefresh) {
  PlainGame game = random_game({.seed = 40, .players = 3, .dimension = 2, .neurons = 5, .order = {2, 1, 2}});
  ClosedLoop loop(parse_game(toml_of(game)).parameters);
  LoopJacobian jacobian(loop);
  RandomNumbers random(9);
  game.k2[1] *= 2.0;
  game.coupling[0][1] = game.coupling[0][1] == 0.0 ? 0.7 : 0.0;
  game.adjacency[0][1] = game.adjacency[1][0] = game.adjacency[0][1] == 0.0 ? 1.3 : 0.2;
  loop.parameters().gains.k2 = game.k2;
  loop.parameters().cost->coefficients[QuadraticCost::coupling][0 * 3 + 1] = game.coupling[0][1];
  loop.parameters().graph.set_weight(0, 1, game.adjacency[0][1]);
  loop.refresh();
  jacobian.refresh();
  Linearized linearized(game, loop, jacobian, random);
  expect_close(dense(matrix_of(jacobian), at(loop.layout().size())), linearized.expected());
}

TEST(LoopJacobian, OfAnAmplitudeOfZeroHasNoRobustTerm) {
  PlainGame game = random_game({.seed = 41, .players = 2, .dimension = 3, .neurons = 4, .order = {2, 1}});
  game.delta = testing::everyone(game, 0.0);
  const ClosedLoop loop(parse_game(toml_of(game)).parameters);
  LoopJacobian jacobian(loop);
  RandomNumbers random(10);
  Linearized linearized(game, loop, jacobian, random);
  expect_close(dense(matrix_of(jacobian), at(loop.layout().size())), linearized.expected());
}

}  // namespace
}  // namespace mixed_order_game
