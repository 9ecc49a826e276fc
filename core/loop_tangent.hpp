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

  /// Adds to rate the change along d_ext, at entry(i, l), and along time.
  void add_input(const Real* d_ext);
  void add_time(Real t, Real change);

  /// Adds the change along parameters at a fixed state in which all weights are zero, as at the start of a run; the
  /// signals are those of ClosedLoop::evaluate. What moves the initial state itself belongs into state.
  void add_parameters(const Parameters& direction, Real t, const Real* initial_state, const Signals& signals);

 private:
  /// Where u + g + d enters: x' for players of order 1, v' for those of order 2.
  [[nodiscard]] std::size_t driven(int p) const;

  const ClosedLoop* loop_;
  AlignedVector gradient_;     // scratch, at entry(i, l)
  AlignedVector dynamics_;     // likewise
  AlignedVector disturbance_;  // likewise
  AlignedVector estimates_;    // scratch, as the estimates in the state
};

}  // namespace mixed_order_game
