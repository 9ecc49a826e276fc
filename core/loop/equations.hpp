// The closed loop made of its terms, player by player, for numbers that are no reals: with derivatives (Dual) or as
// what they depend on (Dependencies). For reals ClosedLoop evaluates the same terms by kernels.
#pragma once

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
  std::vector<std::vector<Edge>> edges;  ///< row i: a_ik
  const CoefficientsAs<Scalar>* cost = nullptr;
  const CoefficientsAs<Scalar>* dynamics = nullptr;
  const CoefficientsAs<Scalar>* disturbance = nullptr;
};

template <typename Scalar>
class LoopEquations {
 public:
  explicit LoopEquations(const Parameters& parameters)
      : layout(parameters.shape),
        shared(at(parameters.shape.actions())),
        gradient(shared.size()),
        error(shared.size()),
        network(shared.size()),
        robust(shared.size()),
        control(shared.size()),
        activation(at(parameters.shape.players) * at(parameters.shape.neurons)),
        dynamics(shared.size()),
        disturbance(shared.size()),
        parameters_(parameters) {}

  /// What every player computes from its own state and estimates: the signals up to the control.
  void evaluate_control(const LoopNumbers<Scalar>& number, const Scalar* state);

  /// After it, the rates of the state at time t [s]; d_ext and modes at entry(i, l).
  void evaluate_rates(const LoopNumbers<Scalar>& number, const Scalar& t, const Scalar* state, const Scalar* d_ext,
                      const Modes& modes, Scalar* rate);

  StateLayout layout;
  // at entry(i, l), but the activations at m N + i
  std::vector<Scalar> shared, gradient, error, network, robust, control, activation, dynamics, disturbance;

 private:
  /// Whether a column on the sphere moves along it; only reals know.
  static bool is_outward(const Dual& e, const Dual& network) { return e.value * network.value >= 0.0; }
  static bool is_outward(const Dependencies&, const Dependencies&) { return true; }

  const Parameters& parameters_;
};

template <typename Scalar>
void LoopEquations<Scalar>::evaluate_control(const LoopNumbers<Scalar>& number, const Scalar* state) {
  const Shape& shape = parameters_.shape;
  const GainsAs<Scalar>& gains = number.gains;
  const int n = shape.actions();
  const Scalar* y = state + layout.estimates();
  parameters_.cost->own_gradients(*number.cost, y, n, gradient.data());
  for (int i = 0; i < shape.players; ++i) {
    for (int m = 0; m < shape.neurons; ++m) {
      activation[at(m * shape.players + i)] = terms::activation(
          n, y + i * n,
          [&](int k) -> const Scalar& {
            const RbfNetwork& rbf = parameters_.rbf;
            return number.centers[rbf.diagonal ? at(m * shape.players + i) : rbf.row(m, i) * at(n) + at(k)];
          },
          number.width[at(i)]);
    }
  }
  for (int p = 0; p < n; ++p) {
    const int i = shape.player_of(p);
    const bool second = shape.is_second_order(i);
    const Scalar& x = state[layout.x() + p];
    const Scalar& reference = state[layout.reference() + p];
    shared[at(p)] = terms::shared_signal(second, x, reference);
    error[at(p)] = terms::error(second, x, reference, gains.k2[at(i)], gradient[at(p)]);
    Scalar sum = 0.0;
    for (int m = 0; m < shape.neurons; ++m) {
      sum += state[layout.weights_of(m) + p] * activation[at(m * shape.players + i)];
    }
    network[at(p)] = number.robust * sum;
    robust[at(p)] = number.robust * terms::robust_term(gains.delta[at(i)], gains.epsilon[at(i)], error[at(p)]);
    control[at(p)] =
        terms::control(second ? gains.k4[at(i)] : gains.k1[at(i)], error[at(p)], network[at(p)], robust[at(p)]);
  }
}

template <typename Scalar>
void LoopEquations<Scalar>::evaluate_rates(const LoopNumbers<Scalar>& number, const Scalar& t, const Scalar* state,
                                           const Scalar* d_ext, const Modes& modes, Scalar* rate) {
  const Shape& shape = parameters_.shape;
  const GainsAs<Scalar>& gains = number.gains;
  const int n = shape.actions();
  parameters_.dynamics->values(*number.dynamics, state + layout.x(), state + layout.reference(), dynamics.data());
  parameters_.disturbance->values(*number.disturbance, t, disturbance.data());
  for (int p = 0; p < n; ++p) {
    const int i = shape.player_of(p);
    const bool second = shape.is_second_order(i);
    // x' or v' = u + g + d
    const Scalar driven = control[at(p)] + number.perturbed * (dynamics[at(p)] + disturbance[at(p)]) + d_ext[p];
    rate[layout.x() + p] = second ? state[layout.reference() + p] : driven;
    rate[layout.reference() + p] = second ? driven : terms::reference_rate(gains.k2[at(i)], gradient[at(p)]);

    const bool on_sphere = modes[at(p)] != 0 && is_outward(error[at(p)], network[at(p)]);
    const Scalar r = on_sphere ? network[at(p)] / number.W_max[at(i)] : Scalar(0.0);
    for (int m = 0; m < shape.neurons; ++m) {
      const int w = layout.weights_of(m) + p;
      rate[w] = number.robust *
                terms::weight_rate(gains.beta[at(i)], error[at(p)], activation[at(m * shape.players + i)], r, state[w]);
    }
  }
  // y_ij' = -k3_i (sum_k a_ik (y_ij - y_kj) + a_ij (y_ij - xbar_j))
  for (int i = 0; i < shape.players; ++i) {
    const Scalar* own = state + layout.estimates_of(i);
    Scalar* own_rate = rate + layout.estimates_of(i);
    for (int p = 0; p < n; ++p) {
      Scalar sum = 0.0;
      for (const auto& [k, weight] : number.edges[at(i)]) {
        sum += weight * (own[p] - state[layout.estimates_of(k) + p]);
        if (k == shape.player_of(p)) sum += weight * (own[p] - shared[at(p)]);
      }
      own_rate[p] = -gains.k3[at(i)] * sum;
    }
  }
}

}  // namespace mixed_order_game
