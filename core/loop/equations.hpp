// The closed loop made of its terms, player by player, for numbers that are no reals: with derivatives (Dual) or as
// what they depend on (Dependencies). For reals ClosedLoop evaluates the same terms by kernels.
#pragma once

#include <algorithm>

#include "loop/input_layout.hpp"
#include "loop/terms.hpp"

namespace mixed_order_game {

/// All parameters of the loop as such numbers; switches are factors 0 and 1.
template <typename Scalar>
struct LoopNumbers {
  struct Edge {
    int other;  ///< k
    Scalar weight;
  };

  GainsAs<Scalar> gains;
  Scalar robust, perturbed;
  std::vector<Scalar> width, W_max;      ///< by player
  std::vector<Scalar> centers;           ///< as in RbfNetwork
  std::vector<Scalar> u_max;             ///< as in Parameters
  std::vector<std::vector<Edge>> edges;  ///< row h: a_ik of hosted player i = host(h)
  const CoefficientsAs<Scalar>* cost = nullptr;
  const CoefficientsAs<Scalar>* dynamics = nullptr;
  const CoefficientsAs<Scalar>* disturbance = nullptr;
};

template <typename Scalar>
class LoopEquations {
 public:
  explicit LoopEquations(const Parameters& parameters)
      : layout(parameters.shape),
        inputs(parameters),
        x(at(parameters.shape.actions())),
        reference(x.size()),
        shared(x.size()),
        gradient(at(parameters.shape.own_entries())),
        error(gradient.size()),
        network(gradient.size()),
        robust(gradient.size()),
        control(gradient.size()),
        activation(at(parameters.shape.hosts()) * at(parameters.shape.neurons)),
        dynamics(gradient.size()),
        disturbance(gradient.size()),
        parameters_(parameters),
        estimates_of_(at(parameters.shape.players)) {}

  /// What every hosted player computes from its own state, estimates and inputs: the signals up to the control.
  void evaluate_control(const LoopNumbers<Scalar>& number, const Scalar* state, const Scalar* input,
                        const Modes& modes);

  /// After it, the rates of the state at time t [s]; modes at own entries.
  void evaluate_rates(const LoopNumbers<Scalar>& number, const Scalar& t, const Scalar* state, const Scalar* input,
                      const Modes& modes, Scalar* rate);

  StateLayout layout;
  InputLayout inputs;
  std::vector<Scalar> x, reference, shared;  // at entry(i, l)
  // at own entries, but the activations at m H + h
  std::vector<Scalar> gradient, error, network, robust, control, activation, dynamics, disturbance;

 private:
  /// Whether a column on the sphere moves along it; only reals know.
  static bool is_outward(const Dual& e, const Dual& network) { return e.value * network.value >= 0.0; }
  static bool is_outward(const Dependencies&, const Dependencies&) { return true; }

  /// Terms of a family with what its switches hold; what a term depends on does not depend on that.
  void evaluate_gradient(const CoefficientsAs<Dual>& of, const Dual* y, const Modes& modes) {
    parameters_.cost->own_gradients(of, y, parameters_.shape.actions(), gradient.data(), held(0, modes));
  }
  void evaluate_gradient(const CoefficientsAs<Dependencies>& of, const Dependencies* y, const Modes&) {
    parameters_.cost->own_gradients(of, y, parameters_.shape.actions(), gradient.data());
  }
  void evaluate_drift(const LoopNumbers<Dual>& number, const Dual& t, const Modes& modes) {
    if (number.perturbed.value == 0.0) return set_drift_to_zero();  // also where it has no derivative
    parameters_.dynamics->values(*number.dynamics, x.data(), reference.data(), dynamics.data(), held(1, modes));
    parameters_.disturbance->values(*number.disturbance, t, disturbance.data(), held(2, modes));
  }
  void evaluate_drift(const LoopNumbers<Dependencies>& number, const Dependencies& t, const Modes&) {
    parameters_.dynamics->values(*number.dynamics, x.data(), reference.data(), dynamics.data());
    parameters_.disturbance->values(*number.disturbance, t, disturbance.data());
  }
  void set_drift_to_zero() {
    std::fill(dynamics.begin(), dynamics.end(), Scalar(0.0));
    std::fill(disturbance.begin(), disturbance.end(), Scalar(0.0));
  }
  const Real* held(int family, const Modes& modes) const { return modes.data() + parameters_.first_switch(family); }

  const Parameters& parameters_;
  std::vector<const Scalar*> estimates_of_;  // by player; scratch
};

template <typename Scalar>
void LoopEquations<Scalar>::evaluate_control(const LoopNumbers<Scalar>& number, const Scalar* state,
                                             const Scalar* input, const Modes& modes) {
  const Shape& shape = parameters_.shape;
  const GainsAs<Scalar>& gains = number.gains;
  const int n = shape.actions();
  const Scalar* y = state + layout.estimates();
  for (std::size_t k = 0; k < inputs.actions().size(); ++k) x[at(inputs.actions()[k])] = input[at(inputs.x()) + k];
  for (std::size_t k = 0; k < inputs.velocities().size(); ++k) {
    reference[at(inputs.velocities()[k])] = input[at(inputs.v()) + k];
  }
  for (std::size_t k = 0; k < inputs.heard().size(); ++k) {
    for (int l = 0; l < shape.dimension; ++l) {
      shared[at(shape.entry(inputs.heard()[k], l))] = input[inputs.xbar_of(static_cast<int>(k)) + l];
    }
  }
  evaluate_gradient(*number.cost, y, modes);
  for (int h = 0; h < shape.hosts(); ++h) {
    for (int m = 0; m < shape.neurons; ++m) {
      const int i = shape.host(h);
      activation[at(m * shape.hosts() + h)] = terms::activation(
          n, y + h * n,
          [&](int k) -> const Scalar& {
            const RbfNetwork& rbf = parameters_.rbf;
            return number.centers[rbf.diagonal ? at(m * shape.players + i) : rbf.row(m, i) * at(n) + at(k)];
          },
          number.width[at(i)]);
    }
  }
  for (int p = 0; p < shape.own_entries(); ++p) {
    const int i = shape.player_of_own(p);
    const bool second = shape.is_second_order(i);
    const std::size_t entry = at(shape.entry_of_own(p));
    if (layout.x_of(p) >= 0) x[entry] = state[layout.x_of(p)];
    if (layout.reference_of(p) >= 0) reference[entry] = state[layout.reference_of(p)];
    shared[entry] = terms::shared_signal(second, x[entry], reference[entry]);
    error[at(p)] = terms::error(second, x[entry], reference[entry], gains.k2[at(i)], gradient[at(p)]);
    Scalar sum = 0.0;
    for (int m = 0; m < shape.neurons; ++m) {
      sum += state[layout.weights_of(m) + p] * activation[at(m * shape.hosts() + p % shape.hosts())];
    }
    network[at(p)] = number.robust * sum;
    robust[at(p)] = number.robust * terms::robust_term(gains.delta[at(i)], gains.epsilon[at(i)], error[at(p)]);
    control[at(p)] =
        terms::control(second ? gains.k4[at(i)] : gains.k1[at(i)], error[at(p)], network[at(p)], robust[at(p)]);
    if (!number.u_max.empty() && std::isfinite(parameters_.u_max[entry])) {
      control[at(p)] = terms::within_bound(control[at(p)], number.u_max[entry]);
    }
  }
}

template <typename Scalar>
void LoopEquations<Scalar>::evaluate_rates(const LoopNumbers<Scalar>& number, const Scalar& t, const Scalar* state,
                                           const Scalar* input, const Modes& modes, Scalar* rate) {
  const Shape& shape = parameters_.shape;
  const GainsAs<Scalar>& gains = number.gains;
  const int n = shape.actions();
  evaluate_drift(number, t, modes);
  for (int p = 0; p < shape.own_entries(); ++p) {
    const int i = shape.player_of_own(p);
    const bool second = shape.is_second_order(i);
    // x' or v' = u + g + d
    const Scalar driven =
        control[at(p)] + number.perturbed * (dynamics[at(p)] + disturbance[at(p)]) + input[inputs.d_ext() + p];
    const int to_x = layout.x_of(p);
    const int to_reference = layout.reference_of(p);
    if (to_x >= 0) rate[to_x] = second ? reference[at(shape.entry_of_own(p))] : driven;
    if (to_reference >= 0) {
      rate[to_reference] = second ? driven : terms::reference_rate(gains.k2[at(i)], gradient[at(p)]);
    }

    const bool on_sphere = modes[at(p)] != 0 && is_outward(error[at(p)], network[at(p)]);
    const Scalar r = on_sphere ? network[at(p)] / number.W_max[at(i)] : Scalar(0.0);
    for (int m = 0; m < shape.neurons; ++m) {
      const int w = layout.weights_of(m) + p;
      rate[w] = number.robust * terms::weight_rate(gains.beta[at(i)], error[at(p)],
                                                   activation[at(m * shape.hosts() + p % shape.hosts())], r, state[w]);
    }
  }
  // y_ij' = -k3_i (sum_k a_ik (y_ij - y_kj) + a_ij (y_ij - xbar_j))
  for (int h = 0; h < shape.hosts(); ++h) estimates_of_[at(shape.host(h))] = state + layout.estimates_of(h);
  for (std::size_t k = 0; k < inputs.heard().size(); ++k) {
    estimates_of_[at(inputs.heard()[k])] = input + inputs.y_of(static_cast<int>(k));
  }
  for (int h = 0; h < shape.hosts(); ++h) {
    const Scalar* own = state + layout.estimates_of(h);
    Scalar* own_rate = rate + layout.estimates_of(h);
    for (int p = 0; p < n; ++p) {
      Scalar sum = 0.0;
      for (const auto& [k, weight] : number.edges[at(h)]) {
        sum += weight * (own[p] - estimates_of_[at(k)][p]);
        if (k == shape.player_of(p)) sum += weight * (own[p] - shared[at(p)]);
      }
      own_rate[p] = -gains.k3[at(shape.host(h))] * sum;
    }
  }
}

}  // namespace mixed_order_game
