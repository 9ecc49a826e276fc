// The closed loop once more, one scalar formula after the other as the paper states them, for any scalar type: with
// complex numbers it gives derivatives by the complex step. Independent of the core except for the flat state vector.
#pragma once

#include <cmath>
#include <complex>

#include "random_game.hpp"

namespace mixed_order_game::testing {

template <typename Scalar>
using RowsOf = std::vector<std::vector<Scalar>>;
template <typename Scalar>
using BlocksOf = std::vector<RowsOf<Scalar>>;

/// State, or its rate of change, with the paper's indices from zero.
template <typename Scalar>
struct LoopState {
  RowsOf<Scalar> x;          ///< [i][l]
  RowsOf<Scalar> reference;  ///< [i][l]: z_i (order 1) or v_i (order 2)
  BlocksOf<Scalar> y;        ///< [i][j][l]
  BlocksOf<Scalar> W;        ///< [i][m][l]

  explicit LoopState(const PlainGame& game)
      : x(game.players, std::vector<Scalar>(game.dimension)),
        reference(x),
        y(game.players, x),
        W(game.players, RowsOf<Scalar>(game.neurons, std::vector<Scalar>(game.dimension))) {}

  /// Calls visit(number) for every number in the order of the core's state vector: x | z or v | y | W, each part in
  /// rows of N D entries with the coordinates outermost.
  template <typename Visit>
  void for_each(Visit visit) {
    const std::size_t N = x.size();
    const std::size_t D = x[0].size();
    for (RowsOf<Scalar>* part : {&x, &reference}) {
      for (std::size_t l = 0; l < D; ++l) {
        for (std::size_t i = 0; i < N; ++i) visit((*part)[i][l]);
      }
    }
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t l = 0; l < D; ++l) {
        for (std::size_t j = 0; j < N; ++j) visit(y[i][j][l]);
      }
    }
    for (std::size_t m = 0; m < W[0].size(); ++m) {
      for (std::size_t l = 0; l < D; ++l) {
        for (std::size_t i = 0; i < N; ++i) visit(W[i][m][l]);
      }
    }
  }

  [[nodiscard]] std::vector<Scalar> flat() {
    std::vector<Scalar> numbers;
    for_each([&](Scalar& number) { numbers.push_back(number); });
    return numbers;
  }
  void set_flat(const std::vector<Scalar>& numbers) {
    std::size_t k = 0;
    for_each([&](Scalar& number) { number = numbers[k++]; });
  }
};

/// Entries [i][l] in the core's order of a joint action.
inline Numbers flat_actions(const Rows& rows) {
  Numbers numbers;
  for (std::size_t l = 0; l < rows[0].size(); ++l) {
    for (const Numbers& row : rows) numbers.push_back(row[l]);
  }
  return numbers;
}

/// The variables inside the loop, [i][l] unless said otherwise.
template <typename Scalar>
struct LoopSignals {
  RowsOf<Scalar> shared, gradient, error, network, robust, dynamics, disturbance, control;
  RowsOf<Scalar> activation;  ///< [i][m]
};

/// f_i(x)
template <typename Scalar>
Scalar reference_cost(const PlainGame& game, std::size_t i, const RowsOf<Scalar>& x) {
  Scalar f = game.constant[i];
  for (std::size_t l = 0; l < game.dimension; ++l) {
    f += game.quadratic[i] * x[i][l] * x[i][l] + game.linear[i][l] * x[i][l];
    for (std::size_t j = 0; j < game.players; ++j) f += game.coupling[i][j] * (x[i][l] - x[j][l]) * (x[i][l] - x[j][l]);
  }
  return f;
}

/// The state's rate of change. on_sphere[i][l] says that the weight column (i, l) is projected where e w'S >= 0. With
/// frozen_activation, S_i is computed from the real part of y_i alone, which removes its derivative.
template <typename Scalar>
LoopState<Scalar> reference_rate(const PlainGame& game, double t, const LoopState<Scalar>& state, const Rows& d_ext,
                                 const std::vector<std::vector<int>>& on_sphere, LoopSignals<Scalar>* inside = nullptr,
                                 bool frozen_activation = false) {
  using std::exp;
  using std::tanh;
  const double K = 0.2784645427610738;  // K = exp(-(K + 1))
  const std::size_t N = game.players;
  const std::size_t D = game.dimension;
  const std::size_t q = game.neurons;
  const auto& [x, reference, y, W] = state;
  LoopState<Scalar> rate(game);
  const RowsOf<Scalar> zero(N, std::vector<Scalar>(D));
  LoopSignals<Scalar> s{zero, zero, zero, zero, zero, zero, zero, zero, RowsOf<Scalar>(N, std::vector<Scalar>(q))};

  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t l = 0; l < D; ++l) s.shared[i][l] = game.order[i] == 1 ? reference[i][l] : x[i][l];
  }
  for (std::size_t i = 0; i < N; ++i) {
    // S_im(y_i) = exp(-sum over j,l of (y_ijl - c_m)^2 / rho^2)
    for (std::size_t m = 0; m < q; ++m) {
      Scalar sum{};
      for (std::size_t j = 0; j < N; ++j) {
        for (std::size_t l = 0; l < D; ++l) {
          const Scalar seen = frozen_activation ? Scalar(std::real(y[i][j][l])) : y[i][j][l];
          sum += (seen - game.center(i, m, j, l)) * (seen - game.center(i, m, j, l));
        }
      }
      s.activation[i][m] = exp(-sum / (game.width[i] * game.width[i]));
    }
    for (std::size_t l = 0; l < D; ++l) {
      // grad_i f_i(y_i), by differentiating f_i term by term
      Scalar gradient = 2.0 * game.quadratic[i] * y[i][i][l] + game.linear[i][l];
      for (std::size_t j = 0; j < N; ++j) gradient += 2.0 * game.coupling[i][j] * (y[i][i][l] - y[i][j][l]);
      const Scalar e = game.order[i] == 1 ? x[i][l] - reference[i][l] : reference[i][l] + game.k2[i] * gradient;
      Scalar network{};
      for (std::size_t m = 0; m < q; ++m) network += W[i][m][l] * s.activation[i][m];
      Scalar phi = game.delta[i] * tanh(K * game.delta[i] * e / game.epsilon[i]);
      if (!game.robust) network = phi = Scalar{};
      Scalar g{};
      for (std::size_t j = 0; j < N; ++j) g += game.G[i][j][l] * x[j][l] + game.H[i][j][l] * x[j][l] * x[j][l];
      Scalar d = game.bias[i][l] + game.amplitude[i][l] * std::sin(game.frequency[i][l] * t + game.phase[i][l]);
      if (!game.perturbed) g = d = Scalar{};
      d += d_ext[i][l];
      const Scalar u = -(game.order[i] == 1 ? game.k1[i] : game.k4[i]) * e - network - phi;

      if (game.order[i] == 1) {
        rate.x[i][l] = u + g + d;
        rate.reference[i][l] = -game.k2[i] * gradient;
      } else {
        rate.x[i][l] = reference[i][l];
        rate.reference[i][l] = u + g + d;
      }
      for (std::size_t m = 0; m < q && game.robust; ++m) {
        rate.W[i][m][l] = game.beta[i] * s.activation[i][m] * e;
        if (on_sphere[i][l] != 0 && std::real(e * network) >= 0.0) {
          rate.W[i][m][l] -= game.beta[i] * e * network / game.W_max[i] * W[i][m][l];
        }
      }
      s.gradient[i][l] = gradient;
      s.error[i][l] = e;
      s.network[i][l] = network;
      s.robust[i][l] = phi;
      s.dynamics[i][l] = g;
      s.disturbance[i][l] = d;
      s.control[i][l] = u;
    }
    // y_ij' = -k3 ( sum_k a_ik (y_ij - y_kj) + a_ij (y_ij - xbar_j) )
    for (std::size_t j = 0; j < N; ++j) {
      for (std::size_t l = 0; l < D; ++l) {
        Scalar sum = game.adjacency[i][j] * (y[i][j][l] - s.shared[j][l]);
        for (std::size_t k = 0; k < N; ++k) sum += game.adjacency[i][k] * (y[i][j][l] - y[k][j][l]);
        rate.y[i][j][l] = -game.k3[i] * sum;
      }
    }
  }
  if (inside != nullptr) *inside = s;
  return rate;
}

/// A random state; every second weight column lies on the sphere w'w = W_max, where on_sphere says so.
inline LoopState<double> random_state(const PlainGame& game, RandomNumbers& random,
                                      std::vector<std::vector<int>>& on_sphere) {
  LoopState<double> state(game);
  random.fill(state.x, -4.0, 4.0);
  random.fill(state.reference, -2.0, 2.0);
  random.fill(state.y, -3.0, 3.0);
  random.fill(state.W, -1.0, 1.0);
  on_sphere.assign(game.players, std::vector<int>(game.dimension));
  bool on = false;
  for (std::size_t i = 0; i < game.players; ++i) {
    for (std::size_t l = 0; l < game.dimension; ++l) {
      on = !on;
      double norm2 = 0.0;
      for (std::size_t m = 0; m < game.neurons; ++m) norm2 += state.W[i][m][l] * state.W[i][m][l];
      const double factor = std::sqrt((on ? 1.0 : random.between(0.05, 0.9)) * game.W_max[i] / norm2);
      for (std::size_t m = 0; m < game.neurons; ++m) state.W[i][m][l] *= factor;
      on_sphere[i][l] = on ? 1 : 0;
    }
  }
  return state;
}

}  // namespace mixed_order_game::testing
