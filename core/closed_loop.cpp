#include "closed_loop.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/kernels.hpp"

namespace mixed_order_game {

GainRows::GainRows(const Shape& shape) {
  for (AlignedVector* row : {&k, &k2, &beta, &delta, &sharpness, &steepest, &W_max}) row->resize(at(shape.actions()));
  sharpness_of_activations.resize(at(shape.players));
}

void GainRows::refresh(const Shape& shape, const Gains& gains, const RbfNetwork& rbf) {
  for (std::size_t i = 0; i < rbf.width.size(); ++i) {
    sharpness_of_activations[i] = 1.0 / (rbf.width[i] * rbf.width[i]);
  }
  for (int entry = 0; entry < shape.actions(); ++entry) {
    const std::size_t p = at(entry);
    const std::size_t i = at(shape.player_of(entry));
    k[p] = shape.order[i] == 2 ? gains.k4[i] : gains.k1[i];
    W_max[p] = rbf.W_max[i];
    k2[p] = gains.k2[i];
    beta[p] = gains.beta[i];
    delta[p] = gains.delta[i];
    sharpness[p] = robust_term_constant * gains.delta[i] / gains.epsilon[i];
    steepest[p] = robust_term_constant * gains.delta[i] * gains.delta[i] / gains.epsilon[i];
  }
}

ClosedLoop::ClosedLoop(Parameters parameters)
    : parameters_(std::move(parameters)), layout_(parameters_.shape), gains_(parameters_.shape) {
  refresh();
}

void ClosedLoop::refresh() {
  parameters_.disturbance->time_origin = time_origin_;
  parameters_.refresh();
  gains_.refresh(parameters_.shape, parameters_.gains, parameters_.rbf);
}

void ClosedLoop::set_time_origin(Real time_origin) {
  time_origin_ = parameters_.disturbance->time_origin = time_origin;
  parameters_.disturbance->refresh();
}

void ClosedLoop::initial_state(Real* state) const {
  initial_state(parameters_.initial, state);
  if (parameters_.initial.W.empty()) return;
  AlignedVector norm2(at(shape().actions()));
  weight_norms(state, norm2.data());
  for (int p = 0; p < shape().actions(); ++p) {
    const Real factor = std::sqrt(gains_.W_max[at(p)] / norm2[at(p)]);
    if (!(factor < 1.0)) continue;
    for (int m = 0; m < shape().neurons; ++m) state[layout_.weights_of(m) + p] *= factor;
  }
}

void ClosedLoop::initial_state(const InitialState& initial, Real* state) const {
  std::copy(initial.x.begin(), initial.x.end(), state + layout_.x());
  std::copy(initial.reference.begin(), initial.reference.end(), state + layout_.reference());
  std::copy(initial.y.begin(), initial.y.end(), state + layout_.estimates());
  Real* W = state + layout_.weights();
  std::fill(std::copy(initial.W.begin(), initial.W.end(), W), state + layout_.size(), 0.0);
}

void ClosedLoop::evaluate_errors(const Real* state, Signals& signals) const {
  const auto& [shape, gains, strategy, rbf, graph, cost, dynamics, disturbance, initial, named, guess] = parameters_;
  const Real* x = state + layout_.x();
  const Real* reference = state + layout_.reference();  // z or v
  Real* e = signals.error.data();
  const Real* gradient = signals.gradient.data();

  cost->own_gradients(state + layout_.estimates(), shape.actions(), signals.gradient.data());
  for (int l = 0; l < shape.dimension; ++l) {
    for (int i = 0; i < shape.players; ++i) {
      const int p = l * shape.players + i;
      const bool second = shape.is_second_order(i);
      signals.shared[at(p)] = terms::shared_signal(second, x[p], reference[p]);
      e[p] = terms::error(second, x[p], reference[p], gains_.k2[at(p)], gradient[p]);
    }
  }
}

void ClosedLoop::evaluate_robust_term(Signals& signals) const {
  // phi_i = delta tanh(K delta e_i / epsilon)
  kernels().scaled_tanh(shape().actions(), gains_.delta.data(), gains_.sharpness.data(), signals.error.data(),
                        signals.robust.data());
}

void ClosedLoop::evaluate_network(const Real* state, Signals& signals) const {
  const Kernels& kernel = kernels();
  const RbfNetwork& rbf = parameters_.rbf;
  const Shape& shape = parameters_.shape;
  const Real* y = state + layout_.estimates();
  if (rbf.diagonal) {
    kernel.activations_diagonal(shape.players, shape.dimension, shape.neurons, rbf.centers.data(),
                                gains_.sharpness_of_activations.data(), y, signals.exponent.data(),
                                signals.activation.data());
  } else {
    kernel.activations_general(shape.players, shape.dimension, shape.neurons, rbf.per_player ? shape.players : 1,
                               rbf.centers.data(), gains_.sharpness_of_activations.data(), y, signals.exponent.data(),
                               signals.activation.data());
  }
  kernel.column_products(shape.actions(), shape.neurons, state + layout_.weights(), signals.activation.data(),
                         signals.network.data());
}

void ClosedLoop::evaluate_seeking(const Real* state, Signals& signals) const {
  evaluate_errors(state, signals);
  if (parameters_.strategy.robust) {
    evaluate_network(state, signals);
    evaluate_robust_term(signals);
  } else {  // the estimation module is absent
    std::fill(signals.network.begin(), signals.network.end(), 0.0);
    std::fill(signals.robust.begin(), signals.robust.end(), 0.0);
  }
}

void ClosedLoop::evaluate(Real t, const Real* state, const Real* d_ext, const Modes& modes, Signals& signals,
                          Real* rate) const {
  const Kernels& kernel = kernels();
  const auto& [shape, gains, strategy, rbf, graph, cost, dynamics, disturbance, initial, named, guess] = parameters_;
  const int players = shape.players;
  const int n = shape.actions();
  const Real* x = state + layout_.x();
  const Real* reference = state + layout_.reference();
  const Real* e = signals.error.data();
  const Real* s = signals.network.data();
  const Real* phi = signals.robust.data();
  const Real* gradient = signals.gradient.data();
  Real* g = signals.dynamics.data();
  Real* d = signals.disturbance.data();

  evaluate_seeking(state, signals);
  if (strategy.robust) {
    for (int p = 0; p < n; ++p)
      signals.radial[at(p)] = modes[at(p)] != 0 && e[p] * s[p] >= 0.0 ? s[p] / gains_.W_max[at(p)] : 0.0;
    kernel.weight_rates(n, shape.neurons, gains_.beta.data(), e, signals.radial.data(), signals.activation.data(),
                        state + layout_.weights(), rate + layout_.weights());
  } else {
    std::fill(rate + layout_.weights(), rate + layout_.size(), 0.0);
  }
  if (strategy.perturbed) {
    dynamics->values(x, reference, g);
    disturbance->values(t, d);
    for (int p = 0; p < n; ++p) d[p] += d_ext[p];
  } else {
    std::fill_n(g, n, 0.0);
    std::copy_n(d_ext, n, d);
  }

  for (int l = 0; l < shape.dimension; ++l) {
    for (int i = 0; i < players; ++i) {
      const int p = l * players + i;
      const bool second = shape.is_second_order(i);
      const Real u = terms::control(gains_.k[at(p)], e[p], s[p], phi[p]);
      const Real driven = u + g[p] + d[p];
      signals.control[at(p)] = u;
      rate[layout_.x() + p] = second ? reference[p] : driven;  // x' = v or x' = u + g + d
      rate[layout_.reference() + p] = second ? driven : terms::reference_rate(gains_.k2[at(p)], gradient[p]);
    }
  }
  kernel.estimate_rates(players, shape.dimension, graph.neighbours(), gains.k3.data(), state + layout_.estimates(),
                        signals.shared.data(), rate + layout_.estimates());
}

void ClosedLoop::weight_norms(const Real* state, Real* norm2) const {
  const Real* W = state + layout_.weights();
  kernels().column_products(shape().actions(), shape().neurons, W, W, norm2);
}

void ClosedLoop::event_functions(const Real* state, const Modes& modes, Real tolerance, Signals& signals,
                                 Real* values) const {
  constexpr Real almost_zero = 1e-100;  // integrators stop watching a function that begins at zero
  if (!parameters_.strategy.robust) {
    std::fill_n(values, modes.size(), -1.0);
    return;
  }
  weight_norms(state, values);
  if (std::any_of(modes.begin(), modes.end(), [](auto mode) { return mode != 0; })) {
    evaluate_errors(state, signals);
    evaluate_network(state, signals);
  }
  for (std::size_t p = 0; p < modes.size(); ++p) {
    const Real W_max = gains_.W_max[p];
    const Real height = values[p] / W_max - 1.0;
    const Real rate = 2.0 * gains_.beta[p] * signals.error[p] * signals.network[p] / W_max;  // of w'w / W_max, inside
    const Real value = modes[p] == 0 ? height : std::min(-tolerance - height, -rate);
    values[p] = value == 0.0 ? -almost_zero : value;
  }
}

int ClosedLoop::resolve_modes(const Real* state, Real tolerance, Signals& signals, Modes& modes) const {
  AlignedVector values(modes.size());
  event_functions(state, modes, tolerance, signals, values.data());
  int changed = 0;
  for (std::size_t p = 0; p < modes.size(); ++p) {
    if (!(values[p] > 0.0)) continue;
    modes[p] = modes[p] == 0 ? 1 : 0;
    ++changed;
  }
  return changed;
}

void ClosedLoop::project(const Modes& modes, Signals& signals, Real* state) const {
  if (std::any_of(modes.begin(), modes.end(), [](auto mode) { return mode != 0; })) {
    evaluate_errors(state, signals);
    evaluate_network(state, signals);
  }
  for (int p = 0; p < shape().actions(); ++p) {
    Real norm2 = 0.0;
    for (int m = 0; m < shape().neurons; ++m) {
      const Real w = state[layout_.weights_of(m) + p];
      norm2 += w * w;
    }
    const Real W_max = gains_.W_max[at(p)];
    const bool slides = modes[at(p)] != 0 && norm2 > 0.0 && signals.error[at(p)] * signals.network[at(p)] >= 0.0;
    if (!(norm2 > W_max || slides)) continue;
    const Real factor = std::sqrt(W_max / norm2);
    for (int m = 0; m < shape().neurons; ++m) state[layout_.weights_of(m) + p] *= factor;
  }
}

}  // namespace mixed_order_game
