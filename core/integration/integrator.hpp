// Integrates the closed loop by CVODE (BDF, Newton), with the events of the projection and of expressions located by
// their signs, or hit where their times are known beforehand. Entering the sphere, and most switches of expressions,
// make the rates jump and restart CVODE; leaving it and bends do not.
//
// CVODE takes its internal steps one by one and outputs are interpolated, so the sequence of internal steps depends on
// nothing but the last restart point (time, state, modes, parameters, inputs): communication points leave no trace, and
// a checkpoint is that restart point plus the count of steps since.
//
// Where inputs or parameters change at one communication point after the other, CVODE would begin anew at order 1 each
// time. The time up to the next one is then gone by Rosenbrock steps, which end there: a restart point, whatever
// follows.
//
// All times here are seconds since the loop's time origin: where a run begins there, the resolution of its times does
// not depend on the date.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "integration/judge.hpp"
#include "integration/step_follower.hpp"
#include "loop/closed_loop.hpp"
#include "loop/inputs.hpp"
#include "newton/newton_solver.hpp"

namespace mixed_order_game {

struct Tolerances {
  Real relative = 1e-6;
  Real absolute = 1e-8;
};

/// Work done since the start of the run.
struct Statistics {
  std::int64_t steps = 0;
  std::int64_t rate_evaluations = 0;
  std::int64_t newton_setups = 0;
  std::int64_t newton_solves = 0;
  std::int64_t events = 0;  ///< columns that entered or left the sphere, and switches of expressions
  friend bool operator==(const Statistics&, const Statistics&) = default;
};

/// All that is needed to continue a run bit for bit, besides parameters and inputs: the last restart point and the
/// count of steps since, with the state that they lead to.
struct Checkpoint {
  Real restart_time = 0.0;
  AlignedVector restart_state;
  Modes restart_modes;
  Statistics restart_statistics;
  Judgement restart_judgement;
  std::int64_t steps_since_restart = 0;
  Real first_step = 0.0;  ///< to try after the next change [s]; 0 when nothing is known of it
  Real time = 0.0;        ///< communication point at which it was taken
  AlignedVector state;
  Modes modes;
  Statistics statistics;
  Judgement judgement;
};

class Integrator {
 public:
  /// The loop and the inputs are read at every evaluation and must outlive the integrator.
  Integrator(const ClosedLoop& loop, const Inputs& inputs, std::unique_ptr<NewtonSolver> newton_solver);
  ~Integrator();
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;

  /// Begins a run at time t with the loop's initial state.
  void start(Real t, Tolerances tolerances, const JudgingRule& rule = {});

  /// What goes along with runs from the next start() on, in which nothing is changed and no checkpoint restored; it
  /// must outlive the integrator. Null: nothing.
  void set_follower(StepFollower* follower);

  /// x* for the judgement, at entry(i, l), from the next start() or restart() on; empty where it is not known.
  void set_equilibrium(std::span<const Real> x_star);

  /// Parameters or inputs are about to change: judges the run up to the present time by those that act now.
  void prepare_change();
  /// Restarts at the present time because parameters, or only inputs, changed. When the last restart was a few steps
  /// ago, the next call of advance() takes Rosenbrock steps.
  void restart(bool parameters_changed = true);

  /// Moves to time t_end >= time(). Throws IntegrationError with the time reached and the reason; the present time and
  /// state then remain those of the last success.
  void advance(Real t_end);

  [[nodiscard]] Real time() const;
  /// State at time(), projected; every output belongs to it.
  [[nodiscard]] const Real* state() const;
  [[nodiscard]] const Modes& modes() const;
  [[nodiscard]] Statistics statistics() const;
  /// Of the run up to time(), which leaves no trace in it.
  [[nodiscard]] Judgement judgement();
  /// The peak of errors begins anew at the later of time() and from.
  void begin_errors_anew(Real from);
  /// Largest excess of w'w over W_max that projection removed since the start, relative to W_max.
  [[nodiscard]] Real largest_raw_excess() const;

  /// What bounds the steps that a restore has to repeat.
  [[nodiscard]] static std::int64_t most_steps_between_restarts(int states);
  [[nodiscard]] Checkpoint checkpoint();
  /// Returns to a checkpoint by restarting at its restart point and repeating its steps. True when that led to the
  /// checkpoint's own state, bit for bit; otherwise (another machine's arithmetic) the run goes on from that state with
  /// a restart, and false is returned. Throws Error when the checkpoint asks for more steps than a run can have taken.
  bool restore(const Checkpoint& checkpoint, Tolerances tolerances);

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace mixed_order_game
