#include "robust_layer.hpp"

#include <algorithm>
#include <cmath>

namespace mixed_order_game {

RobustLayer::RobustLayer(const ClosedLoop& loop)
    : loop_(loop), trial_(loop.shape()), failed_(at(loop.shape().actions())) {
  const Shape& shape = loop.shape();
  for (int p = 0; p < shape.actions(); ++p) {
    const bool second = shape.is_second_order(shape.player_of(p));
    place_.push_back((second ? loop.layout().reference() : loop.layout().x()) + p);
  }
}

bool RobustLayer::linearization_holds(const LoopJacobian& jacobian, const Signals& signals, const Real* state,
                                      Real gamma, const Real* weight, Real tolerance) {
  if (!loop_.parameters().strategy.robust) return true;
  const Gains& gains = loop_.parameters().gains;
  const Real sharpness = robust_term_constant * gains.delta / gains.epsilon;
  const std::size_t columns = place_.size();
  loop_.evaluate_errors(state, trial_);
  const auto change = [&](std::size_t p) { return trial_.error[p] - signals.error[p]; };

  // A bound is nearly always enough, and needs no tanh: Taylor's remainder and the slope's change since the
  // factorization, with |phi''| <= 4 / (3 sqrt 3) delta (K delta / epsilon)^2.
  const Real largest_curvature = 0.7698003589195010 * gains.delta * sharpness * sharpness;
  Real bound = 0.0;
  for (std::size_t p = 0; p < columns; ++p) {
    const Real size = std::fabs(change(p));
    const Real slope = loop_.robust_term_slope(signals.robust[p]);
    const Real difference = (0.5 * largest_curvature * size + std::fabs(slope - jacobian.slope[p])) * size;
    bound = std::max(bound, difference * weight[place_[p]]);
  }
  if (gamma * bound <= tolerance) return true;

  loop_.evaluate_robust_term(trial_);
  // A difference in phi moves the solution by its share gamma / (1 + gamma slope).
  Real largest = 0.0;
  for (std::size_t p = 0; p < columns; ++p) {
    const Real difference = trial_.robust[p] - (signals.robust[p] + jacobian.slope[p] * change(p));
    const Real slope = std::min(loop_.robust_term_slope(trial_.robust[p]), jacobian.slope[p]);
    largest = std::max(largest, gamma / (1.0 + gamma * slope) * std::fabs(difference) * weight[place_[p]]);
  }
  return largest <= tolerance;
}

bool RobustLayer::move_to_middle(const Signals& signals, const Real* failed, Real* predicted) {
  if (!loop_.parameters().strategy.robust) return false;
  loop_.evaluate_errors(failed, trial_);
  loop_.evaluate_robust_term(trial_);
  failed_ = trial_.robust;
  loop_.evaluate_errors(predicted, trial_);
  loop_.evaluate_robust_term(trial_);
  const Real far = 0.5 * loop_.parameters().gains.delta;
  bool moved = false;
  for (int p = 0; p < loop_.shape().actions(); ++p) {
    const Real start = trial_.robust[at(p)];
    if (!(std::max(std::fabs(failed_[at(p)] - start), std::fabs(signals.robust[at(p)] - start)) > far)) continue;
    predicted[place_[at(p)]] -= trial_.error[at(p)];
    moved = true;
  }
  return moved;
}

}  // namespace mixed_order_game
