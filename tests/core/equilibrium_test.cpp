#include "equilibrium/equilibrium.hpp"

#include <gtest/gtest.h>
#include <pthread.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include "errors.hpp"
#include "families/quadratic_cost.hpp"
#include "game/game.hpp"
#include "random_game.hpp"

namespace mixed_order_game {
namespace {

using testing::assorted_recipes;
using testing::random_game;
using testing::toml_of;

TEST(NashEquilibrium, OfTheFiveVehiclesIsMinusOneHalf) {
  std::ifstream file(MIXED_ORDER_GAME_SOURCE_DIR "/modelDescription/games/five_vehicles.toml");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const Parameters parameters = parse_game(text).parameters;
  const std::vector<Real> x_star = nash_equilibrium(*parameters.cost, parameters.shape);
  ASSERT_EQ(x_star.size(), 10U);
  for (const Real x : x_star) EXPECT_NEAR(x, -0.5, 1e-15);
}

TEST(NashEquilibrium, MakesEveryGradientVanish) {
  for (const auto& recipe : assorted_recipes()) {
    const Parameters parameters = parse_game(toml_of(random_game(recipe))).parameters;
    const std::vector<Real> x_star = nash_equilibrium(*parameters.cost, parameters.shape);
    std::vector<Real> gradient(x_star.size());
    parameters.cost->own_gradients(x_star.data(), 0, gradient.data());
    for (const Real g : gradient) EXPECT_NEAR(g, 0.0, 1e-13) << "seed " << recipe.seed;
  }
}

TEST(NashEquilibrium, OfTwoPlayersByHand) {
  // f_1 = x_1^2 + 3 (x_1 - x_2)^2 - 8 x_1, f_2 = 2 x_2^2 - 4 x_2: x_2 = 1 and 8 x_1 = 6 x_2 + 8
  QuadraticCost cost({.players = 2, .dimension = 1, .order = {}});
  cost.coefficients[QuadraticCost::quadratic] = {1.0, 2.0};
  cost.coefficients[QuadraticCost::linear] = {-8.0, -4.0};
  cost.coefficients[QuadraticCost::coupling] = {0.0, 3.0, 0.0, 0.0};
  cost.refresh();
  const Shape shape{.players = 2, .dimension = 1, .neurons = 1, .order = {1, 2}};
  const std::vector<Real> x_star = nash_equilibrium(cost, shape);
  EXPECT_NEAR(x_star[0], 1.75, 1e-15);
  EXPECT_NEAR(x_star[1], 1.0, 1e-15);
}

TEST(NashEquilibrium, IsRefusedWhereItIsNotUnique) {
  // both players only wish to meet, wherever
  QuadraticCost cost({.players = 2, .dimension = 1, .order = {}});
  cost.coefficients[QuadraticCost::coupling] = {0.0, 1.0, 1.0, 0.0};
  cost.refresh();
  const Shape shape{.players = 2, .dimension = 1, .neurons = 1, .order = {1, 1}};
  EXPECT_THROW(nash_equilibrium(cost, shape), GameError);
  cost.coefficients[QuadraticCost::quadratic] = {0.0, 1e-6};  // one of them now has a preference
  cost.refresh();
  EXPECT_NO_THROW(nash_equilibrium(cost, shape));
}

TEST(NashEquilibrium, IsRefusedWhereAPlayerCouldLowerItsCost) {
  const Shape shape{.players = 2, .dimension = 1, .neurons = 1, .order = {1, 1}};
  QuadraticCost cost({.players = 2, .dimension = 1, .order = {}});
  cost.coefficients[QuadraticCost::quadratic] = {0.3, 0.3};
  cost.coefficients[QuadraticCost::linear] = {1.0, 0.0};
  cost.coefficients[QuadraticCost::coupling] = {0.0, 2.0, -2.0, 0.0};
  cost.refresh();
  try {
    nash_equilibrium(cost, shape);
    FAIL() << "player 2's cost is concave in x_2";
  } catch (const GameError& error) {
    EXPECT_EQ(std::string(error.what()).find("player[2].cost is concave"), 0U) << error.what();
  }
  // f_1 = -2 x_1 x_2 + x_2^2 and f_2 = 2 x_1 x_2 - x_1^2, linear in the own action, have an equilibrium at 0
  cost.coefficients[QuadraticCost::quadratic] = {-1.0, 1.0};
  cost.coefficients[QuadraticCost::linear] = {0.0, 0.0};
  cost.coefficients[QuadraticCost::coupling] = {0.0, 1.0, -1.0, 0.0};
  cost.refresh();
  EXPECT_EQ(nash_equilibrium(cost, shape), std::vector<Real>(2, 0.0));
  // 0.1 + 0.2 - 0.3 is no curvature, and neither is its rounding error in either direction
  for (const Real sign : {1.0, -1.0}) {
    const Shape three{.players = 3, .dimension = 1, .neurons = 1, .order = {1, 1, 1}};
    QuadraticCost flat({.players = 3, .dimension = 1, .order = {}});
    flat.coefficients[QuadraticCost::quadratic] = {-0.3 * sign, 1.0, 1.0};
    flat.coefficients[QuadraticCost::coupling] = {0.0, 0.1 * sign,  0.2 * sign, -0.2 * sign, 0.0,
                                                  0.0, -0.2 * sign, 0.0,        0.0};
    flat.refresh();
    EXPECT_NO_THROW(nash_equilibrium(flat, three));
  }
  // however small the costs are
  cost.coefficients[QuadraticCost::quadratic] = {1.0, -1e-9};
  cost.coefficients[QuadraticCost::coupling] = {0.0, 1.0, 0.0, 0.0};
  cost.refresh();
  EXPECT_THROW(nash_equilibrium(cost, shape), GameError);
}

TEST(NashEquilibrium, OfRowsOfDifferentSizeIsThatOfEqualOnes) {
  const Shape shape{.players = 2, .dimension = 1, .neurons = 1, .order = {1, 1}};
  QuadraticCost cost({.players = 2, .dimension = 1, .order = {}});
  cost.coefficients[QuadraticCost::quadratic] = {1e-7, 1e7};
  cost.coefficients[QuadraticCost::linear] = {1e-7, 1e7};
  cost.coefficients[QuadraticCost::coupling] = {0.0, 1e-7, 1e7, 0.0};
  cost.refresh();
  for (const Real x : nash_equilibrium(cost, shape)) EXPECT_NEAR(x, -0.5, 1e-15);
}

/// Costs of players on a line without coefficients, of which only gradients and their derivatives are asked for.
class GradientsOnly : public Cost {
 public:
  explicit GradientsOnly(int players) : Cost(Coefficients({}, players, 1)) {}
  [[nodiscard]] Real value(int /*i*/, const Real* /*x*/) const override { return 0.0; }
  using Cost::own_gradients;
  void own_gradients(const CoefficientsAs<Dual>& /*none*/, const Dual* /*points*/, int /*stride*/, Dual* /*gradient*/,
                     const Real* /*held*/ = nullptr) const override {}
  void own_gradients(const CoefficientsAs<Dependencies>& /*none*/, const Dependencies* /*points*/, int /*stride*/,
                     Dependencies* /*gradient*/) const override {}
  void refresh() override {}
  [[nodiscard]] bool is_affine() const override { return false; }
};

/// Gradients J x + l, for any J.
class AffineGradients final : public GradientsOnly {
 public:
  explicit AffineGradients(int players) : GradientsOnly(players), players_(players) {
    for (int i = 0; i < players; ++i) {
      for (int j = 0; j < players; ++j) pattern_.column.push_back(j);
      pattern_.start.push_back(pattern_.entries());
    }
  }
  std::vector<Real> jacobian;
  std::vector<Real> linear;

  [[nodiscard]] std::unique_ptr<Cost> clone() const override { return std::make_unique<AffineGradients>(*this); }
  using GradientsOnly::own_gradients;
  void own_gradients(const Real* points, int stride, Real* gradient, const Real* /*held*/ = nullptr) const override {
    for (int i = 0; i < players_; ++i) {
      gradient[i] = linear[at(i)];
      for (int j = 0; j < players_; ++j) gradient[i] += jacobian[at(i * players_ + j)] * points[i * stride + j];
    }
  }
  [[nodiscard]] const SparseRows& hessian_pattern() const override { return pattern_; }
  void hessian_rows(const Real* /*points*/, int /*stride*/, Real* values,
                    const Real* /*held*/ = nullptr) const override {
    std::copy(jacobian.begin(), jacobian.end(), values);
  }

 private:
  int players_;
  SparseRows pattern_;
};

// J = D_1 A D_2 and l = -D_1 A (1, 1, 1)': x* = D_2^-1 (1, 1, 1)' however D_1 and D_2 are chosen
TEST(NashEquilibrium, IsJudgedWhateverTheUnitsOfRowsAndColumns) {
  const Shape shape{.players = 3, .dimension = 1, .neurons = 1, .order = {1, 1, 1}};
  const std::vector<Real> regular[] = {{2.0, -1.0, 0.5, 0.3, 1.5, -0.7, 1.0, 0.2, 3.0},
                                       {1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0},
                                       {0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0}};
  const std::vector<Real> singular = {2.0, -1.0, 1.0, -1.0, 2.0, 1.0, 1.0, 1.0, 2.0};
  testing::RandomNumbers random(3);
  std::vector<Real> exponent(6);
  AffineGradients cost(3);
  for (int repeat = 0; repeat < 20; ++repeat) {
    random.fill(exponent, -14.0, 14.0);
    const auto scaled = [&](const std::vector<Real>& A) {
      cost.jacobian = A;
      cost.linear.assign(3, 0.0);
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          cost.jacobian[at(3 * i + j)] *= std::pow(10.0, exponent[at(i)] + exponent[at(3 + j)]);
          cost.linear[at(i)] -= A[at(3 * i + j)] * std::pow(10.0, exponent[at(i)]);
        }
      }
    };
    for (const std::vector<Real>& A : regular) {
      scaled(A);
      const std::vector<Real> x_star = nash_equilibrium(cost, shape);
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(x_star[at(j)] * std::pow(10.0, exponent[at(3 + j)]), 1.0, 1e-12);
    }
    scaled(singular);
    EXPECT_THROW(nash_equilibrium(cost, shape), GameError);
  }
}

/// f_1' = exp(x_1), which vanishes nowhere, and f_2' = x_2.
class RunawayCost final : public GradientsOnly {
 public:
  RunawayCost() : GradientsOnly(2) {}
  [[nodiscard]] std::unique_ptr<Cost> clone() const override { return std::make_unique<RunawayCost>(*this); }
  using GradientsOnly::own_gradients;
  void own_gradients(const Real* points, int stride, Real* gradient, const Real* /*held*/ = nullptr) const override {
    gradient[0] = std::exp(points[0]);
    gradient[1] = points[stride + 1];
  }
  [[nodiscard]] const SparseRows& hessian_pattern() const override { return pattern_; }
  void hessian_rows(const Real* points, int /*stride*/, Real* values, const Real* /*held*/ = nullptr) const override {
    values[0] = std::exp(points[0]);
    values[1] = 1.0;
  }

 private:
  SparseRows pattern_{.start = {0, 1, 2}, .column = {0, 1}};
};

TEST(NashEquilibrium, IsRefusedWhereTheStepsDoNotConverge) {
  const Shape shape{.players = 2, .dimension = 1, .neurons = 1, .order = {1, 1}};
  try {
    nash_equilibrium(RunawayCost(), shape);
    FAIL() << "it does not converge";
  } catch (const GameError& error) {
    EXPECT_NE(std::string(error.what()).find("did not converge in 50 Newton steps"), std::string::npos) << error.what();
  }
}

// f_1 and f_2 nearly only wish to meet: x* is right to what the rounding of its coefficients leaves
TEST(NashEquilibrium, ThatIsIllConditionedConverges) {
  const Shape shape{.players = 2, .dimension = 1, .neurons = 1, .order = {1, 1}};
  for (const Real weak : {1e-6, 1e-9, 1e-12}) {
    QuadraticCost cost({.players = 2, .dimension = 1, .order = {}});
    cost.coefficients[QuadraticCost::quadratic] = {weak, 0.0};
    cost.coefficients[QuadraticCost::linear] = {-6.0 * weak, 0.0};
    cost.coefficients[QuadraticCost::coupling] = {0.0, 0.7, 0.3, 0.0};
    cost.refresh();
    for (const Real x : nash_equilibrium(cost, shape)) EXPECT_NEAR(x, 3.0, 1e-15 / weak);
  }
}

/// f_1 = exp(x_1 - 1) - x_1 + x_1 x_2 and f_2 = cosh(x_2) - x_1 x_2, which are not quadratic.
class ExponentialCost final : public GradientsOnly {
 public:
  ExponentialCost() : GradientsOnly(2) {}
  [[nodiscard]] std::unique_ptr<Cost> clone() const override { return std::make_unique<ExponentialCost>(*this); }
  using GradientsOnly::own_gradients;
  void own_gradients(const Real* points, int stride, Real* gradient, const Real* /*held*/ = nullptr) const override {
    gradient[0] = std::exp(points[0] - 1.0) - 1.0 + points[1];
    gradient[1] = std::sinh(points[stride + 1]) - points[stride];
  }
  [[nodiscard]] const SparseRows& hessian_pattern() const override { return pattern_; }
  void hessian_rows(const Real* points, int stride, Real* values, const Real* /*held*/ = nullptr) const override {
    values[0] = std::exp(points[0] - 1.0);
    values[1] = 1.0;
    values[2] = -1.0;
    values[3] = std::cosh(points[stride + 1]);
  }

 private:
  SparseRows pattern_{.start = {0, 2, 4}, .column = {0, 1, 0, 1}};
};

/// f_1' = x_1^3 - 2 x_1 + 2, at which Newton's method with whole steps goes from 0 to 1 and back for ever, f_2' = x_2.
class CyclingCost final : public GradientsOnly {
 public:
  CyclingCost() : GradientsOnly(2) {}
  [[nodiscard]] std::unique_ptr<Cost> clone() const override { return std::make_unique<CyclingCost>(*this); }
  using GradientsOnly::own_gradients;
  void own_gradients(const Real* points, int stride, Real* gradient, const Real* /*held*/ = nullptr) const override {
    gradient[0] = points[0] * points[0] * points[0] - 2.0 * points[0] + 2.0;
    gradient[1] = points[stride + 1];
  }
  [[nodiscard]] const SparseRows& hessian_pattern() const override { return pattern_; }
  void hessian_rows(const Real* points, int /*stride*/, Real* values, const Real* /*held*/ = nullptr) const override {
    values[0] = 3.0 * points[0] * points[0] - 2.0;
    values[1] = 1.0;
  }

 private:
  SparseRows pattern_{.start = {0, 1, 2}, .column = {0, 1}};
};

TEST(NashEquilibrium, IsFoundFromOtherStarts) {
  const Shape shape{.players = 2, .dimension = 1, .neurons = 1, .order = {1, 1}};
  EXPECT_NEAR(nash_equilibrium(CyclingCost(), shape)[0], -1.7692923542386314, 1e-14);
}

TEST(NashEquilibrium, OfOtherCostsTakesNewtonSteps) {
  const ExponentialCost cost;
  const Shape shape{.players = 2, .dimension = 1, .neurons = 1, .order = {1, 1}};
  const std::vector<Real> x_star = nash_equilibrium(cost, shape);
  Real gradient[2];
  cost.own_gradients(x_star.data(), 0, gradient);
  EXPECT_NEAR(gradient[0], 0.0, 1e-14);
  EXPECT_NEAR(gradient[1], 0.0, 1e-14);
  EXPECT_GT(std::abs(x_star[0]), 0.1);
}

TEST(NashEquilibrium, MovesWithTheCosts) {
  constexpr Real h = 1e-4;
  testing::RandomNumbers random(7);
  for (const auto& recipe : assorted_recipes()) {
    const Parameters parameters = parse_game(toml_of(random_game(recipe))).parameters;
    const auto& cost = static_cast<const QuadraticCost&>(*parameters.cost);
    QuadraticCost direction(parameters.shape);
    random.fill(direction.coefficients[QuadraticCost::quadratic], -1.0, 1.0);
    random.fill(direction.coefficients[QuadraticCost::linear], -1.0, 1.0);
    random.fill(direction.coefficients[QuadraticCost::coupling], -1.0, 1.0);
    for (int i = 0; i < parameters.shape.players; ++i) {
      direction.coefficients[QuadraticCost::coupling][at(i) * at(parameters.shape.players) + at(i)] = 0.0;
    }
    direction.refresh();
    const auto moved = [&](Real s) {
      QuadraticCost other = cost;
      for (const int number : {QuadraticCost::quadratic, QuadraticCost::linear, QuadraticCost::coupling}) {
        std::vector<Real>& values = other.coefficients[number];
        for (std::size_t k = 0; k < values.size(); ++k) values[k] += s * direction.coefficients[number][k];
      }
      other.refresh();
      return nash_equilibrium(other, parameters.shape);
    };
    const std::vector<Real> forward = moved(h);
    const std::vector<Real> backward = moved(-h);
    const std::vector<Real> x_star = nash_equilibrium(cost, parameters.shape);
    const std::vector<Real> along = nash_equilibrium_along(cost, direction, parameters.shape, x_star.data());
    for (std::size_t p = 0; p < along.size(); ++p) {
      EXPECT_NEAR(along[p], (forward[p] - backward[p]) / (2.0 * h), 1e-7) << "seed " << recipe.seed;
    }
  }
}

// Player 3 follows 2, 2 follows 1, and 1 follows nobody: what is downstream cannot be felt, not even by rounding.
TEST(NashEquilibrium, OfAPlayerThatFollowsNobodyStandsStill) {
  QuadraticCost cost({.players = 3, .dimension = 1, .order = {}});
  cost.coefficients[QuadraticCost::quadratic] = {0.3, 0.7, 0.1};
  cost.coefficients[QuadraticCost::linear] = {1.0, -2.0, 0.5};
  cost.coefficients[QuadraticCost::coupling] = {0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 7.0, 0.0};
  cost.refresh();
  const Shape shape{.players = 3, .dimension = 1, .neurons = 1, .order = {1, 1, 1}};
  const std::vector<Real> x_star = nash_equilibrium(cost, shape);
  EXPECT_DOUBLE_EQ(x_star[0], -1.0 / 0.6);
  QuadraticCost direction({.players = 3, .dimension = 1, .order = {}});
  direction.coefficients[QuadraticCost::linear] = {0.0, 0.9, 0.8};
  direction.refresh();
  const std::vector<Real> along = nash_equilibrium_along(cost, direction, shape, x_star.data());
  EXPECT_EQ(along[0], 0.0);
  EXPECT_NEAR(along[1], -0.9 / (2.0 * 9.7), 1e-15);
  EXPECT_NEAR(along[2], (-0.8 + 14.0 * along[1]) / (2.0 * 7.1), 1e-15);
}

// x_i follows x_{i+1}, the last player stands at 1 / 2: a host's threads can have little stack.
TEST(NashEquilibrium, OfALongChainNeedsLittleStack) {
  constexpr int players = 2000;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  constexpr std::size_t stack = 1024 * 1024;  // the sanitizers' frames are larger
#else
  constexpr std::size_t stack = 64 * 1024;
#endif
  QuadraticCost cost({.players = players, .dimension = 1, .order = {}});
  cost.coefficients[QuadraticCost::quadratic].assign(players, 1.0);
  for (int i = 0; i + 1 < players; ++i) cost.coefficients[QuadraticCost::coupling][at(i * players + i + 1)] = 1e-3;
  cost.coefficients[QuadraticCost::linear].back() = -1.0;
  cost.refresh();
  struct Task {
    const QuadraticCost& cost;
    Shape shape{.players = players, .dimension = 1, .neurons = 1, .order = std::vector<int>(players, 1)};
    std::vector<Real> x_star;
  } task{.cost = cost, .x_star = {}};
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, stack);
  pthread_t thread{};
  const auto work = [](void* argument) -> void* {
    auto& given = *static_cast<Task*>(argument);
    given.x_star = nash_equilibrium(given.cost, given.shape);
    return nullptr;
  };
  ASSERT_EQ(pthread_create(&thread, &attributes, work, &task), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&attributes);
  ASSERT_EQ(task.x_star.size(), at(players));
  EXPECT_EQ(task.x_star.back(), 0.5);
  EXPECT_NEAR(task.x_star[at(players - 2)], 0.5e-3 / 1.001, 1e-15);
}

TEST(StrongMonotonicity, IsTheSmallestEigenvalueOfTheSymmetricPart) {
  // P' = [[2 q_1 + 2 c_12, -2 c_12], [-2 c_21, 2 q_2 + 2 c_21]] with q = (1, 2), c_12 = 3, c_21 = 0
  QuadraticCost cost({.players = 2, .dimension = 1, .order = {}});
  cost.coefficients[QuadraticCost::quadratic] = {1.0, 2.0};
  cost.coefficients[QuadraticCost::coupling] = {0.0, 3.0, 0.0, 0.0};
  cost.refresh();
  const Shape shape{.players = 2, .dimension = 1, .neurons = 1, .order = {1, 2}};
  // symmetric part [[8, -3], [-3, 4]]: eigenvalues 6 -+ sqrt(13)
  EXPECT_NEAR(strong_monotonicity(cost, {0.0, 0.0}), 6.0 - std::sqrt(13.0), 1e-14);
}

TEST(StrongMonotonicity, BoundsTheGrowthOfThePseudoGradient) {
  testing::RandomNumbers random(6);
  for (const auto& recipe : assorted_recipes()) {
    const Parameters parameters = parse_game(toml_of(random_game(recipe))).parameters;
    const std::size_t n = at(parameters.shape.actions());
    const Real m = strong_monotonicity(*parameters.cost, std::vector<Real>(n));
    std::vector<Real> x(n), z(n), at_x(n), at_z(n);
    for (int repeat = 0; repeat < 20; ++repeat) {
      random.fill(x, -3.0, 3.0);
      random.fill(z, -3.0, 3.0);
      parameters.cost->own_gradients(x.data(), 0, at_x.data());
      parameters.cost->own_gradients(z.data(), 0, at_z.data());
      Real growth = 0.0;
      Real distance2 = 0.0;
      for (std::size_t p = 0; p < n; ++p) {
        growth += (x[p] - z[p]) * (at_x[p] - at_z[p]);
        distance2 += (x[p] - z[p]) * (x[p] - z[p]);
      }
      EXPECT_GE(growth, m * distance2 - 1e-10) << "seed " << recipe.seed;
    }
  }
}

}  // namespace
}  // namespace mixed_order_game
