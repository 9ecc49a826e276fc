#include "newton/robust_layer.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/kernels.hpp"

namespace mixed_order_game {

namespace {

// A defect that is a part of phi's range, rather than a small one, changes sign as the iteration happens to end on this
// or that side of a bend. From step to step that is noise, of which the error test sees high derivatives: the run then
// stands still at the step whose defects are just let through. So such a defect counts this much more, in parts of
// delta.
constexpr Real weight_of_bends = 20.0;

}  // namespace

RobustLayer::RobustLayer(const ClosedLoop& loop)
    : loop_(loop), trial_(loop.shape()), weight_(at(loop.shape().own_entries())) {
  const Shape& shape = loop.shape();
  for (int p = 0; p < shape.own_entries(); ++p) {
    const int i = shape.player_of_own(p);
    const int place = shape.is_second_order(i) ? loop.layout().reference_of(p) : loop.layout().x_of(p);
    place_.push_back(shape.has_plant(i) ? place : -1);
  }
}

/// The largest weight with which a change of e enters the solution of a step: by itself, and by w' = beta S e.
void RobustLayer::find_weights(const LoopJacobian& jacobian, Real gamma, const Real* weight) {
  const StateLayout& layout = loop_.layout();
  const std::size_t columns = place_.size();
  kernels().largest_products(static_cast<int>(columns), loop_.shape().neurons, jacobian.activation.data(),
                             weight + layout.weights(), weight_.data());
  for (std::size_t p = 0; p < columns; ++p) {
    const bool drives = place_[p] >= 0 && jacobian.follows[p] != 0.0;
    weight_[p] = !drives ? 0.0 : std::max(weight[place_[p]], gamma * loop_.gains().beta[p] * weight_[p]);
  }
}

bool RobustLayer::linearization_holds(const LoopJacobian& jacobian, const Signals& signals, const Modes& modes,
                                      const Real* state, const Real* inputs, Real gamma, const Real* weight,
                                      Real tolerance) {
  looked_ = false;
  if (!loop_.parameters().strategy.robust) return true;
  const GainRows& gains = loop_.gains();
  if (std::all_of(gains.delta.begin(), gains.delta.end(), [](Real delta) { return delta == 0.0; })) return true;
  const std::size_t columns = place_.size();
  loop_.evaluate_errors(state, inputs, modes, trial_);
  looked_ = true;
  find_weights(jacobian, gamma, weight);
  const auto change = [&](std::size_t p) { return trial_.error[p] - signals.error[p]; };
  const auto counted = [&](std::size_t p, Real defect) {
    return gains.delta[p] == 0.0 ? 0.0 : defect * (1.0 + weight_of_bends / gains.delta[p] * defect);
  };

  // A bound is nearly always enough, and needs no tanh: Taylor's remainder and the slope's change since the
  // factorization.
  Real bound = 0.0;
  for (std::size_t p = 0; p < columns; ++p) {
    const Real size = std::fabs(change(p));
    const Real slope = loop_.robust_term_slope(p, signals.robust[p]);
    const Real defect = (0.5 * gains.curvature[p] * size + std::fabs(slope - jacobian.slope[p])) * size;
    bound = std::max(bound, counted(p, defect) * weight_[p]);
  }
  if (gamma * bound <= tolerance) return true;

  loop_.evaluate_robust_term(trial_);
  // A defect of phi moves the solution by its share gamma / (1 + gamma slope).
  Real largest = 0.0;
  for (std::size_t p = 0; p < columns; ++p) {
    const Real defect = std::fabs(trial_.robust[p] - (signals.robust[p] + jacobian.slope[p] * change(p)));
    const Real slope = std::min(loop_.robust_term_slope(p, trial_.robust[p]), jacobian.slope[p]);
    largest = std::max(largest, gamma / (1.0 + gamma * slope) * counted(p, defect) * weight_[p]);
  }
  return largest <= tolerance;
}

bool RobustLayer::stop_in_the_middle(const Signals& signals, const Modes& modes, const Real* inputs, Real* state) {
  if (!loop_.parameters().strategy.robust) return false;
  loop_.evaluate_errors(state, inputs, modes, trial_);
  loop_.evaluate_robust_term(trial_);
  bool stopped = false;
  for (std::size_t p = 0; p < place_.size(); ++p) {
    const Real before = signals.robust[p];
    const Real now = trial_.robust[p];
    if (place_[p] < 0 || !(before * now < 0.0 && std::fabs(now - before) > 0.5 * loop_.gains().delta[p])) continue;
    state[place_[p]] -= trial_.error[p];
    stopped = true;
  }
  return stopped;
}

}  // namespace mixed_order_game
