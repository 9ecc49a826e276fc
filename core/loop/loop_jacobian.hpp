// The Jacobian of the closed loop with respect to its state, but for the derivatives of the activations, kept as the
// few numbers that it is made of.
#pragma once

#include "loop/closed_loop.hpp"

namespace mixed_order_game {

class LoopJacobian {
 public:
  explicit LoopJacobian(const ClosedLoop& loop);

  /// Takes over changed parameters and their sparsity patterns.
  void refresh();

  /// Linearizes at a state; plants and signals are those of ClosedLoop::evaluate_seeking at the same state.
  void linearize(const Real* state, const Plants& plants, const Signals& signals, const Modes& modes);

  [[nodiscard]] const ClosedLoop& loop() const { return *loop_; }

  /// The numbers it is made of, indexed by own entries unless said otherwise.
  AlignedVector weights;               ///< W
  AlignedVector activation;            ///< S
  AlignedVector error;                 ///< e
  AlignedVector network;               ///< w'S
  AlignedVector slope;                 ///< d phi / d e
  AlignedVector follows;               ///< 1 where u follows e and w'S, 0 where it is at its bound
  AlignedVector inverse_bound;         ///< 1 / W_max on the sphere while e w'S >= 0, else 0
  AlignedVector hessian;               ///< along Cost::hessian_pattern()
  AlignedVector dynamics;              ///< along UnknownDynamics::jacobian_pattern(); zero when not perturbed
  AlignedVector dynamics_by_velocity;  ///< along UnknownDynamics::velocity_pattern(); likewise

 private:
  const ClosedLoop* loop_;
};

}  // namespace mixed_order_game
