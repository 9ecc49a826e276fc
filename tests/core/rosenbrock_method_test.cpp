#include "integration/rosenbrock_method.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "larger.hpp"

namespace mixed_order_game {
namespace {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

/// Prothero and Robinson's problem beside a nonlinear oscillator that it drives: y_1' = -stiffness (y_1 - sin t) + cos
/// t with y_1 = sin t, and y_2' = y_3, y_3' = -sin y_2 + y_1.
class DrivenPendulum final : public RosenbrockSystem {
 public:
  explicit DrivenPendulum(Real stiffness, bool exact = true) : stiffness_(stiffness), exact_(exact) {}

  int rate(Real t, const Real* y, Real* rate) noexcept override {
    rate[0] = -stiffness_ * (y[0] - std::sin(t)) + std::cos(t);
    rate[1] = y[2];
    rate[2] = -std::sin(y[1]) + y[0];
    return 0;
  }
  void linearize(const Real* y) {
    J_(0, 0) = -stiffness_;
    J_(1, 2) = 1.0;
    if (exact_) {
      J_(2, 1) = -std::cos(y[1]);
      J_(2, 0) = 1.0;
    }
  }
  [[nodiscard]] Vector3 rate_by_time(Real t) const { return {stiffness_ * std::cos(t) - std::sin(t), 0.0, 0.0}; }
  int factor(Real gamma) noexcept override {
    factors_ = (Matrix3::Identity() - gamma * J_).partialPivLu();
    return 0;
  }
  int solve(Real* b) noexcept override {
    Eigen::Map<Vector3> rhs(b);
    rhs = factors_.solve(rhs).eval();
    return 0;
  }

 private:
  Real stiffness_;
  bool exact_;
  Matrix3 J_ = Matrix3::Zero();
  Eigen::PartialPivLU<Matrix3> factors_;
};

/// The state at 1 s from (0, 1, 0), by equal steps, and the largest estimate of an error.
std::pair<Vector3, Real> run(DrivenPendulum system, int steps) {
  RosenbrockMethod method(system, 3);
  const Vector3 weight = Vector3::Ones();
  Vector3 state(0.0, 1.0, 0.0);
  Vector3 rate;
  Vector3 next;
  Real largest = 0.0;
  for (int k = 0; k < steps; ++k) {
    const Real h = 1.0 / steps;
    Real error = 0.0;
    system.rate(k * h, state.data(), rate.data());
    system.linearize(state.data());
    const Vector3 rate_by_time = system.rate_by_time(k * h);
    EXPECT_EQ(
        method.step({k * h, state.data(), rate.data(), rate_by_time.data()}, h, weight.data(), next.data(), error), 0);
    largest = testing::larger(largest, error);
    state = next;
  }
  return {state, largest};
}

TEST(RosenbrockMethod, IsOfOrderFourWithAnEstimateOfOrderThree) {
  const Vector3 exact = run(DrivenPendulum(1.0), 256).first;
  EXPECT_NEAR(exact[0], std::sin(1.0), 1e-12);
  const auto [coarse, coarse_estimate] = run(DrivenPendulum(1.0), 4);
  const auto [fine, fine_estimate] = run(DrivenPendulum(1.0), 8);
  EXPECT_GT(std::log2((coarse - exact).norm() / (fine - exact).norm()), 3.8);
  EXPECT_GT(std::log2(coarse_estimate / fine_estimate), 3.8);  // of one step: one order more
  EXPECT_LT((fine - exact).norm(), 8 * fine_estimate);
}

/// Rates that are products of components, one for each rooted tree of up to four nodes: from 0 on, component k is
/// c_k t^n_k with n_k nodes. The time t is a component, too, or is given as such in factors where it stands alone.
class Trees final : public RosenbrockSystem {
 public:
  static constexpr int size = 8;

  explicit Trees(bool is_timed) : is_timed_(is_timed) {}

  static Vector exact() {
    Vector coefficients(size);
    for (int k = 0; k < size; ++k) {
      Real product = 1.0;
      for (const int factor : factors()[at(k)]) product *= coefficients[factor];
      coefficients[k] = product / nodes(k);
    }
    return coefficients;
  }
  static int nodes(int k) {
    int count = 1;
    for (const int factor : factors()[at(k)]) count += nodes(factor);
    return count;
  }

  int rate(Real t, const Real* y, Real* rate) noexcept override {
    for (int k = 0; k < size; ++k) {
      rate[k] = 1.0;
      for (const int factor : factors()[at(k)]) rate[k] *= is_time(k, factor) ? t : y[factor];
    }
    return 0;
  }
  /// The partial derivative of the rate at rest.
  [[nodiscard]] Vector rate_by_time() const {
    Vector along = Vector::Zero(size);
    for (int k = 0; k < size; ++k) along[k] = factors()[at(k)] == std::vector<int>{0} && is_timed_ ? 1.0 : 0.0;
    return along;
  }
  void linearize(Real t, const Real* y) {
    J_.setZero();
    for (int k = 0; k < size; ++k) {
      const std::vector<int>& all = factors()[at(k)];
      for (std::size_t i = 0; i < all.size(); ++i) {
        if (is_time(k, all[i])) continue;
        Real product = 1.0;
        for (std::size_t j = 0; j < all.size(); ++j) {
          if (j != i) product *= is_time(k, all[j]) ? t : y[all[j]];
        }
        J_(k, all[i]) += product;
      }
    }
  }
  int factor(Real gamma) noexcept override {
    factors_ = (Matrix::Identity(size, size) - gamma * J_).partialPivLu();
    return 0;
  }
  int solve(Real* b) noexcept override {
    Eigen::Map<Vector> rhs(b, size);
    rhs = factors_.solve(rhs).eval();
    return 0;
  }

 private:
  /// Of the tree's root: the trees that hang on it.
  static const std::vector<std::vector<int>>& factors() {
    static const std::vector<std::vector<int>> trees{{}, {0}, {0, 0}, {1}, {0, 0, 0}, {0, 1}, {2}, {3}};
    return trees;
  }
  [[nodiscard]] bool is_time(int k, int factor) const {
    const std::vector<int>& all = factors()[at(k)];
    return is_timed_ && factor == 0 && std::count(all.begin(), all.end(), 0) == 1;
  }

  bool is_timed_;
  Matrix J_ = Matrix::Zero(size, size);
  Eigen::PartialPivLU<Matrix> factors_;
};

TEST(RosenbrockMethod, MeetsEveryOrderConditionToTheLastDigits) {
  for (const bool is_timed : {false, true}) {
    Trees trees(is_timed);
    RosenbrockMethod method(trees, Trees::size);
    const Vector start = Vector::Zero(Trees::size);
    const Vector exact = Trees::exact();
    const Vector rate_by_time = trees.rate_by_time();
    Vector rate(Trees::size);
    Vector next(Trees::size);
    trees.rate(0.0, start.data(), rate.data());
    trees.linearize(0.0, start.data());
    for (int k = 0; k < Trees::size; ++k) {
      Vector weight = Vector::Zero(Trees::size);
      weight[k] = 1.0;
      Real estimate = 0.0;
      ASSERT_EQ(
          method.step({0.0, start.data(), rate.data(), rate_by_time.data()}, 1.0, weight.data(), next.data(), estimate),
          0);
      EXPECT_NEAR(next[k], exact[k], 1e-13) << "tree " << k << (is_timed ? ", by time" : "");
      if (Trees::nodes(k) < 4) {
        EXPECT_NEAR(estimate, 0.0, 1e-13) << "tree " << k << (is_timed ? ", by time" : "");
      }
    }
  }
}

TEST(RosenbrockMethod, EstimatesByTheRootMeanSquareOfTheLastStage) {
  /// Moves in the last stage alone.
  class Late final : public RosenbrockSystem {
   public:
    Real gamma = 0.0;
    int rate(Real /*t*/, const Real* /*y*/, Real* rate) noexcept override {
      const bool is_last = ++calls_ == RosenbrockMethod::evaluations;
      rate[0] = is_last ? 3.0 : 0.0;
      rate[1] = is_last ? -5.0 : 0.0;
      return 0;
    }
    int factor(Real gamma_of_step) noexcept override {
      gamma = gamma_of_step;
      return 0;
    }
    int solve(Real* /*b*/) noexcept override { return 0; }

   private:
    int calls_ = 0;
  } late;
  RosenbrockMethod method(late, 2);
  const std::array<Real, 2> state{1.0, 1.0};
  const std::array<Real, 2> rest{};
  const std::array<Real, 2> weight{2.0, 0.5};
  std::array<Real, 2> next{};
  Real error = 0.0;
  ASSERT_EQ(method.step({0.0, state.data(), rest.data(), rest.data()}, 0.1, weight.data(), next.data(), error), 0);
  EXPECT_DOUBLE_EQ(next[0], 1.0 + 3.0 * late.gamma);
  EXPECT_DOUBLE_EQ(next[1], 1.0 - 5.0 * late.gamma);
  EXPECT_DOUBLE_EQ(error, late.gamma * std::sqrt((6.0 * 6.0 + 2.5 * 2.5) / 2.0));
}

TEST(RosenbrockMethod, StepsOverWhatIsStiff) {
  const Vector3 exact = run(DrivenPendulum(1e6), 256).first;
  const Vector3 coarse = run(DrivenPendulum(1e6), 8).first;
  EXPECT_NEAR(coarse[0], std::sin(1.0), 1e-8);
  EXPECT_LT((coarse - exact).norm(), 1e-6);
}

TEST(RosenbrockMethod, SeesInItsEstimateWhatTheJacobianLacks) {
  const Vector3 exact = run(DrivenPendulum(1.0), 256).first;
  const auto [coarse, coarse_estimate] = run(DrivenPendulum(1.0, false), 8);
  const auto [fine, fine_estimate] = run(DrivenPendulum(1.0, false), 16);
  EXPECT_GT((coarse - exact).norm() / (fine - exact).norm(), 4.0);
  EXPECT_GT(coarse_estimate, 10 * run(DrivenPendulum(1.0), 8).second);
  EXPECT_LT((coarse - exact).norm(), 8 * coarse_estimate);
}

TEST(RosenbrockMethod, AsksForASmallerStepWhereARateIsNotFinite) {
  class Pole final : public RosenbrockSystem {
   public:
    int rate(Real t, const Real* /*y*/, Real* rate) noexcept override {
      rate[0] = t < 0.5 ? 0.0 : std::nan("");
      return 0;
    }
    int factor(Real /*gamma*/) noexcept override { return 0; }
    int solve(Real* /*b*/) noexcept override { return 0; }
  } pole;
  RosenbrockMethod method(pole, 1);
  const Real state = 1.0;
  const Real rate = 0.0;
  const Real weight = 1.0;
  Real next = 0.0;
  Real error = 0.0;
  EXPECT_EQ(method.step({0.0, &state, &rate, &rate}, 1.0, &weight, &next, error), 0);
  EXPECT_FALSE(std::isfinite(error));
  EXPECT_EQ(method.step({0.0, &state, &rate, &rate}, 0.25, &weight, &next, error), 0);
  EXPECT_EQ(error, 0.0);
}

}  // namespace
}  // namespace mixed_order_game
