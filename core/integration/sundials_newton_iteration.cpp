#include "integration/sundials_newton_iteration.hpp"

#include <cvode/cvode.h>

#include <algorithm>
#include <cmath>
#include <new>

#include "integration/sundials_handles.hpp"
#include "kernels/kernels.hpp"

namespace mixed_order_game {

namespace {

// The Jacobian is exact but for the coupling that the solver may leave out, so a fresh factorization contracts well.
constexpr Real rate_after_factorization = 0.1;

constexpr int most_careful_iterations = 20;

int rate_failure(int result) { return result < 0 ? CV_RHSFUNC_FAIL : SUN_NLS_CONV_RECVR; }

}  // namespace

NewtonIteration::NewtonIteration(NewtonSystem& system, int size, SUNContext context)
    : system_(system), delta_(at(size)), handle_(SUNNonlinSolNewEmpty(context)) {
  if (handle_ == nullptr) throw std::bad_alloc();
  using Handle = SUNNonlinearSolver;
  static constexpr auto self = [](Handle handle) { return static_cast<NewtonIteration*>(handle->content); };
  handle_->content = this;
  auto& operations = *handle_->ops;
  operations.gettype = [](Handle) { return SUNNONLINEARSOLVER_ROOTFIND; };
  operations.free = [](Handle) { return 0; };  // by the destructor
  operations.initialize = [](Handle) { return 0; };
  operations.solve = [](Handle handle, N_Vector, N_Vector correction, N_Vector weight, auto tolerance, auto factorize,
                        void* cvode) {
    return self(handle)->solve(correction, weight, tolerance, factorize != 0, cvode);
  };
  // residual, solve and convergence test are its own
  operations.setsysfn = [](Handle, SUNNonlinSolSysFn) { return 0; };
  operations.setlsolvefn = [](Handle, SUNNonlinSolLSolveFn) { return 0; };
  operations.setctestfn = [](Handle, SUNNonlinSolConvTestFn, void*) { return 0; };
  operations.setlsetupfn = [](Handle handle, SUNNonlinSolLSetupFn factor) {
    self(handle)->factor_ = factor;
    return 0;
  };
  operations.setmaxiters = [](Handle handle, int most) {
    self(handle)->most_iterations_ = most;
    return 0;
  };
  operations.getnumiters = [](Handle handle, long* iterations) {
    *iterations = self(handle)->last_iterations_;
    return 0;
  };
  operations.getnumconvfails = [](Handle handle, long* failures) {
    *failures = self(handle)->last_failures_;
    return 0;
  };
}

NewtonIteration::~NewtonIteration() { SUNNonlinSolFreeEmpty(handle_); }

void NewtonIteration::reset() {
  convergence_rate_ = 1.0;
  iterations_ = 0;
}

NewtonIteration::Step NewtonIteration::step_of(void* cvode) {
  Step step{};
  N_Vector predicted = nullptr;
  N_Vector iterate = nullptr;
  N_Vector rate = nullptr;
  N_Vector zn1 = nullptr;
  void* user_data = nullptr;
  CVodeGetNonlinearSystemData(cvode, &step.t, &predicted, &iterate, &rate, &step.gamma, &step.rl1, &zn1, &user_data);
  step.predicted = N_VGetArrayPointer(predicted);
  step.zn1 = N_VGetArrayPointer(zn1);
  step.y = N_VGetArrayPointer(iterate);
  step.f = N_VGetArrayPointer(rate);
  return step;
}

int NewtonIteration::solve(N_Vector correction, N_Vector weight, Real tolerance, bool factorize, void* cvode) {
  Real* c = N_VGetArrayPointer(correction);  // CVODE has set it to zero
  const Real* w = N_VGetArrayPointer(weight);
  const auto n = static_cast<std::int64_t>(delta_.size());
  last_iterations_ = last_failures_ = 0;
  step_ = step_of(cvode);
  std::copy_n(step_.predicted, n, step_.y);
  int result = iterate(c, w, tolerance, factorize ? Factorize::once : Factorize::never, cvode);
  if (result != SUN_NLS_CONV_RECVR) return result;
  ++last_failures_;
  std::copy_n(step_.predicted, n, step_.y);
  kernels().fill(n, 0.0, c);
  return iterate(c, w, tolerance, Factorize::always, cvode);
}

/// From the state y = predicted + correction.
int NewtonIteration::iterate(Real* correction, const Real* weight, Real tolerance, Factorize factorize, void* cvode) {
  const Kernels& kernel = kernels();
  const auto n = static_cast<std::int64_t>(delta_.size());
  const auto& [t, gamma, rl1, predicted, zn1, y, f] = step_;
  const bool carefully = factorize == Factorize::always;
  Real last_size = 0.0;
  // a rate that is not finite makes the size so
  for (int number = 0;; ++number) {
    if (const int result = system_.rate(t, y, f); result != 0) return rate_failure(result);
    if (carefully || (number == 0 && factorize == Factorize::once)) {
      SunBoolean current = 0;
      const int result = factor_(last_failures_ != 0 ? 1 : 0, &current, cvode);
      if (result != 0) return result;
      factored_gamma_ = gamma;
      convergence_rate_ = rate_after_factorization;
    }
    // solutions for another gamma than the factored one, brought closer
    const Real scale = gamma == factored_gamma_ ? 1.0 : 2.0 / (1.0 + gamma / factored_gamma_);
    ++iterations_;
    ++last_iterations_;
    kernel.newton_residual(n, gamma, f, rl1, zn1, correction, delta_.data());
    if (const int result = system_.solve(delta_.data()); result != 0) return result < 0 ? CV_LSOLVE_FAIL : result;
    const Real squares = kernel.weighted_square_sum(n, delta_.data(), weight);
    const Real size = scale * std::sqrt(squares / static_cast<Real>(n));
    kernel.add_correction(n, scale, delta_.data(), predicted, correction, y);
    if (number > 0) convergence_rate_ = std::max(0.3 * convergence_rate_, size / last_size);
    const bool stopped = carefully && system_.stop_correction(y);
    if (stopped) kernel.linear_sum(n, 1.0, y, -1.0, predicted, correction);
    const bool converged = !stopped && size * std::min(1.0, convergence_rate_) <= tolerance;
    if (converged && system_.linearization_holds(y, gamma, weight, tolerance)) return 0;
    const bool diverges = !carefully && number > 0 && size > 2.0 * last_size;
    const int most = carefully ? most_careful_iterations : most_iterations_;
    if (diverges || number + 1 == most || !std::isfinite(size)) return SUN_NLS_CONV_RECVR;
    last_size = size;
  }
}

}  // namespace mixed_order_game
