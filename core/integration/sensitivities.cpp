#include "integration/sensitivities.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "errors.hpp"
#include "kernels/kernels.hpp"
#include "loop/failure.hpp"

namespace mixed_order_game {

namespace {

bool any(const std::vector<Real>& values) {
  return std::any_of(values.begin(), values.end(), [](Real value) { return value != 0.0; });
}

bool any(const Coefficients& coefficients) {
  for (std::size_t k = 0; k < coefficients.declared().size(); ++k) {
    if (any(coefficients[static_cast<int>(k)])) return true;
    for (const auto& [slot, value] : coefficients.terms(static_cast<int>(k))) {
      if (value != 0.0) return true;
    }
  }
  return false;
}

bool any(const CommunicationGraph& graph) {
  for (int i = 0; i < graph.players(); ++i) {
    for (int j = 0; j < graph.players(); ++j) {
      if (graph.weight(i, j) != 0.0) return true;
    }
  }
  return false;
}

}  // namespace

Sensitivities::Sensitivities(const ClosedLoop& loop, const Inputs& inputs, std::vector<Parameters> directions)
    : loop_(loop),
      inputs_(inputs),
      size_(loop.layout().size()),
      newton_(make_structured_newton()),
      jacobian_(loop),
      tangent_(loop),
      conditions_(loop),
      slides_(at(loop.shape().own_entries())),
      error_(slides_.size()),
      network_(slides_.size()),
      signals_(loop.shape()),
      input_values_(at(loop.inputs().size())),
      rate_(at(size_)),
      rate_before_(rate_.size()),
      predicted_(rate_.size()),
      value_(rate_.size()),
      activation_change_(signals_.activation.size()),
      network_change_(slides_.size()),
      moment_(slides_.size()),
      sum_(slides_.size()) {
  for (Parameters& along : directions) directions_.push_back(classified(std::move(along)));
  for (Node& node : nodes_) node.values.assign(directions_.size(), AlignedVector(at(size_)));
}

Sensitivities::Direction Sensitivities::classified(Parameters along) {
  const Gains& gains = along.gains;
  const auto families = along.families();
  return {.along = along,
          .changes_control = any(gains.k1) || any(gains.k2) || any(gains.k4) || any(gains.delta) || any(gains.epsilon),
          .changes_weights = any(gains.k2) || any(gains.beta),
          .changes_estimates = any(gains.k3),
          .changes_others =
              any(along.graph) || any(along.rbf.centers) || any(along.rbf.width) || any(along.rbf.W_max) ||
              any(along.u_max) || any(along.named.values) ||
              std::any_of(families.begin(), families.end(), [](const auto* each) { return any(each->coefficients); })};
}

void Sensitivities::begin(Real t) {
  jacobian_.refresh();
  newton_->refresh(jacobian_);
  order_ = count_ = 1;
  has_columns_ = false;
  Node& first = nodes_[at(newest_)];
  first.t = t;
  for (std::size_t k = 0; k < directions_.size(); ++k) {
    loop_.initial_state(directions_[k].along.initial, first.values[k].data());
  }
}

/// Of the polynomial through the last nodes, at time t.
Sensitivities::Weights Sensitivities::interpolation(Real t, int points) const {
  Weights weights{};
  for (int j = 0; j < points; ++j) {
    weights[at(j)] = 1.0;
    for (int i = 0; i < points; ++i) {
      if (i != j) weights[at(j)] *= (t - node(i).t) / (node(j).t - node(i).t);
    }
  }
  return weights;
}

/// Entries first to last of the weighted sum of nodes, of which the newest has this age.
void Sensitivities::combine(const Weights& weights, int points, int age, int k, int first, int last, Real* sum) const {
  const auto values = [&](int j) { return node(j + age).values[at(k)].data() + first; };
  const Kernels& kernel = kernels();
  const int n = last - first;
  if (points == 1) return kernel.linear_sum(n, weights[0], values(0), 0.0, values(0), sum);
  kernel.linear_sum(n, weights[0], values(0), weights[1], values(1), sum);
  for (int j = 2; j < points; ++j) kernel.linear_sum(n, 1.0, sum, weights[at(j)], values(j), sum);
}

void Sensitivities::linearize(Real t, const Real* state, const Modes& modes) {
  inputs_.values(t, input_values_.data());
  loop_.evaluate(t, state, input_values_.data(), modes, signals_, rate_.data());
  jacobian_.linearize(state, loop_.plants(state, input_values_.data(), signals_), signals_, modes);
}

void Sensitivities::step(Real t, int order, const Real* state, const Modes& modes) {
  order_ = std::min({order, count_, highest_order});
  const int points = std::min(order_ + 1, count_);
  const Weights extrapolation = interpolation(t, points);
  // gamma c_j, of the polynomial through the new value and the last ones
  Real c_0 = 0.0;
  for (int j = 0; j < order_; ++j) c_0 += 1.0 / (t - node(j).t);
  const Real gamma = 1.0 / c_0;
  Weights past = interpolation(t, order_);
  for (int j = 0; j < order_; ++j) past[at(j)] *= gamma / (t - node(j).t);

  linearize(t, state, modes);
  if (!newton_->factor(jacobian_, gamma)) {
    throw IntegrationError(
        "the equation of the sensitivities is singular at t = " + number_text(loop_.time_origin() + t, 15) + " s");
  }
  find_kinks(t);
  newest_ = (newest_ + static_cast<int>(nodes_.size()) - 1) % static_cast<int>(nodes_.size());
  count_ = std::min(count_ + 1, static_cast<int>(nodes_.size()));
  nodes_[at(newest_)].t = t;
  const StateLayout& layout = loop_.layout();
  for (int k = 0; k < count(); ++k) {
    Real* s = nodes_[at(newest_)].values[at(k)].data();
    combine(past, order_, 1, k, 0, size_, s);
    combine(extrapolation, points, 1, k, layout.estimates(), layout.weights(), predicted_.data());
    add_parameter_rates(directions_[at(k)], t, state, modes, gamma, s);
    add_activation_rates(state, predicted_.data(), gamma, s);
    newton_->solve(s);
    if (!kinks_.empty()) pass_kinks(k, t, gamma, state);
  }
}

/// Compares columns at time t, where the loop has been linearized, with those where the last step ended.
void Sensitivities::find_kinks(Real t) {
  kinks_.clear();
  const Real h = t - std::exchange(columns_time_, t);
  const bool compares = std::exchange(has_columns_, true);
  for (std::size_t p = 0; p < slides_.size(); ++p) {
    const bool slides = jacobian_.inverse_bound[p] != 0.0;
    const bool slid = std::exchange(slides_[p], slides ? 1 : 0) != 0;
    const Real e = std::exchange(error_[p], signals_.error[p]);
    const Real s = std::exchange(network_[p], signals_.network[p]);
    if (!compares || slides == slid) continue;
    const bool error_turned = e * error_[p] < 0.0;
    const Real before = error_turned ? e : s;
    const Real now = error_turned ? error_[p] : network_[p];
    if (before * now < 0.0) {
      kinks_.push_back({t + h * now / (before - now), static_cast<int>(p), error_turned, slid});
    }
  }
}

/// Values before a kink at t_k are made such that the polynomial through them goes on as if J had always been what it
/// is after it: they take on (t_j - t_k) times the jump of s' there,
///     beta_p d(e w'S) / W_max w,  the part that sliding removes from w'.
/// The last step, which was made with values as they were, takes on what it then would have been.
void Sensitivities::pass_kinks(int k, Real t, Real gamma, const Real* state) {
  AlignedVector& s = nodes_[at(newest_)].values[at(k)];
  std::fill(value_.begin(), value_.end(), 0.0);
  for (const Kink& kink : kinks_) {
    const std::size_t p = at(kink.column);
    const Real rate = (kink.ceased ? 1.0 : -1.0) * loop_.gains().beta[p] / loop_.gains().W_max[p] *
                      turning_along(kink, k, state, s.data());
    for (int m = 0; m < loop_.shape().neurons; ++m) {
      const std::size_t w = at(loop_.layout().weights_of(m)) + p;
      const Real jump = rate * state[w];
      value_[w] = (t - kink.t - gamma) * jump;  // -gamma sum_j c_j (t_j - t_k) jump
      for (int j = 1; j < count_; ++j) {
        Node& node = nodes_[at((newest_ + j) % static_cast<int>(nodes_.size()))];
        node.values[at(k)][w] += (node.t - kink.t) * jump;
      }
    }
  }
  newton_->solve(value_.data());
  kernels().linear_sum(size_, 1.0, s.data(), 1.0, value_.data(), s.data());
}

/// How e w'S changes at a kink, by the factor that is zero there; the activations' changes are those of the last
/// add_activation_rates.
Real Sensitivities::turning_along(const Kink& kink, int k, const Real* state, const Real* s) const {
  const Shape& shape = loop_.shape();
  const StateLayout& layout = loop_.layout();
  const int p = kink.column;
  const int i = shape.player_of_own(p);
  if (!kink.error_turned) {
    Real network = 0.0;
    for (int m = 0; m < shape.neurons; ++m) {
      const std::size_t entry = at(m * shape.own_entries() + p);
      const int w = layout.weights_of(m) + p;
      network += s[w] * signals_.activation[entry] + state[w] * activation_change_[entry];
    }
    return signals_.error[at(p)] * network;
  }
  if (!shape.is_second_order(i)) return signals_.network[at(p)] * (s[layout.x_of(p)] - s[layout.reference_of(p)]);
  const SparseRows& hessian = loop_.parameters().cost->hessian_pattern();
  const Real* dy = s + layout.estimates_of(i);
  Real gradient = 0.0;
  for (int entry = hessian.start[at(p)]; entry < hessian.start[at(p + 1)]; ++entry) {
    gradient += jacobian_.hessian[at(entry)] * dy[hessian.column[at(entry)]];
  }
  const Real k2_along = directions_[at(k)].along.gains.k2[at(i)];
  return signals_.network[at(p)] *
         (s[layout.reference_of(p)] + loop_.gains().k2[at(p)] * gradient + k2_along * signals_.gradient[at(p)]);
}

void Sensitivities::pass_event(const Event& event) {
  if (!event.restarts) {
    if (event.ends_step) return;
    newest_ = (newest_ + 1) % static_cast<int>(nodes_.size());  // the step's end is still to come
    --count_;
    return;
  }
  inputs_.values(event.t, input_values_.data());
  loop_.evaluate(event.t, event.state, input_values_.data(), event.modes_before, signals_, rate_before_.data());
  loop_.evaluate(event.t, event.state, input_values_.data(), event.modes, signals_, rate_.data());
  for (std::size_t k = 0; k < directions_.size(); ++k) {
    AlignedVector& s = nodes_[at(newest_)].values[k];
    const Real delay =
        conditions_.event_time_along(event.t, event.state, input_values_.data(), event.modes_before, event.modes,
                                     rate_before_.data(), s.data(), directions_[k].along.rbf.W_max);
    if (delay == 0.0) continue;
    for (std::size_t m = 0; m < s.size(); ++m) s[m] += (rate_before_[m] - rate_[m]) * delay;
  }
  order_ = count_ = 1;
  has_columns_ = false;
}

const Real* Sensitivities::at_time(Real t, int k) {
  const int points = std::min(order_ + 1, count_);
  combine(interpolation(t, points), points, 0, k, 0, size_, value_.data());
  return value_.data();
}

/// df/dp times a factor.
void Sensitivities::add_parameter_rates(const Direction& direction, Real t, const Real* state, const Modes& modes,
                                        Real factor, Real* b) {
  if (!direction.changes_others) return add_gain_rates(direction, state, factor, b);
  tangent_.clear();
  tangent_.follow(direction.along, t, state, input_values_.data(), modes);
  kernels().linear_sum(size_, 1.0, b, factor, tangent_.rate.data(), b);
}

/// The same of gains alone, of which every column takes only its own.
void Sensitivities::add_gain_rates(const Direction& direction, const Real* state, Real factor, Real* b) const {
  const Shape& shape = loop_.shape();
  const StateLayout& layout = loop_.layout();
  const Gains& gains = loop_.parameters().gains;
  const Gains& along = direction.along.gains;
  const bool robust = loop_.parameters().strategy.robust;
  if (direction.changes_estimates) {
    for (int i = 0; i < shape.players; ++i) {  // y' is linear in k3
      const Real part = factor * along.k3[at(i)] / gains.k3[at(i)];
      const int first = layout.estimates_of(i);
      for (int m = first; m < first + shape.actions(); ++m) b[m] += part * rate_[at(m)];
    }
  }
  if (!direction.changes_control && !direction.changes_weights) return;
  for (int p = 0; p < shape.own_entries(); ++p) {
    const std::size_t i = at(shape.player_of_own(p));
    const bool second = shape.is_second_order(static_cast<int>(i));
    const Dual gradient = signals_.gradient[at(p)];
    const Dual k2(gains.k2[i], along.k2[i]);
    Dual e = signals_.error[at(p)];
    e.along = terms::error<Dual>(second, 0.0, 0.0, k2, gradient).along;
    if (direction.changes_control) {
      const Dual k = second ? Dual(gains.k4[i], along.k4[i]) : Dual(gains.k1[i], along.k1[i]);
      const Dual phi = !robust ? Dual(0.0)
                               : terms::robust_term(Dual(gains.delta[i], along.delta[i]),
                                                    Dual(gains.epsilon[i], along.epsilon[i]), e);
      const Dual u = terms::control(k, e, Dual(signals_.network[at(p)]), phi);
      b[second ? layout.reference_of(p) : layout.x_of(p)] += factor * jacobian_.follows[at(p)] * u.along;
      if (!second) b[layout.reference_of(p)] += factor * terms::reference_rate(k2, gradient).along;
    }
    if (!direction.changes_weights || !robust) continue;
    const Dual beta(gains.beta[i], along.beta[i]);
    const Real push = factor * terms::weight_rate<Dual>(beta, e, 1.0, 0.0, 0.0).along;  // (beta e)'
    for (int m = 0; m < shape.neurons; ++m) {
      const int w = layout.weights_of(m) + p;
      b[w] += push * (signals_.activation[at(m * shape.own_entries() + p)] - signals_.radial[at(p)] * state[w]);
    }
  }
}

/// The part of J that the solver leaves out, by way of the activations: changes dy of the estimates change the rates so
/// much, times a factor.
void Sensitivities::add_activation_rates(const Real* state, const Real* dy, Real factor, Real* b) {
  if (!loop_.parameters().strategy.robust) return;
  const Shape& shape = loop_.shape();
  const StateLayout& layout = loop_.layout();
  const RbfNetwork& rbf = loop_.parameters().rbf;
  const GainRows& gains = loop_.gains();
  const int n = shape.actions();
  const Real* y = state + layout.estimates();
  const Real* W = state + layout.weights();
  Real* dW = b + layout.weights();

  // dS_im = -2 / rho_i^2 S_im (y_i - c_m)'dy_i
  if (rbf.diagonal) {
    for (int i = 0; i < shape.players; ++i) {
      Real moment = 0.0;
      Real sum = 0.0;
      for (int k = 0; k < n; ++k) {
        moment += y[i * n + k] * dy[i * n + k];
        sum += dy[i * n + k];
      }
      const Real scale = -2.0 * gains.sharpness_of_activations[at(i)];
      for (int p = i; p < n; p += shape.players) {
        moment_[at(p)] = scale * moment;
        sum_[at(p)] = scale * sum;
      }
    }
  }
  for (int m = 0; m < shape.neurons; ++m) {
    const Real* S = signals_.activation.data() + m * n;
    Real* dS = activation_change_.data() + m * n;
    if (rbf.diagonal) {
      const Real* centers = rbf.centers.data() + m * shape.players;
      for (int first = 0; first < n; first += shape.players) {
        for (int i = 0; i < shape.players; ++i) {
          const int p = first + i;
          dS[p] = S[p] * (moment_[at(p)] - centers[i] * sum_[at(p)]);
        }
      }
      continue;
    }
    for (int i = 0; i < shape.players; ++i) {
      const Real* center = rbf.centers.data() + rbf.row(m, i) * at(n);
      Real moment = 0.0;
      for (int k = 0; k < n; ++k) moment += (y[i * n + k] - center[k]) * dy[i * n + k];
      for (int p = i; p < n; p += shape.players) {
        dS[p] = -2.0 * gains.sharpness_of_activations[at(i)] * moment * S[p];
      }
    }
  }

  // u = ... - w'S and w' = beta e (S - r w), r = w'S / W_max on the sphere
  kernels().column_products(n, shape.neurons, W, activation_change_.data(), network_change_.data());
  for (int p = 0; p < n; ++p) {
    const bool second = shape.is_second_order(shape.player_of_own(p));
    b[second ? layout.reference_of(p) : layout.x_of(p)] -= factor * jacobian_.follows[at(p)] * network_change_[at(p)];
    moment_[at(p)] = factor * gains.beta[at(p)] * signals_.error[at(p)];
    sum_[at(p)] = network_change_[at(p)] * jacobian_.inverse_bound[at(p)];
  }
  for (int m = 0; m < shape.neurons; ++m) {
    for (int p = 0; p < n; ++p) {
      const int w = m * n + p;
      dW[w] += moment_[at(p)] * (activation_change_[at(w)] - sum_[at(p)] * W[w]);
    }
  }
}

}  // namespace mixed_order_game
