#include "integration/sundials_newton_iteration.hpp"

#include <cvode/cvode.h>
#include <gtest/gtest.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>

#include <Eigen/LU>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

namespace mixed_order_game {
namespace {

/// A small system that CVODE integrates with nothing but NewtonIteration for its implicit steps.
class Stepper final : public NewtonSystem {
 public:
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;

  Stepper(std::function<Vector(const Vector&)> rates, std::function<Matrix(const Vector&)> jacobian,
          const Vector& start, Real relative, const Vector& absolute)
      : rates_(std::move(rates)), jacobian_(std::move(jacobian)), size_(static_cast<int>(start.size())) {
    SUNContext_Create(nullptr, &context_);
    state_ = N_VNew_Serial(size_, context_);
    N_Vector tolerance = N_VNew_Serial(size_, context_);
    for (int k = 0; k < size_; ++k) NV_Ith_S(state_, k) = start[k];
    for (int k = 0; k < size_; ++k) NV_Ith_S(tolerance, k) = absolute[k];
    matrix_ = SUNMatNewEmpty(context_);
    matrix_->ops->getid = [](SUNMatrix) { return SUNMATRIX_CUSTOM; };
    solver_ = SUNLinSolNewEmpty(context_);
    solver_->ops->gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; };
    solver_->ops->solve = [](SUNLinearSolver, SUNMatrix, N_Vector, N_Vector, realtype) { return -1; };
    cvode_ = CVodeCreate(CV_BDF, context_);
    CVodeSetErrHandlerFn(cvode_, [](int, const char*, const char*, char*, void*) {}, nullptr);
    CVodeSetUserData(cvode_, this);
    CVodeInit(
        cvode_,
        [](realtype t, N_Vector y, N_Vector rate, void* self) {
          auto* stepper = static_cast<Stepper*>(self);
          return stepper->rate(t, NV_DATA_S(y), NV_DATA_S(rate));
        },
        0.0, state_);
    CVodeSVtolerances(cvode_, relative, tolerance);
    N_VDestroy(tolerance);
    CVodeSetLinearSolver(cvode_, solver_, matrix_);
    CVodeSetLinSysFn(cvode_, [](realtype, N_Vector y, N_Vector, SUNMatrix, booleantype, booleantype* current,
                                realtype gamma, void* self, N_Vector, N_Vector, N_Vector) {
      *current = SUNTRUE;
      static_cast<Stepper*>(self)->factor(NV_DATA_S(y), gamma);
      return 0;
    });
    iteration_ = std::make_unique<NewtonIteration>(*this, size_, context_);
    CVodeSetNonlinearSolver(cvode_, iteration_->handle());
    CVodeSetMaxNumSteps(cvode_, 100'000);
  }
  ~Stepper() {
    CVodeFree(&cvode_);
    iteration_.reset();
    SUNLinSolFreeEmpty(solver_);
    SUNMatFreeEmpty(matrix_);
    N_VDestroy(state_);
    SUNContext_Free(&context_);
  }
  Stepper(const Stepper&) = delete;
  Stepper& operator=(const Stepper&) = delete;

  int advance(Real t) { return CVode(cvode_, t, state_, &time_, CV_NORMAL); }
  /// Where a correction of an iteration that begins again, careful, is stopped: (its start, the state it led to).
  void set_stop(std::function<bool(const Vector&, Eigen::Map<Vector>&)> stop) { stop_ = std::move(stop); }
  [[nodiscard]] long steps() const {
    long steps = 0;
    CVodeGetNumSteps(cvode_, &steps);
    return steps;
  }

  [[nodiscard]] Real time() const { return time_; }
  [[nodiscard]] Real state(int k) const { return NV_Ith_S(state_, k); }
  [[nodiscard]] Real iterations_per_step() const {
    return static_cast<Real>(iteration_->iterations()) / static_cast<Real>(steps());
  }

 private:
  int rate(Real /*t*/, const Real* state, Real* rate) noexcept override {
    evaluated_ = Eigen::Map<const Vector>(state, size_);
    Eigen::Map<Vector>(rate, size_) = rates_(Eigen::Map<const Vector>(state, size_));
    return 0;
  }
  /// The correction that another iteration would make, with a Jacobian of its own.
  bool linearization_holds(const Real* state, Real gamma, const Real* weight, Real tolerance) noexcept override {
    const Eigen::Map<const Vector> y(state, size_);
    const Vector missed = gamma * (rates_(y) - rates_(evaluated_) - factored_ * (y - evaluated_));
    const Vector correction = (Matrix::Identity(size_, size_) - gamma * jacobian_(y)).partialPivLu().solve(missed);
    return correction.cwiseProduct(Eigen::Map<const Vector>(weight, size_)).norm() <= tolerance;
  }
  bool stop_correction(Real* state) noexcept override {
    Eigen::Map<Vector> y(state, size_);
    return stop_ != nullptr && stop_(evaluated_, y);
  }
  void factor(const Real* state, Real gamma) {
    factored_ = jacobian_(Eigen::Map<const Vector>(state, size_));
    factors_.compute(Matrix::Identity(size_, size_) - gamma * factored_);
  }
  int solve(Real* b) noexcept override {
    Eigen::Map<Vector> rhs(b, size_);
    rhs = factors_.solve(Vector(rhs));
    return 0;
  }

  std::function<Vector(const Vector&)> rates_;
  std::function<Matrix(const Vector&)> jacobian_;
  std::function<bool(const Vector&, Eigen::Map<Vector>&)> stop_;
  int size_;
  Real time_ = 0.0;
  Vector evaluated_;
  Matrix factored_;
  Eigen::PartialPivLU<Matrix> factors_;
  SUNContext context_ = nullptr;
  N_Vector state_ = nullptr;
  SUNMatrix matrix_ = nullptr;
  SUNLinearSolver solver_ = nullptr;
  void* cvode_ = nullptr;
  std::unique_ptr<NewtonIteration> iteration_;
};

TEST(NewtonIteration, IntegratesTheKineticsOfRobertson) {
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;
  Stepper stepper(
      [](const Vector& y) {
        const Real first = 0.04 * y[0];
        const Real second = 1e4 * y[1] * y[2];
        const Real third = 3e7 * y[1] * y[1];
        return Vector{{-first + second, first - second - third, third}};
      },
      [](const Vector& y) {
        return Matrix{
            {-0.04, 1e4 * y[2], 1e4 * y[1]}, {0.04, -1e4 * y[2] - 6e7 * y[1], -1e4 * y[1]}, {0.0, 6e7 * y[1], 0.0}};
      },
      Vector{{1.0, 0.0, 0.0}}, 1e-10, Vector{{1e-18, 1e-22, 1e-14}});
  // reference values of the initial value problem test set (Mazzia and Magherini)
  ASSERT_EQ(stepper.advance(1e11), CV_SUCCESS);
  EXPECT_NEAR(stepper.state(0) / 0.2083340149701255e-07, 1.0, 1e-5);
  EXPECT_NEAR(stepper.state(1) / 0.8333360770334713e-13, 1.0, 1e-5);
  EXPECT_NEAR(stepper.state(2), 0.9999999791665050, 1e-10);
  EXPECT_LT(stepper.iterations_per_step(), 1.5);
}

TEST(NewtonIteration, StopsWhereTheRatesAreNoLongerFinite) {
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;
  Stepper stepper(
      [](const Vector& y) { return Vector{{y[0] < 1.5 ? 1.0 + y[0] : std::numeric_limits<Real>::quiet_NaN(), -y[1]}}; },
      [](const Vector& /*y*/) { return Matrix{{1.0, 0.0}, {0.0, -1.0}}; }, Vector{{0.0, 1.0}}, 1e-8,
      Vector{{1e-10, 1e-10}});
  EXPECT_LT(stepper.advance(3.0), 0);
  // y_0 = exp(t) - 1 reaches 1.5 at log(2.5)
  EXPECT_NEAR(stepper.time(), std::log(2.5), 1e-6);
  EXPECT_NEAR(stepper.state(1), 0.4, 1e-6);
}

// y_0' = (1 + cos y_1) / 4 - tanh(y_0 / width) reaches y_0 = 0 and slides there.
TEST(NewtonIteration, BeginsAgainWithCorrectionsThatTheSystemStops) {
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;
  constexpr Real width = 1e-11;
  const auto slide = [](Real y1) { return (1.0 + std::cos(y1)) / 4.0; };
  Stepper stepper([&](const Vector& y) { return Vector{{slide(y[1]) - std::tanh(y[0] / width), 1.0}}; },
                  [&](const Vector& y) {
                    const Real tanh = std::tanh(y[0] / width);
                    return Matrix{{-(1.0 - tanh * tanh) / width, -std::sin(y[1]) / 4.0}, {0.0, 0.0}};
                  },
                  Vector{{1.0, 0.0}}, 1e-6, Vector{{1e-8, 1e-8}});
  int stops = 0;
  stepper.set_stop([&](const Vector& from, Eigen::Map<Vector>& to) {
    if (!(from[0] * to[0] < 0.0 && std::fabs(to[0] - from[0]) > width)) return false;
    to[0] = 0.0;
    ++stops;
    return true;
  });
  ASSERT_EQ(stepper.advance(10.0), CV_SUCCESS);
  EXPECT_NEAR(stepper.state(0), 0.0, 1e-8);
  EXPECT_NEAR(stepper.state(1), 10.0, 1e-4);
  EXPECT_GT(stops, 0);
  EXPECT_LT(stepper.steps(), 300);
}

}  // namespace
}  // namespace mixed_order_game
