#include "families/quadratic_cost.hpp"

#include <gtest/gtest.h>

#include "random_game.hpp"
#include "reference_loop.hpp"

namespace mixed_order_game {
namespace {

using testing::PlainGame;
using testing::random_game;
using testing::RandomNumbers;
using testing::Rows;
using testing::rows_of;

constexpr int N = 4;
constexpr int D = 3;

QuadraticCost cost_of(const PlainGame& game) {
  QuadraticCost cost({.players = N, .dimension = D, .order = {}});
  for (int i = 0; i < N; ++i) {
    cost.coefficients[QuadraticCost::quadratic][at(i)] = game.quadratic[at(i)];
    cost.coefficients[QuadraticCost::constant][at(i)] = game.constant[at(i)];
    for (int l = 0; l < D; ++l) cost.coefficients[QuadraticCost::linear][at(l * N + i)] = game.linear[at(i)][at(l)];
    for (int j = 0; j < N; ++j) cost.coefficients[QuadraticCost::coupling][at(i * N + j)] = game.coupling[at(i)][at(j)];
  }
  cost.refresh();
  return cost;
}

class QuadraticCostOfRandomGame : public ::testing::Test {
 protected:
  QuadraticCostOfRandomGame() {
    RandomNumbers random(3);
    random.fill(x_, -3.0, 3.0);
    random.fill(points_, -3.0, 3.0);
  }
  PlainGame game_ = random_game({.seed = 20, .players = N, .dimension = D, .neurons = 1});
  QuadraticCost cost_ = cost_of(game_);
  std::vector<Real> x_ = std::vector<Real>(N * D);
  std::vector<Real> points_ = std::vector<Real>(N * N * D);  // one joint action for each player
};

TEST_F(QuadraticCostOfRandomGame, ValueIsTheFormula) {
  Rows x = rows_of(N, D);
  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t l = 0; l < D; ++l) x[i][l] = x_[l * N + i];
  }
  for (int i = 0; i < N; ++i) {
    const Real expected = testing::reference_cost(game_, at(i), x);
    EXPECT_NEAR(cost_.value(i, x_.data()), expected, 1e-13 * (1.0 + std::abs(expected)));
  }
}

TEST_F(QuadraticCostOfRandomGame, GradientIsTheDerivativeOfTheValue) {
  std::vector<Real> gradient(N * D);
  cost_.own_gradients(x_.data(), 0, gradient.data());
  constexpr Real h = 0.5;  // central differences of a quadratic function are exact
  for (int l = 0; l < D; ++l) {
    for (int i = 0; i < N; ++i) {
      const int p = l * N + i;
      std::vector<Real> above = x_;
      std::vector<Real> below = x_;
      above[at(p)] += h;
      below[at(p)] -= h;
      const Real slope = (cost_.value(i, above.data()) - cost_.value(i, below.data())) / (2.0 * h);
      EXPECT_NEAR(gradient[at(p)], slope, 1e-11) << "player " << i << ", coordinate " << l;
    }
  }
}

TEST_F(QuadraticCostOfRandomGame, EachPlayerSeesItsOwnPoint) {
  std::vector<Real> gradient(N * D);
  std::vector<Real> alone(N * D);
  cost_.own_gradients(points_.data(), N * D, gradient.data());
  for (int i = 0; i < N; ++i) {
    cost_.own_gradients(points_.data() + i * N * D, 0, alone.data());
    for (int l = 0; l < D; ++l) EXPECT_EQ(gradient[at(l * N + i)], alone[at(l * N + i)]);
  }
}

TEST_F(QuadraticCostOfRandomGame, HessianRowsAreTheDerivativesOfTheGradient) {
  const SparseRows& pattern = cost_.hessian_pattern();
  ASSERT_EQ(pattern.rows(), N * D);
  std::vector<Real> values(at(pattern.entries()));
  cost_.hessian_rows(x_.data(), 0, values.data());
  std::vector<Real> dense(N * D * N * D, 0.0);
  for (int row = 0; row < N * D; ++row) {
    for (int k = pattern.start[at(row)]; k < pattern.start[at(row + 1)]; ++k) {
      EXPECT_TRUE(k == pattern.start[at(row)] || pattern.column[at(k - 1)] < pattern.column[at(k)]);
      dense[at(row * N * D + pattern.column[at(k)])] = values[at(k)];
    }
  }
  constexpr Real h = 0.5;
  std::vector<Real> above(N * D);
  std::vector<Real> below(N * D);
  for (int column = 0; column < N * D; ++column) {
    std::vector<Real> x = x_;
    x[at(column)] += h;
    cost_.own_gradients(x.data(), 0, above.data());
    x[at(column)] -= 2.0 * h;
    cost_.own_gradients(x.data(), 0, below.data());
    for (int row = 0; row < N * D; ++row) {
      const Real slope = (above[at(row)] - below[at(row)]) / (2.0 * h);
      EXPECT_NEAR(dense[at(row * N * D + column)], slope, 1e-12) << row << ' ' << column;
    }
  }
}

TEST_F(QuadraticCostOfRandomGame, ACloneIsIndependent) {
  const std::unique_ptr<Cost> clone = cost_.clone();
  const Real before = cost_.value(1, x_.data());
  cost_.coefficients[QuadraticCost::constant][1] += 5.0;
  cost_.coefficients[QuadraticCost::coupling][1 * N + 0] += 1.0;
  cost_.refresh();
  EXPECT_EQ(clone->value(1, x_.data()), before);
  EXPECT_GT(cost_.value(1, x_.data()), before + 5.0);
}

TEST_F(QuadraticCostOfRandomGame, RefreshFollowsThePattern) {
  std::fill(cost_.coefficients[QuadraticCost::coupling].begin(), cost_.coefficients[QuadraticCost::coupling].end(),
            0.0);
  cost_.refresh();
  EXPECT_EQ(cost_.hessian_pattern().entries(), N * D);
  cost_.coefficients[QuadraticCost::coupling][2 * N + 3] = -0.5;  // players may also be repelled
  cost_.refresh();
  EXPECT_EQ(cost_.hessian_pattern().entries(), N * D + D);
}

}  // namespace
}  // namespace mixed_order_game
