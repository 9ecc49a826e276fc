#include "integration/integrator.hpp"

#include <cvode/cvode.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <functional>
#include <string>
#include <utility>

#include "errors.hpp"
#include "integration/rosenbrock_method.hpp"
#include "integration/sundials_handles.hpp"
#include "integration/sundials_newton_iteration.hpp"
#include "kernels/kernels.hpp"
#include "loop/failure.hpp"
#include "loop/located_conditions.hpp"
#include "newton/robust_layer.hpp"

namespace mixed_order_game {

namespace {

struct FreeCvode {
  void operator()(void* memory) const { CVodeFree(&memory); }
};
using Cvode = std::unique_ptr<void, FreeCvode>;

// A change as few steps after the last restart as this is followed by Rosenbrock steps. For 20 ms after a change CVODE
// takes up to about 30 steps.
constexpr std::int64_t steps_of_a_start = 40;
// Past these steps CVODE goes on. Its start costs no more than 16 of them, of six evaluations each, but leaves errors
// of hundreds of tolerances, they some ten: in random games with changes every 20 ms at relative tolerances from 1e-3
// to 1e-7.
constexpr int most_rosenbrock_steps = 64;
// Where the tolerance is tighter, it needs more.
constexpr Real least_tolerance_of_rosenbrock = 1e-8;
// The estimate belongs to the solution of order 3, and the one of order 4 is taken. With this factor its errors at a
// relative tolerance of 1e-6 are no larger than those of CVODE: in the paper's game with disturbances that change every
// 1 to 20 ms, coupled player by player, with a plant outside and where conditions switch.
constexpr Real estimate_over_error = 5.0;

}  // namespace

class Integrator::Implementation final : NewtonSystem, RosenbrockSystem {
 public:
  Implementation(const ClosedLoop& loop, const Inputs& inputs, std::unique_ptr<NewtonSolver> newton);

  void start(Real t, Tolerances tolerances, const JudgingRule& rule);
  void set_equilibrium(std::span<const Real> x_star) { judge_.set_equilibrium(x_star); }
  void set_follower(StepFollower* follower) { follower_ = follower; }
  void prepare_change();
  void restart(bool parameters_changed);
  void advance(Real t_end);
  bool restore(const Checkpoint& checkpoint, Tolerances tolerances);
  [[nodiscard]] Checkpoint checkpoint();
  [[nodiscard]] Judgement judgement();
  void begin_errors_anew(Real from);
  [[nodiscard]] Statistics statistics() const;

  [[nodiscard]] Real time() const { return time_; }
  [[nodiscard]] const Real* state() const { return state_.data(); }
  [[nodiscard]] const Modes& modes() const { return modes_; }
  [[nodiscard]] Real largest_raw_excess() const { return largest_raw_excess_; }

 private:
  void begin_at_restart_point();
  void begin_cvode();
  void plan_event(Real t);
  void follow_change(Real t_end);
  void linearize_at_restart_point(Real t, Real step);
  void take_step();
  bool handle_event();
  void present(Real t);
  void interpolate(Real t, Real* state);
  void settle(Real t, Real* state);
  const Real* inputs_at(Real t);
  void require_usable_rates(Real t, const Real* state);
  [[noreturn]] void fail(int flag, Real t);
  [[noreturn]] void stop(Real t, const Real* state, const std::string& reason);
  [[nodiscard]] std::string absolute(Real t) const { return number_text(loop_.time_origin() + t, 15) + " s"; }

  // CVODE's callbacks
  int rate(Real t, const Real* state, Real* rate) noexcept override;
  int finite_rate(Real t, const Real* state, Real* rate) noexcept;
  int event_functions(Real t, const Real* state, Real* values) noexcept;
  int newton_matrix(const Real* state, Real gamma) noexcept;
  void linearize(const Real* state);
  int factor(Real gamma) noexcept override;
  int solve(Real* b) noexcept override;
  bool linearization_holds(const Real* state, Real gamma, const Real* weight, Real tolerance) noexcept override;
  bool stop_correction(Real* state) noexcept override;

  template <typename Action>
  int guarded(Action action) noexcept {
    try {
      return action();
    } catch (...) {
      failure_ = std::current_exception();
      return -1;
    }
  }

  const ClosedLoop& loop_;
  const Inputs& inputs_;
  std::unique_ptr<NewtonSolver> newton_;
  LoopJacobian jacobian_;
  RobustLayer layer_;
  LocatedConditions conditions_;
  Judge judge_;
  Judge::Path path_;  // through CVODE's last step
  StepFollower* follower_ = nullptr;
  Modes modes_before_;
  int size_;
  std::int64_t most_steps_between_restarts_;
  Tolerances tolerances_;

  // last restart point
  Real restart_time_ = 0.0;
  AlignedVector restart_state_;
  Modes restart_modes_;
  Statistics restart_statistics_;
  Judgement restart_judgement_;
  std::int64_t steps_since_restart_ = 0;

  // after a change of inputs or parameters
  bool follows_change_ = false;  ///< by Rosenbrock steps, up to the next communication point
  Real first_step_ = 0.0;        ///< to try after the next one; 0 when nothing is known of it

  // where CVODE stands
  Real internal_time_ = 0.0;  ///< up to here it has looked for events
  bool event_pending_ = false;
  Real event_time_ = 0.0;
  std::vector<int> passed_;   // 1 where an event function rose through zero
  bool has_planned_ = false;  // an event at a time that is known beforehand, at which CVODE stops
  Real planned_time_ = 0.0;

  // communication point
  Real time_ = 0.0;
  AlignedVector state_;
  Modes modes_;
  Real largest_raw_excess_ = 0.0;

  // scratch
  Signals signals_;
  AlignedVector input_values_;  // where they were needed last
  AlignedVector judged_inputs_;
  AlignedVector judged_state_;
  AlignedVector norm2_;
  AlignedVector rate_;  // where it was looked whether rates are usable, then where a Rosenbrock step begins
  AlignedVector rate_by_time_;
  AlignedVector event_values_;
  AlignedVector weight_;
  AlignedVector next_state_;
  AlignedVector next_rate_;
  std::int64_t events_ = 0;
  std::int64_t newton_setups_ = 0;
  std::int64_t newton_solves_ = 0;
  std::exception_ptr failure_;

  ContextHandle context_;
  VectorHandle vector_;
  MatrixHandle matrix_;
  LinearSolverHandle linear_solver_;
  NewtonIteration iteration_;
  RosenbrockMethod rosenbrock_;
  Cvode cvode_;
};

Integrator::Implementation::Implementation(const ClosedLoop& loop, const Inputs& inputs,
                                           std::unique_ptr<NewtonSolver> newton)
    : loop_(loop),
      inputs_(inputs),
      newton_(std::move(newton)),
      jacobian_(loop),
      layer_(loop),
      conditions_(loop),
      judge_(loop),
      path_([this](Real t) {
        interpolate(t, judged_state_.data());
        inputs_.values(t, judged_inputs_.data());
        return Judge::Place{judged_state_.data(), judged_inputs_.data()};
      }),
      size_(loop.layout().size()),
      most_steps_between_restarts_(most_steps_between_restarts(size_)),
      restart_state_(at(size_)),
      restart_modes_(at(LocatedConditions::count(loop.parameters()))),
      passed_(at(LocatedConditions::located(loop.parameters()))),
      state_(at(size_)),
      modes_(restart_modes_.size()),
      signals_(loop.shape()),
      input_values_(at(loop.inputs().size())),
      judged_inputs_(input_values_.size()),
      judged_state_(at(size_)),
      norm2_(at(loop.shape().own_entries())),
      rate_(at(size_)),
      rate_by_time_(at(size_)),
      event_values_(passed_.size()),
      weight_(at(size_)),
      next_state_(at(size_)),
      next_rate_(at(size_)),
      context_(make_context()),
      vector_(make_vector(size_, context_.get())),
      matrix_(make_placeholder_matrix(context_.get())),
      iteration_(*this, size_, context_.get()),
      rosenbrock_(*this, size_) {
  using Self = Implementation*;
  SUNLinearSolver solver = SUNLinSolNewEmpty(context_.get());
  if (solver == nullptr) throw std::bad_alloc();
  linear_solver_.reset(solver);
  solver->content = this;
  solver->ops->gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; };
  solver->ops->free = [](SUNLinearSolver stub) {
    SUNLinSolFreeEmpty(stub);
    return 0;
  };
  // never called: the Newton iteration solves by itself
  solver->ops->solve = [](SUNLinearSolver, SUNMatrix, N_Vector, N_Vector, SunReal) { return -1; };

  cvode_.reset(CVodeCreate(CV_BDF, context_.get()));
  if (cvode_ == nullptr) throw std::bad_alloc();
  void* memory = cvode_.get();
#if SUNDIALS_VERSION_MAJOR < 7  // which print errors
  CVodeSetErrHandlerFn(memory, [](int, const char*, const char*, char*, void*) {}, nullptr);
#endif
  CVodeSetUserData(memory, this);
  const auto require = [](int flag, const char* call) {
    if (flag == CV_MEM_FAIL || flag == CVLS_MEM_FAIL) throw std::bad_alloc();
    if (flag < 0) throw Error(std::string("CVODE could not be set up: ") + call + " failed");
  };
  const int initialized = CVodeInit(
      memory,
      [](SunReal t, N_Vector y, N_Vector rate, void* self) {
        return static_cast<Self>(self)->finite_rate(t, N_VGetArrayPointer(y), N_VGetArrayPointer(rate));
      },
      0.0, vector_.get());
  if (initialized == CV_MEM_FAIL)
    std::free(cvode_.release());  // its vectors are freed, and CVodeFree would do it again
  require(initialized, "CVodeInit");
  require(CVodeWFtolerances(memory,
                            [](N_Vector y, N_Vector weight, void* self) {
                              const Tolerances& tolerances = static_cast<Self>(self)->tolerances_;
                              kernels().error_weights(static_cast<Self>(self)->size_, tolerances.relative,
                                                      tolerances.absolute, N_VGetArrayPointer(y),
                                                      N_VGetArrayPointer(weight));
                              return 0;
                            }),
          "CVodeWFtolerances");
  require(CVodeSetLinearSolver(memory, solver, matrix_.get()), "CVodeSetLinearSolver");
  require(CVodeSetLinSysFn(memory,
                           [](SunReal, N_Vector y, N_Vector, SUNMatrix, SunBoolean, SunBoolean* is_current,
                              SunReal gamma, void* self, N_Vector, N_Vector, N_Vector) {
                             *is_current = SUNTRUE;
                             return static_cast<Self>(self)->newton_matrix(N_VGetArrayPointer(y), gamma);
                           }),
          "CVodeSetLinSysFn");
  require(CVodeSetNonlinearSolver(memory, iteration_.handle()), "CVodeSetNonlinearSolver");
  const auto conditions = static_cast<int>(passed_.size());
  require(CVodeRootInit(memory, conditions,
                        [](SunReal t, N_Vector y, SunReal* values, void* self) {
                          return static_cast<Self>(self)->event_functions(t, N_VGetArrayPointer(y), values);
                        }),
          "CVodeRootInit");
  std::vector<int> rising(passed_.size(), 1);
  require(CVodeSetRootDirection(memory, rising.data()), "CVodeSetRootDirection");
  require_whole(vector_.get());
  CVodeSetNoInactiveRootWarn(memory);
  // Factorizations cost about as much as an iteration here, so they are renewed often, and the step follows the error
  // closely. With the iteration's own test that took 24 % less work at equal error at N = 5, 10 % less time at N = 20
  // and 100; the looser tolerance, which its check of the linearization permits, 8 % less work at N = 5.
  CVodeSetNonlinConvCoef(memory, 0.25);
  CVodeSetLSetupFrequency(memory, 5);
  CVodeSetDeltaGammaMaxLSetup(memory, 0.05);
  CVodeSetEtaFixedStepBounds(memory, 0.0, 1.1);
  // where a layer or a sphere is met, a step may have to shrink by many powers of ten
  CVodeSetMaxErrTestFails(memory, 50);
  CVodeSetMaxConvFails(memory, 50);
}

const Real* Integrator::Implementation::inputs_at(Real t) {
  inputs_.values(t, input_values_.data());
  return input_values_.data();
}

int Integrator::Implementation::rate(Real t, const Real* state, Real* rate) noexcept {
  return guarded([&] {
    loop_.evaluate(t, state, inputs_at(t), modes_, signals_, rate);
    return 0;
  });
}

int Integrator::Implementation::finite_rate(Real t, const Real* state, Real* rate) noexcept {
  const int result = this->rate(t, state, rate);
  if (result != 0) return result;
  return std::isfinite(kernels().dot(size_, rate, rate)) ? 0 : 1;  // 1: CVODE tries a smaller step
}

int Integrator::Implementation::event_functions(Real t, const Real* state, Real* values) noexcept {
  return guarded([&] {
    conditions_.event_functions(t, state, inputs_at(t), modes_, tolerances_.relative, signals_, values);
    std::copy_n(values, event_values_.size(), event_values_.begin());
    return 0;
  });
}

int Integrator::Implementation::newton_matrix(const Real* state, Real gamma) noexcept {
  const int result = guarded([&] {
    linearize(state);  // CVODE factorizes right after an evaluation at the same time and state
    return 0;
  });
  return result != 0 ? result : factor(gamma);
}

/// At a state where the rates were evaluated last: inputs and signals belong to it.
void Integrator::Implementation::linearize(const Real* state) {
  jacobian_.linearize(state, loop_.plants(state, input_values_.data(), signals_), signals_, modes_);
}

int Integrator::Implementation::factor(Real gamma) noexcept {
  return guarded([&] {
    ++newton_setups_;
    return newton_->factor(jacobian_, gamma) ? 0 : 1;
  });
}

// Apart from the robust term, all is nearly linear within a step.
bool Integrator::Implementation::linearization_holds(const Real* state, Real gamma, const Real* weight,
                                                     Real tolerance) noexcept {
  return layer_.linearization_holds(jacobian_, signals_, modes_, state, input_values_.data(), gamma, weight, tolerance);
}

bool Integrator::Implementation::stop_correction(Real* state) noexcept {
  return layer_.stop_in_the_middle(signals_, modes_, input_values_.data(), state);
}

int Integrator::Implementation::solve(Real* b) noexcept {
  return guarded([&] {
    newton_->solve(b);
    ++newton_solves_;
    return 0;
  });
}

void Integrator::Implementation::stop(Real t, const Real* state, const std::string& reason) {
  const std::string growth = unbounded_growth(loop_, state, input_values_.data());
  throw IntegrationError("the integration stopped at t = " + absolute(t) + ": " + (growth.empty() ? reason : growth));
}

void Integrator::Implementation::require_usable_rates(Real t, const Real* state) {
  const int result = finite_rate(t, state, rate_.data());
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  if (result != 0) stop(t, state, unusable_rate(loop_, input_values_.data(), signals_, rate_.data()));
}

/// CVODE has left the state at time t in its vector.
void Integrator::Implementation::fail(int flag, Real t) {
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  const Real* state = N_VGetArrayPointer(vector_.get());
  Real step = 0.0;
  CVodeGetCurrentStep(cvode_.get(), &step);
  const std::string last_step = ", at last with a step of " + number_text(step) + " s";
  switch (flag) {
    case CV_TOO_MUCH_ACC:
      stop(t, state, "double precision cannot meet the relative tolerance " + number_text(tolerances_.relative));
    case CV_ERR_FAILURE:
      stop(t, state, "the error test failed again and again" + last_step);
    case CV_CONV_FAILURE:
    case CV_LSETUP_FAIL:
    case CV_LSOLVE_FAIL:
      stop(t, state, "no solution was found for the equations of an implicit step" + last_step);
    case CV_RHSFUNC_FAIL:
    case CV_FIRST_RHSFUNC_ERR:
    case CV_REPTD_RHSFUNC_ERR:
    case CV_UNREC_RHSFUNC_ERR: {
      const std::string after =
          unbounded_growth(loop_, state, input_values_.data());  // where rates were asked for last
      require_usable_rates(t, state);
      stop(t, state, after.empty() ? "the rates are not finite just after it" + last_step : after + " just after it");
    }
    default:
      std::unique_ptr<char, decltype(&std::free)> name(CVodeGetReturnFlagName(flag), &std::free);
      stop(t, state, name.get());
  }
}

void Integrator::Implementation::begin_at_restart_point() {
  begin_cvode();
  judge_.jump(restart_time_, {restart_state_.data(), inputs_at(restart_time_)}, modes_);
  restart_judgement_ = judge_.judgement();
}

/// At the restart point, as a new solver would.
void Integrator::Implementation::begin_cvode() {
  std::copy(restart_state_.begin(), restart_state_.end(), N_VGetArrayPointer(vector_.get()));
  modes_ = restart_modes_;
  steps_since_restart_ = 0;
  event_pending_ = false;
  internal_time_ = restart_time_;
  events_ = restart_statistics_.events;
  newton_setups_ = restart_statistics_.newton_setups;
  newton_solves_ = restart_statistics_.newton_solves;
  iteration_.reset();
  const int flag = CVodeReInit(cvode_.get(), restart_time_, vector_.get());
  if (flag < 0) fail(flag, restart_time_);
  plan_event(restart_time_);
}

/// Has CVODE stop where the next event after time t is known to be.
void Integrator::Implementation::plan_event(Real t) {
  const Real next = conditions_.next_event(t, modes_) - loop_.time_origin();
  const bool had_planned = std::exchange(has_planned_, std::isfinite(next));
  planned_time_ = next;
  if (!has_planned_ && !had_planned) return;
  constexpr Real never = 1e300;
  CVodeSetStopTime(cvode_.get(), has_planned_ ? next : never);
}

/// The state as it is seen from outside: projected, and never further out than the bound allows.
void Integrator::Implementation::settle(Real t, Real* state) {
  if (!loop_.parameters().strategy.robust) return;
  loop_.weight_norms(state, norm2_.data());
  bool is_to_project = false;
  for (std::size_t p = 0; p < norm2_.size(); ++p) {
    const Real W_max = loop_.gains().W_max[p];
    largest_raw_excess_ = std::max(largest_raw_excess_, norm2_[p] / W_max - 1.0);
    is_to_project = is_to_project || norm2_[p] > W_max || modes_[p] != 0.0;
  }
  if (is_to_project) loop_.project(modes_, inputs_at(t), signals_, state);
}

void Integrator::Implementation::start(Real t, Tolerances tolerances, const JudgingRule& rule) {
  tolerances_ = tolerances;
  restart_statistics_ = {};
  largest_raw_excess_ = 0.0;
  first_step_ = 0.0;
  time_ = t;
  loop_.initial_state(state_.data());
  conditions_.begin(t, state_.data(), inputs_at(t), modes_);
  steps_since_restart_ = 0;
  internal_time_ = t;
  restart_time_ = t;
  events_ = newton_setups_ = newton_solves_ = 0;
  jacobian_.refresh();
  newton_->refresh(jacobian_);
  require_usable_rates(t, state_.data());
  loop_.resolve_modes(state_.data(), inputs_at(t), tolerances_.relative, signals_, modes_);
  restart_state_ = state_;
  restart_modes_ = modes_;
  judge_.start(t, rule, {state_.data(), inputs_at(t)}, modes_);
  if (follower_ != nullptr) follower_->begin(t);
  begin_at_restart_point();
}

void Integrator::Implementation::prepare_change() {
  if (judge_.judgement().until < time_) judge_.pass(time_, path_, modes_);
}

Judgement Integrator::Implementation::judgement() {
  return judge_.judgement().until < time_ ? judge_.up_to(time_, path_, modes_) : judge_.judgement();
}

void Integrator::Implementation::begin_errors_anew(Real from) {
  judge_.begin_errors_anew(time_, from, {state_.data(), inputs_at(time_)});
  restart_judgement_.errors_from = judge_.judgement().errors_from;
  restart_judgement_.error_peak = judge_.judgement().error_peak;
}

void Integrator::Implementation::restart(bool parameters_changed) {
  restart_statistics_ = statistics();
  follows_change_ = restart_statistics_.steps != 0 && steps_since_restart_ < steps_of_a_start &&
                    tolerances_.relative >= least_tolerance_of_rosenbrock;
  if (parameters_changed) {
    jacobian_.refresh();
    newton_->refresh(jacobian_);
  }
  require_usable_rates(time_, state_.data());
  restart_modes_ = modes_;
  restart_statistics_.events +=
      conditions_.pass(time_, state_.data(), inputs_at(time_), tolerances_.relative, nullptr, signals_, modes_).events;
  if (modes_ != restart_modes_) require_usable_rates(time_, state_.data());
  restart_time_ = time_;
  restart_state_ = state_;
  restart_modes_ = modes_;
  begin_at_restart_point();
}

/// Where a Rosenbrock step begins, with the rates there, for a step of about this length.
void Integrator::Implementation::linearize_at_restart_point(Real t, Real step) {
  const Real* state = restart_state_.data();
  kernels().error_weights(size_, tolerances_.relative, tolerances_.absolute, state, weight_.data());
  linearize(state);
  // rounding of time and of rates, and the difference in place of the derivative, each stay far below the estimate
  const Real resolution = loop_.parameters().disturbance->resolution(t);
  const Real moment = (t + std::max(std::ldexp(step, -20), 1024.0 * resolution)) - t;
  if (inputs_.are_constant()) {
    loop_.evaluate_rate_by_time(t, moment, input_values_.data(), modes_, signals_, norm2_.data(), rate_by_time_.data());
    return;
  }
  loop_.evaluate(t + moment, state, inputs_at(t + moment), modes_, signals_, rate_by_time_.data());
  kernels().linear_sum(size_, 1.0 / moment, rate_by_time_.data(), -1.0 / moment, rate_.data(), rate_by_time_.data());
}

/// Goes from the restart point, where a change acts, towards the communication point by Rosenbrock steps, and makes the
/// restart point the last one reached. Where a condition ends, the steps become many or a rate is not finite, CVODE
/// goes on from there. The rates at the restart point were evaluated last.
void Integrator::Implementation::follow_change(Real t_end) {
  if (planned_time_ <= t_end) return;
  Real t = restart_time_;
  Real h = first_step_ > 0.0 ? first_step_ : 0.1 * (t_end - t);
  Statistics work;
  bool is_linearized = false;  // at t
  for (int tried = 0; t < t_end && tried < most_rosenbrock_steps; ++tried) {
    const Real left = t_end - t;
    const bool arrives = h >= 0.999 * left;
    const Real step = arrives ? left : std::min(h, 0.5 * left);
    if (!(t + step > t)) break;
    if (!std::exchange(is_linearized, true)) linearize_at_restart_point(t, step);
    Real error = 0.0;
    const int result = rosenbrock_.step({t, restart_state_.data(), rate_.data(), rate_by_time_.data()}, step,
                                        weight_.data(), next_state_.data(), error);
    if (result < 0) break;
    work.rate_evaluations += RosenbrockMethod::evaluations;
    error /= estimate_over_error;
    const Real factor =
        std::isfinite(error)
            ? std::clamp(0.9 * std::pow(error, -1.0 / (RosenbrockMethod::estimated_order + 1)), 0.2, 8.0)
            : 0.2;
    h = step * factor;
    if (!(error <= 1.0)) continue;
    const Real next = arrives ? t_end : t + step;
    if (event_functions(next, next_state_.data(), event_values_.data()) != 0) break;
    if (std::any_of(event_values_.begin(), event_values_.end(), [](Real value) { return value > 0.0; })) break;
    settle(next, next_state_.data());
    if (finite_rate(next, next_state_.data(), next_rate_.data()) != 0) break;
    ++work.rate_evaluations;
    if (work.steps == 0) first_step_ = std::min(h, 2.0 * step);
    ++work.steps;
    judge_.note(next, {next_state_.data(), input_values_.data()}, signals_.error, signals_.network);
    const auto place = [&](Real time) {
      hermite_cubic({t, restart_state_, rate_}, {next, next_state_, next_rate_}, time, judged_state_);
      inputs_.values(time, judged_inputs_.data());
      return Judge::Place{judged_state_.data(), judged_inputs_.data()};
    };
    judge_.pass_noted(std::cref(place), modes_);
    restart_state_.swap(next_state_);
    rate_.swap(next_rate_);
    is_linearized = false;
    t = next;
  }
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  restart_time_ = t;
  restart_statistics_ = statistics();
  restart_statistics_.steps += work.steps;
  restart_statistics_.rate_evaluations += work.rate_evaluations;
  begin_cvode();
  judge_.forget_past();  // as a run that is restored here
  restart_judgement_ = judge_.judgement();
}

void Integrator::Implementation::take_step() {
  if (judge_.has_noted()) judge_.pass_noted(path_, modes_);
  const Real before = internal_time_;
  // CVODE derives its first step from the distance to the output time, so that must not depend on the caller
  const Real horizon = restart_time_ + std::max(1.0, 1e-3 * std::fabs(restart_time_));
  const int flag = CVode(cvode_.get(), horizon, vector_.get(), &internal_time_, CV_ONE_STEP);
  if (flag < 0) fail(flag, internal_time_);
  ++steps_since_restart_;
  // CVODE does not say at once that a step after an event within it ended at the stop time
  if (!(internal_time_ > before) && flag != CV_TSTOP_RETURN) {
    stop(before, N_VGetArrayPointer(vector_.get()),
         "the steps that the relative tolerance " + number_text(tolerances_.relative) +
             " asks for fell below the resolution of time");
  }
  if (follower_ != nullptr && internal_time_ > before) {  // it has seen a stop time that CVODE tells of late
    int order = 1;
    CVodeGetLastOrder(cvode_.get(), &order);
    follower_->step(internal_time_, order, N_VGetArrayPointer(vector_.get()), modes_);
  }
  std::fill(passed_.begin(), passed_.end(), 0);
  if (flag == CV_ROOT_RETURN) {
    event_pending_ = true;
    event_time_ = internal_time_;
    CVodeGetRootInfo(cvode_.get(), passed_.data());
    return;
  }
  if (flag == CV_TSTOP_RETURN) {
    event_pending_ = true;
    event_time_ = internal_time_;
  }
  // A mode may end without a change of sign that CVODE can see, when it begins a step past the threshold by rounding:
  // it then changes here.
  for (std::size_t p = 0; p < event_values_.size(); ++p) {
    if (event_values_[p] > 0.0) {
      passed_[p] = 1;
      event_pending_ = true;
      event_time_ = internal_time_;
    }
  }
  // an event without conditions: a restart that bounds what a restore has to repeat
  if (!event_pending_ && steps_since_restart_ >= most_steps_between_restarts_) {
    event_pending_ = true;
    event_time_ = internal_time_;
  }
  if (!event_pending_) {
    inputs_.values(internal_time_, judged_inputs_.data());
    const Judge::Place place{N_VGetArrayPointer(vector_.get()), judged_inputs_.data()};
    const AlignedVector* error = layer_.error();  // at the solution, which is this place
    if (error == nullptr) {
      loop_.evaluate_errors(place.state, place.inputs, modes_, signals_);
      error = &signals_.error;
    }
    judge_.note(internal_time_, place, *error, signals_.network);
  }
}

/// Handles the pending event; true when that was a restart. A column that enters the sphere needs one, because its
/// rates jump. One that leaves does not: its rates are those that CVODE has been using since. Switches of expressions
/// need one where values jump.
bool Integrator::Implementation::handle_event() {
  event_pending_ = false;
  const Real t = event_time_;
  judge_.pass(t, path_, modes_);
  Real* state = N_VGetArrayPointer(vector_.get());
  interpolate(t, state);
  settle(t, state);
  if (follower_ != nullptr) modes_before_ = modes_;
  const auto [events, restarts] =
      conditions_.pass(t, state, inputs_at(t), tolerances_.relative, passed_.data(), signals_, modes_);
  events_ += events;
  const bool goes_on = !restarts && steps_since_restart_ < most_steps_between_restarts_;
  if (follower_ != nullptr) {
    Real reached = t;
    CVodeGetCurrentTime(cvode_.get(), &reached);
    follower_->pass_event({t, state, modes_before_, modes_, !goes_on, reached == t});
  }
  if (goes_on) {
    if (has_planned_) plan_event(t);
    return false;
  }
  restart_statistics_ = statistics();
  loop_.project(modes_, inputs_at(t), signals_, state);
  std::copy_n(state, size_, restart_state_.begin());
  restart_time_ = t;
  restart_modes_ = modes_;
  begin_at_restart_point();
  return true;
}

void Integrator::Implementation::interpolate(Real t, Real* state) {
  if (steps_since_restart_ == 0) {
    std::copy(restart_state_.begin(), restart_state_.end(), state);
    return;
  }
  const int flag = CVodeGetDky(cvode_.get(), t, 0, vector_.get());
  if (flag < 0) fail(flag, t);
  if (state != N_VGetArrayPointer(vector_.get())) std::copy_n(N_VGetArrayPointer(vector_.get()), size_, state);
}

void Integrator::Implementation::present(Real t) {
  interpolate(t, state_.data());
  if (steps_since_restart_ != 0) settle(t, state_.data());
  time_ = t;
}

void Integrator::Implementation::advance(Real t_end) {
  // A run that stands still ends here: at this pace, what remains would take billions of steps.
  constexpr int patience = 20'000;
  if (std::exchange(follows_change_, false)) follow_change(t_end);
  const Real least_progress = 1e-5 * (t_end - time_);
  Real mark = internal_time_;
  std::int64_t events = events_;
  int steps = 0;
  while (true) {
    if (event_pending_ && event_time_ <= t_end) {
      handle_event();
    } else if (internal_time_ >= t_end) {
      break;
    } else {
      take_step();
      if (++steps < patience) continue;
      if (!(internal_time_ - mark >= least_progress)) {
        stop(internal_time_, N_VGetArrayPointer(vector_.get()),
             std::to_string(patience) + " steps with " + std::to_string(events_ - events) + " events" +
                 (conditions_.last_switch().empty() ? "" : ", the last of " + conditions_.last_switch() + ",") +
                 " advanced it by " + number_text(internal_time_ - mark) + " s, which is no progress towards " +
                 absolute(t_end));
      }
      events = events_;
      mark = internal_time_;
      steps = 0;
    }
  }
  present(t_end);
}

Statistics Integrator::Implementation::statistics() const {
  Statistics statistics = restart_statistics_;
  long steps = 0;
  long evaluations = 0;
  if (steps_since_restart_ != 0) {
    CVodeGetNumSteps(cvode_.get(), &steps);
    CVodeGetNumRhsEvals(cvode_.get(), &evaluations);
  }
  statistics.steps += steps;
  statistics.rate_evaluations += evaluations + (steps_since_restart_ != 0 ? iteration_.iterations() : 0);
  statistics.events = events_;
  statistics.newton_setups = newton_setups_;
  statistics.newton_solves = newton_solves_;
  return statistics;
}

Checkpoint Integrator::Implementation::checkpoint() {
  return {restart_time_,
          restart_state_,
          restart_modes_,
          restart_statistics_,
          restart_judgement_,
          steps_since_restart_,
          first_step_,
          time_,
          state_,
          modes_,
          statistics(),
          judgement()};
}

bool Integrator::Implementation::restore(const Checkpoint& checkpoint, Tolerances tolerances) {
  if (checkpoint.steps_since_restart > most_steps_between_restarts_) {
    throw Error("the saved state counts " + std::to_string(checkpoint.steps_since_restart) +
                " steps since the last restart, expected at most " + std::to_string(most_steps_between_restarts_));
  }
  tolerances_ = tolerances;
  restart_time_ = checkpoint.restart_time;
  restart_state_ = checkpoint.restart_state;
  restart_modes_ = checkpoint.restart_modes;
  restart_statistics_ = checkpoint.restart_statistics;
  first_step_ = checkpoint.first_step;
  follows_change_ = false;
  judge_.resume(checkpoint.restart_judgement);
  jacobian_.refresh();
  newton_->refresh(jacobian_);
  begin_at_restart_point();
  bool same = true;
  try {
    while (same && steps_since_restart_ < checkpoint.steps_since_restart) {
      take_step();
      if (event_pending_ && event_time_ <= checkpoint.time) {
        same = !handle_event();
      } else {
        same = internal_time_ <= checkpoint.time || steps_since_restart_ == checkpoint.steps_since_restart;
      }
    }
    if (same) {
      present(checkpoint.time);
      same = checkpoint.state.empty() ||
             (std::memcmp(state_.data(), checkpoint.state.data(), state_.size() * sizeof(Real)) == 0 &&
              modes_ == checkpoint.modes);
    }
  } catch (const IntegrationError&) {
    same = false;
  }
  if (same) return true;
  restart_time_ = time_ = checkpoint.time;
  restart_state_ = state_ = checkpoint.state;
  restart_modes_ = checkpoint.modes;
  restart_statistics_ = checkpoint.statistics;
  judge_.resume(checkpoint.judgement);
  begin_at_restart_point();
  return false;
}

Integrator::Integrator(const ClosedLoop& loop, const Inputs& inputs, std::unique_ptr<NewtonSolver> newton_solver)
    : implementation_(std::make_unique<Implementation>(loop, inputs, std::move(newton_solver))) {}
Integrator::~Integrator() = default;

// about half a second of repetition; a restart costs some 25 steps, so large games pay a few percent for it
std::int64_t Integrator::most_steps_between_restarts(int states) {
  return std::max<std::int64_t>(500, 20'000'000 / states);
}

void Integrator::start(Real t, Tolerances tolerances, const JudgingRule& rule) {
  implementation_->start(t, tolerances, rule);
}
void Integrator::set_equilibrium(std::span<const Real> x_star) { implementation_->set_equilibrium(x_star); }
void Integrator::set_follower(StepFollower* follower) { implementation_->set_follower(follower); }
void Integrator::prepare_change() { implementation_->prepare_change(); }
void Integrator::restart(bool parameters_changed) { implementation_->restart(parameters_changed); }
void Integrator::advance(Real t_end) { implementation_->advance(t_end); }
Real Integrator::time() const { return implementation_->time(); }
const Real* Integrator::state() const { return implementation_->state(); }
const Modes& Integrator::modes() const { return implementation_->modes(); }
Statistics Integrator::statistics() const { return implementation_->statistics(); }
Real Integrator::largest_raw_excess() const { return implementation_->largest_raw_excess(); }
Judgement Integrator::judgement() { return implementation_->judgement(); }
void Integrator::begin_errors_anew(Real from) { implementation_->begin_errors_anew(from); }
Checkpoint Integrator::checkpoint() { return implementation_->checkpoint(); }
bool Integrator::restore(const Checkpoint& checkpoint, Tolerances tolerances) {
  return implementation_->restore(checkpoint, tolerances);
}

}  // namespace mixed_order_game
