// The layer |e| <= epsilon / (K delta) within which the robust term phi = delta tanh(K delta e / epsilon) bends.
//
// An implicit step solves, apart from nearly linear terms, an equation  e + a phi(e) = c  for each column. A step may
// lead from one side of the layer to the other, or into it: a strategy with a large delta or a small epsilon slides
// within a layer that is far thinner than the step. A Newton iteration then believes in a slope that is not there.
#pragma once

#include "loop/loop_jacobian.hpp"

namespace mixed_order_game {

class RobustLayer {
 public:
  explicit RobustLayer(const ClosedLoop& loop);

  /// Whether phi at this state is what the linearization foretells: gamma times the defects, as far as the solution
  /// follows them, weighted like the velocity, action or weights that they move, up to the tolerance in each column.
  /// Signals belong to the state that the last correction set out from, slopes to the factorized Jacobian. A solution
  /// follows a defect by 1 / (1 + gamma slope) of it, with the lesser of the slopes foretold and found.
  [[nodiscard]] bool linearization_holds(const LoopJacobian& jacobian, const Signals& signals, const Modes& modes,
                                         const Real* state, const Real* inputs, Real gamma, const Real* weight,
                                         Real tolerance);

  /// e at the state that linearization_holds() looked at last; null when it had no need to look.
  [[nodiscard]] const AlignedVector* error() const { return looked_ ? &trial_.error : nullptr; }

  /// Stops columns that a correction, which set out from the signals' state, carried across the layer: puts them in its
  /// middle e = 0 by their velocity or (order 1) action. False when there was none. On either side of the middle
  /// e + a phi(e) is concave or convex, so that Newton's iteration with a Jacobian of its own at each iterate converges
  /// from there without another crossing.
  bool stop_in_the_middle(const Signals& signals, const Modes& modes, const Real* inputs, Real* state);

 private:
  void find_weights(const LoopJacobian& jacobian, Real gamma, const Real* weight);

  const ClosedLoop& loop_;
  // per column: where the state holds the number that its error follows one to one; -1 where the plant is outside,
  // so that the robust term enters no rate
  std::vector<int> place_;
  Signals trial_;
  bool looked_ = false;   // at trial_
  AlignedVector weight_;  // per column
};

}  // namespace mixed_order_game
