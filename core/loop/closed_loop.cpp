#include "loop/closed_loop.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/kernels.hpp"

namespace mixed_order_game {

GainRows::GainRows(const Shape& shape) : k3(at(shape.hosts())) {
  for (AlignedVector* row : {&k, &k2, &beta, &delta, &sharpness, &steepest, &curvature, &W_max}) {
    row->resize(at(shape.own_entries()));
  }
  sharpness_of_activations.resize(at(shape.hosts()));
}

void GainRows::refresh(const Parameters& parameters) {
  const Shape& shape = parameters.shape;
  const Gains& gains = parameters.gains;
  const RbfNetwork& rbf = parameters.rbf;
  u_max.clear();
  for (int p = 0; p < (parameters.u_max.empty() ? 0 : shape.own_entries()); ++p) {
    u_max.push_back(parameters.u_max[at(shape.entry_of_own(p))]);
  }
  for (int h = 0; h < shape.hosts(); ++h) {
    const Real width = rbf.width[at(shape.host(h))];
    sharpness_of_activations[at(h)] = 1.0 / (width * width);
  }
  if (!shape.hosts_all()) own_centers = rbf.centers_of_hosts(shape);
  for (int entry = 0; entry < shape.own_entries(); ++entry) {
    const std::size_t p = at(entry);
    const std::size_t i = at(shape.player_of_own(entry));
    k[p] = shape.order[i] == 2 ? gains.k4[i] : gains.k1[i];
    W_max[p] = rbf.W_max[i];
    k2[p] = gains.k2[i];
    beta[p] = gains.beta[i];
    delta[p] = gains.delta[i];
    sharpness[p] = robust_term_constant * gains.delta[i] / gains.epsilon[i];
    curvature[p] = 0.7698003589195010 * delta[p] * sharpness[p] * sharpness[p];
    steepest[p] = robust_term_constant * gains.delta[i] * gains.delta[i] / gains.epsilon[i];
  }
  for (int h = 0; h < shape.hosts(); ++h) k3[at(h)] = gains.k3[at(shape.host(h))];
}

ClosedLoop::ClosedLoop(Parameters parameters)
    : parameters_(std::move(parameters)),
      layout_(parameters_.shape),
      gains_(parameters_.shape),
      is_whole_(shape().hosts_all() && shape().external.empty()),
      number_heard_(at(shape().players), -1),
      first_switch_{parameters_.first_switch(0), parameters_.first_switch(1), parameters_.first_switch(2)} {
  refresh();
  inputs_ = InputLayout(parameters_);
  for (int p = 0; p < shape().own_entries(); ++p) {
    own_.push_back({shape().entry_of_own(p), layout_.x_of(p), layout_.reference_of(p),
                    shape().is_second_order(shape().player_of_own(p))});
  }
  for (std::size_t k = 0; k < inputs_.heard().size(); ++k) number_heard_[at(inputs_.heard()[k])] = static_cast<int>(k);
}

void ClosedLoop::refresh() {
  parameters_.disturbance->time_origin = time_origin_;
  parameters_.refresh();
  gains_.refresh(parameters_);
}

void ClosedLoop::set_time_origin(Real time_origin) {
  time_origin_ = parameters_.disturbance->time_origin = time_origin;
  parameters_.disturbance->refresh();
}

void ClosedLoop::initial_state(Real* state) const {
  initial_state(parameters_.initial, state);
  if (parameters_.initial.W.empty()) return;
  AlignedVector norm2(at(shape().own_entries()));
  weight_norms(state, norm2.data());
  for (int p = 0; p < shape().own_entries(); ++p) {
    const Real factor = std::sqrt(gains_.W_max[at(p)] / norm2[at(p)]);
    if (!(factor < 1.0)) continue;
    for (int m = 0; m < shape().neurons; ++m) state[layout_.weights_of(m) + p] *= factor;
  }
}

void ClosedLoop::initial_state(const InitialState& initial, Real* state) const {
  for (const OwnEntry& own : own_) {
    if (own.x >= 0) state[own.x] = initial.x[at(own.entry)];
    if (own.reference >= 0) state[own.reference] = initial.reference[at(own.entry)];
  }
  std::copy(initial.y.begin(), initial.y.end(), state + layout_.estimates());
  std::fill(state + layout_.weights(), state + layout_.size(), 0.0);
  if (initial.W.empty()) return;
  for (int m = 0; m < shape().neurons; ++m) {
    const Real* W = initial.W.data() + m * shape().actions();
    for (std::size_t p = 0; p < own_.size(); ++p) state[at(layout_.weights_of(m)) + p] = W[own_[p].entry];
  }
}

void ClosedLoop::gather_plants(const Real* state, const Real* inputs, Signals& signals) const {
  for (const OwnEntry& own : own_) {
    if (own.x >= 0) signals.actions[at(own.entry)] = state[own.x];
    if (own.reference >= 0) signals.references[at(own.entry)] = state[own.reference];
  }
  const Real* from = inputs + inputs_.x();
  for (const int entry : inputs_.actions()) signals.actions[at(entry)] = *from++;
  from = inputs + inputs_.v();
  for (const int entry : inputs_.velocities()) signals.references[at(entry)] = *from++;
}

void ClosedLoop::evaluate_errors(const Real* state, const Real* inputs, const Modes& modes, Signals& signals) const {
  const auto& [shape, gains, strategy, rbf, graph, cost, dynamics, disturbance, initial, named, guess, u_max] =
      parameters_;
  const auto [x, reference] = plants(state, inputs, signals);
  const Real* gradient = signals.gradient.data();
  const Real* k2 = gains_.k2.data();
  Real* e = signals.error.data();
  Real* shared = signals.shared.data();

  cost->own_gradients(state + layout_.estimates(), shape.actions(), signals.gradient.data(), held(of_cost, modes));
  for (std::size_t p = 0; p < own_.size(); ++p) {
    const auto& [k, to_x, to_reference, second] = own_[p];
    shared[k] = terms::shared_signal(second, x[k], reference[k]);
    e[p] = terms::error(second, x[k], reference[k], k2[p], gradient[p]);
  }
  for (std::size_t k = 0; k < inputs_.heard().size(); ++k) {
    const Real* xbar = inputs + inputs_.xbar_of(static_cast<int>(k));
    for (int l = 0; l < shape.dimension; ++l) signals.shared[at(shape.entry(inputs_.heard()[k], l))] = xbar[l];
  }
}

void ClosedLoop::evaluate_robust_term(Signals& signals) const {
  // phi_i = delta tanh(K delta e_i / epsilon)
  kernels().scaled_tanh(shape().own_entries(), gains_.delta.data(), gains_.sharpness.data(), signals.error.data(),
                        signals.robust.data());
}

void ClosedLoop::evaluate_network(const Real* state, Signals& signals) const {
  const Kernels& kernel = kernels();
  const RbfNetwork& rbf = parameters_.rbf;
  const Shape& shape = parameters_.shape;
  const Real* y = state + layout_.estimates();
  const Real* centers = shape.hosts_all() ? rbf.centers.data() : gains_.own_centers.data();
  if (rbf.diagonal) {
    kernel.activations_diagonal(shape.hosts(), shape.actions(), shape.dimension, shape.neurons, centers,
                                gains_.sharpness_of_activations.data(), y, signals.exponent.data(),
                                signals.activation.data());
  } else {
    kernel.activations_general(shape.hosts(), shape.actions(), shape.dimension, shape.neurons,
                               rbf.per_player ? shape.hosts() : 1, centers, gains_.sharpness_of_activations.data(), y,
                               signals.exponent.data(), signals.activation.data());
  }
  kernel.column_products(shape.own_entries(), shape.neurons, state + layout_.weights(), signals.activation.data(),
                         signals.network.data());
}

void ClosedLoop::evaluate_seeking(const Real* state, const Real* inputs, const Modes& modes, Signals& signals) const {
  evaluate_errors(state, inputs, modes, signals);
  if (parameters_.strategy.robust) {
    evaluate_network(state, signals);
    evaluate_robust_term(signals);
  } else {  // the estimation module is absent
    std::fill(signals.network.begin(), signals.network.end(), 0.0);
    std::fill(signals.robust.begin(), signals.robust.end(), 0.0);
  }
}

void ClosedLoop::evaluate_control(Signals& signals) const {
  const Real* k = gains_.k.data();
  const Real* e = signals.error.data();
  const Real* s = signals.network.data();
  const Real* phi = signals.robust.data();
  Real* u = signals.control.data();
  for (std::size_t p = 0; p < own_.size(); ++p) u[p] = terms::control(k[p], e[p], s[p], phi[p]);
  for (std::size_t p = 0; p < gains_.u_max.size(); ++p) u[p] = terms::within_bound(u[p], gains_.u_max[p]);
}

void ClosedLoop::evaluate(Real t, const Real* state, const Real* inputs, const Modes& modes, Signals& signals,
                          Real* rate) const {
  const Kernels& kernel = kernels();
  const auto& [shape, gains, strategy, rbf, graph, cost, dynamics, disturbance, initial, named, guess, u_max] =
      parameters_;
  const int n = shape.own_entries();
  const Real* d_ext = inputs + inputs_.d_ext();
  const Real* e = signals.error.data();
  const Real* s = signals.network.data();
  const Real* u = signals.control.data();
  const Real* gradient = signals.gradient.data();
  Real* g = signals.dynamics.data();
  Real* d = signals.disturbance.data();

  evaluate_seeking(state, inputs, modes, signals);
  evaluate_control(signals);
  if (strategy.robust) {
    for (int p = 0; p < n; ++p)
      signals.radial[at(p)] = modes[at(p)] != 0 && e[p] * s[p] >= 0.0 ? s[p] / gains_.W_max[at(p)] : 0.0;
    kernel.weight_rates(n, shape.neurons, gains_.beta.data(), e, signals.radial.data(), signals.activation.data(),
                        state + layout_.weights(), rate + layout_.weights());
  } else {
    std::fill(rate + layout_.weights(), rate + layout_.size(), 0.0);
  }
  const auto [x, reference] = found_plants(state, signals);
  if (strategy.perturbed) {
    dynamics->values(x, reference, g, held(of_dynamics, modes));
    disturbance->values(t, d, held(of_disturbance, modes));
    for (int p = 0; p < n; ++p) d[p] += d_ext[p];
  } else {
    std::fill_n(g, n, 0.0);
    std::copy_n(d_ext, n, d);
  }

  const Real* k2 = gains_.k2.data();
  for (std::size_t p = 0; p < own_.size(); ++p) {
    const auto& [entry, to_x, to_reference, second] = own_[p];
    const Real driven = u[p] + g[p] + d[p];
    if (to_x >= 0) rate[to_x] = second ? reference[entry] : driven;  // x' = v or x' = u + g + d
    if (to_reference >= 0) rate[to_reference] = second ? driven : terms::reference_rate(k2[p], gradient[p]);
  }
  kernel.estimate_rates(shape.hosts(), shape.players, shape.dimension, graph.hosted_neighbours(), graph.neighbours(),
                        gains_.k3.data(), state + layout_.estimates(), signals.shared.data(),
                        rate + layout_.estimates());
  if (!inputs_.heard().empty()) add_consensus_with_others(state, inputs, rate);
}

void ClosedLoop::evaluate_rate_by_time(Real t, Real moment, const Real* inputs, const Modes& modes,
                                       const Signals& signals, Real* d, Real* rate_by_time) const {
  std::fill_n(rate_by_time, layout_.size(), 0.0);
  if (!parameters_.strategy.perturbed) return;
  parameters_.disturbance->values(t + moment, d, held(of_disturbance, modes));
  for (std::size_t p = 0; p < own_.size(); ++p) {
    const int driven = own_[p].second ? own_[p].reference : own_[p].x;
    const Real change = d[p] + inputs[at(inputs_.d_ext()) + p] - signals.disturbance[p];
    if (driven >= 0) rate_by_time[driven] = change / moment;
  }
}

/// -k3 sum_k a_ik (y_ij - y_kj) over players k elsewhere.
void ClosedLoop::add_consensus_with_others(const Real* state, const Real* inputs, Real* rate) const {
  const NeighbourRows rows = parameters_.graph.neighbours();
  const int n = shape().actions();
  for (int h = 0; h < shape().hosts(); ++h) {
    const Real* own = state + layout_.estimates_of(h);
    Real* own_rate = rate + layout_.estimates_of(h);
    for (int e = rows.start[h]; e < rows.start[h + 1]; ++e) {
      const int k = number_heard_[at(rows.neighbour[e])];
      if (k < 0) continue;
      const Real gain = -gains_.k3[at(h)] * rows.weight[e];
      kernels().add_difference(n, gain, own, inputs + inputs_.y_of(k), own_rate);
    }
  }
}

void ClosedLoop::weight_norms(const Real* state, Real* norm2) const {
  const Real* W = state + layout_.weights();
  kernels().column_products(shape().own_entries(), shape().neurons, W, W, norm2);
}

bool ClosedLoop::is_any_on_sphere(const Modes& modes) const {
  return std::any_of(modes.begin(), modes.begin() + shape().own_entries(), [](Real mode) { return mode != 0.0; });
}

void ClosedLoop::event_functions(const Real* state, const Real* inputs, const Modes& modes, Real tolerance,
                                 Signals& signals, Real* values) const {
  constexpr Real almost_zero = 1e-100;  // integrators stop watching a function that begins at zero
  if (!parameters_.strategy.robust) {
    std::fill_n(values, shape().own_entries(), -1.0);
    return;
  }
  weight_norms(state, values);
  if (is_any_on_sphere(modes)) {
    evaluate_errors(state, inputs, modes, signals);
    evaluate_network(state, signals);
  }
  for (std::size_t p = 0; p < at(shape().own_entries()); ++p) {
    const Real W_max = gains_.W_max[p];
    const Real height = values[p] / W_max - 1.0;
    const Real rate = 2.0 * gains_.beta[p] * signals.error[p] * signals.network[p] / W_max;  // of w'w / W_max, inside
    const Real value = modes[p] == 0 ? height : std::min(-tolerance - height, -rate);
    values[p] = value == 0.0 ? -almost_zero : value;
  }
}

int ClosedLoop::resolve_modes(const Real* state, const Real* inputs, Real tolerance, Signals& signals,
                              Modes& modes) const {
  AlignedVector values(at(shape().own_entries()));
  event_functions(state, inputs, modes, tolerance, signals, values.data());
  int changed = 0;
  for (std::size_t p = 0; p < values.size(); ++p) {
    if (!(values[p] > 0.0)) continue;
    modes[p] = modes[p] == 0 ? 1 : 0;
    ++changed;
  }
  return changed;
}

void ClosedLoop::project(const Modes& modes, const Real* inputs, Signals& signals, Real* state) const {
  if (is_any_on_sphere(modes)) {
    evaluate_errors(state, inputs, modes, signals);
    evaluate_network(state, signals);
  }
  for (int p = 0; p < shape().own_entries(); ++p) {
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
