#include "robust_layer.hpp"

#include <algorithm>
#include <cmath>

namespace mixed_order_game {

RobustLayer::RobustLayer(const ClosedLoop& loop)
    : loop_(loop), trial_(loop.shape()), failed_(at(loop.shape().actions())) {}

int RobustLayer::place_of(int p) const {
  const bool second = loop_.shape().is_second_order(loop_.shape().player_of(p));
  return (second ? loop_.layout().reference() : loop_.layout().x()) + p;
}

bool RobustLayer::linearization_holds(const LoopJacobian& jacobian, const Signals& signals, const Real* state,
                                      Real gamma, const Real* weight, Real tolerance) {
  if (!loop_.parameters().strategy.robust) return true;
  const Gains& gains = loop_.parameters().gains;
  const Real sharpness = robust_term_constant * gains.delta / gains.epsilon;
  const int columns = loop_.shape().actions();
  // A difference in phi moves the solution by its share gamma / (1 + gamma slope).
  const auto within_tolerance = [&](auto difference, auto slope) {
    Real largest = 0.0;
    for (int p = 0; p < columns; ++p) {
      const Real share = gamma / (1.0 + gamma * std::min(slope(at(p)), jacobian.slope[at(p)]));
      largest = std::max(largest, share * std::fabs(difference(at(p))) * weight[place_of(p)]);
    }
    return largest <= tolerance;
  };
  loop_.evaluate_errors(state, trial_);
  const auto change = [&](std::size_t p) { return trial_.error[p] - signals.error[p]; };

  // A bound is nearly always enough, and needs no tanh: Taylor's remainder and the slope's change since the
  // factorization, with |phi''| <= 4 / (3 sqrt 3) delta (K delta / epsilon)^2.
  const Real largest_curvature = 0.7698003589195010 * gains.delta * sharpness * sharpness;
  const auto slope_before = [&](std::size_t p) { return loop_.robust_term_slope(signals.robust[p]); };
  const auto largest_difference = [&](std::size_t p) {
    const Real size = std::fabs(change(p));
    return 0.5 * largest_curvature * size * size + std::fabs(slope_before(p) - jacobian.slope[p]) * size;
  };
  const auto least_slope = [&](std::size_t p) {
    return std::max(0.0, slope_before(p) - largest_curvature * std::fabs(change(p)));
  };
  if (within_tolerance(largest_difference, least_slope)) return true;

  loop_.evaluate_robust_term(trial_);
  const auto difference = [&](std::size_t p) {
    return trial_.robust[p] - (signals.robust[p] + jacobian.slope[p] * change(p));
  };
  const auto slope = [&](std::size_t p) { return loop_.robust_term_slope(trial_.robust[p]); };
  return within_tolerance(difference, slope);
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
    predicted[place_of(p)] -= trial_.error[at(p)];
    moved = true;
  }
  return moved;
}

}  // namespace mixed_order_game
