// How the variables of the closed loop change along a direction, to first order: of state, inputs and time in a run, or
// of parameters at its start.
#pragma once

#include "aligned_vector.hpp"
#include "loop/closed_loop.hpp"
#include "loop/equations.hpp"

namespace mixed_order_game {

/// Derivatives along a direction, beside the variables of ClosedLoop::evaluate.
class LoopTangent {
 public:
  explicit LoopTangent(const ClosedLoop& loop);

  // the direction; all zero after clear()
  AlignedVector state;
  AlignedVector inputs;  ///< as ClosedLoop::inputs says
  Real time = 0.0;

  // what follows along it
  AlignedVector control;  ///< of u, at own entries
  AlignedVector rate;     ///< of the state's rate
  AlignedVector actions;  ///< of x, at entry(i, l)
  AlignedVector shared;   ///< of xbar, likewise

  void clear();

  /// Sets control, rate and actions at time t [s], a state and inputs.
  void follow(Real t, const Real* at_state, const Real* at_inputs, const Modes& modes);

  /// The same along parameters, too.
  void follow(const Parameters& direction, Real t, const Real* at_state, const Real* at_inputs, const Modes& modes);

  /// The same at the start of a run; sets state to the change of the initial state.
  void follow_parameters(const Parameters& direction, Real t, const Real* at_state, const Real* at_inputs,
                         const Modes& modes);

 private:
  void evaluate(const Parameters* direction, Real t, const Real* at_state, const Real* at_inputs, const Modes& modes);

  const ClosedLoop* loop_;
  LoopEquations<Dual> equations_;
  LoopNumbers<Dual> numbers_;
  std::vector<Dual> state_, inputs_, rate_;
};

}  // namespace mixed_order_game
