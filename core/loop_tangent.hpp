// How the variables of the closed loop change along a direction, to first order: the directional derivative of rates
// and control with respect to state, inputs and time in the present modes, and of initial values with respect to
// parameters.
#pragma once

#include "loop_jacobian.hpp"

namespace mixed_order_game {

/// Derivatives along a direction, beside the variables of ClosedLoop::evaluate.
class LoopTangent {
 public:
  explicit LoopTangent(const ClosedLoop& loop);

  AlignedVector state;    ///< the direction itself
  AlignedVector control;  ///< of u, at entry(i, l)
  AlignedVector rate;     ///< of the state's rate

  /// Sets control and rate along state; the Jacobian must be linearized.
  void follow_state(const LoopJacobian& jacobian);

  /// Sets state, control and rate along parameters at the start of a run, where all weights are zero; the signals are
  /// those of ClosedLoop::evaluate, to which the Jacobian belongs, too.
  void follow_parameters(const LoopJacobian& jacobian, const Parameters& direction, Real t, const Real* initial_state,
                         const Signals& signals);

  /// Adds to rate the change along d_ext, at entry(i, l), and along time.
  void add_input(const Real* d_ext);
  void add_time(Real t, Real change);

 private:
  /// Adds what changes with parameters at a fixed state.
  void add_parameters(const Parameters& direction, Real t, const Real* initial_state, const Signals& signals);
  /// Where u + g + d enters: x' for players of order 1, v' for those of order 2.
  [[nodiscard]] std::size_t driven(int p) const;

  const ClosedLoop* loop_;
  AlignedVector gradient_;     // scratch, at entry(i, l)
  AlignedVector dynamics_;     // likewise
  AlignedVector disturbance_;  // likewise
  AlignedVector estimates_;    // scratch, as the estimates in the state
};

}  // namespace mixed_order_game
