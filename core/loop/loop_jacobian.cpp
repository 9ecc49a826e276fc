#include "loop/loop_jacobian.hpp"

#include <algorithm>

namespace mixed_order_game {

LoopJacobian::LoopJacobian(const ClosedLoop& loop)
    : weights(at(loop.shape().neurons) * at(loop.shape().own_entries())),
      activation(weights.size()),
      error(at(loop.shape().own_entries())),
      network(error.size()),
      slope(error.size()),
      follows(error.size(), 1.0),
      inverse_bound(error.size()),
      loop_(&loop) {
  refresh();
}

void LoopJacobian::refresh() {
  const Parameters& parameters = loop_->parameters();
  hessian.resize(at(parameters.cost->hessian_pattern().entries()));
  dynamics.resize(at(parameters.dynamics->jacobian_pattern().entries()));
  dynamics_by_velocity.resize(at(parameters.dynamics->velocity_pattern().entries()));
}

void LoopJacobian::linearize(const Real* state, const Plants& plants, const Signals& signals, const Modes& modes) {
  const Parameters& parameters = loop_->parameters();
  const StateLayout& layout = loop_->layout();
  const int n = loop_->shape().actions();
  parameters.cost->hessian_rows(state + layout.estimates(), n, hessian.data(), loop().held(ClosedLoop::of_cost, modes));
  if (parameters.strategy.perturbed) {
    parameters.dynamics->jacobian(plants.x, plants.reference, dynamics.data(),
                                  loop().held(ClosedLoop::of_dynamics, modes));
    parameters.dynamics->velocity_jacobian(plants.x, plants.reference, dynamics_by_velocity.data(),
                                           loop().held(ClosedLoop::of_dynamics, modes));
  } else {
    std::fill(dynamics.begin(), dynamics.end(), 0.0);
    std::fill(dynamics_by_velocity.begin(), dynamics_by_velocity.end(), 0.0);
  }
  std::copy(signals.error.begin(), signals.error.end(), error.begin());
  std::copy(signals.network.begin(), signals.network.end(), network.begin());
  for (std::size_t p = 0; p < loop_->gains().u_max.size(); ++p) {
    follows[p] = loop_->is_bounded(p, signals) ? 0.0 : 1.0;
  }
  if (!parameters.strategy.robust) {
    std::fill(slope.begin(), slope.end(), 0.0);
    std::fill(inverse_bound.begin(), inverse_bound.end(), 0.0);
    return;
  }
  std::copy_n(state + layout.weights(), weights.size(), weights.begin());
  std::copy(signals.activation.begin(), signals.activation.end(), activation.begin());
  for (std::size_t p = 0; p < slope.size(); ++p) {
    slope[p] = loop_->robust_term_slope(p, signals.robust[p]);
    inverse_bound[p] = modes[p] != 0 && error[p] * network[p] >= 0.0 ? 1.0 / loop_->gains().W_max[p] : 0.0;
  }
}

}  // namespace mixed_order_game
