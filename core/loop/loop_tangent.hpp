// How the variables of the closed loop change along a direction, to first order: of state, inputs and time in a run, or
// of parameters at its start.
#pragma once

#include "aligned_vector.hpp"
#include "closed_loop.hpp"
#include "loop/equations.hpp"

namespace mixed_order_game {

/// Derivatives along a direction, beside the variables of ClosedLoop::evaluate.
class LoopTangent {
 public:
  explicit LoopTangent(const ClosedLoop& loop);

  // the direction; all zero after clear()
  AlignedVector state;
  AlignedVector d_ext;  ///< at entry(i, l)
  Real time = 0.0;

  // what follows along it
  AlignedVector control;  ///< of u, at entry(i, l)
  AlignedVector rate;     ///< of the state's rate

  void clear();

  /// Sets control and rate at time t [s] and a state.
  void follow(Real t, const Real* at_state, const Modes& modes);

  /// The same at the start of a run along parameters, too; sets state to the change of the initial state.
  void follow_parameters(const Parameters& direction, Real t, const Real* at_state, const Modes& modes);

 private:
  void evaluate(const Parameters* direction, Real t, const Real* at_state, const Modes& modes);

  const ClosedLoop* loop_;
  LoopEquations<Dual> equations_;
  LoopNumbers<Dual> numbers_;
  std::vector<Dual> state_, d_ext_, rate_;
};

}  // namespace mixed_order_game
