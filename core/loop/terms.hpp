// The equations of the closed loop, each once, for any kind of number: reals, numbers with a derivative (Dual) and
// what a value depends on (Dependencies). The names are those of notation.md.
//
// For reals the kernels evaluate the same terms for all players at once; tests hold the two against each other.
#pragma once

#include <cmath>
#include <vector>

#include "game/parameters.hpp"
#include "loop/signals.hpp"
#include "loop/state_layout.hpp"
#include "numbers/dependencies.hpp"
#include "numbers/dual.hpp"

namespace mixed_order_game {

/// K = exp(-(K + 1)), the constant of the robust term's bound.
inline constexpr Real robust_term_constant = 0.2784645427610738;

namespace terms {

using std::exp;
using std::tanh;

/// xbar_i = z_i (order 1) or x_i (order 2)
template <typename Scalar>
Scalar shared_signal(bool second, const Scalar& x, const Scalar& reference) {
  return second ? x : reference;
}

/// e_i = x_i - z_i (order 1) or v_i + k2 grad_i f_i(y_i) (order 2)
template <typename Scalar>
Scalar error(bool second, const Scalar& x, const Scalar& reference, const Scalar& k2, const Scalar& gradient) {
  return second ? reference + k2 * gradient : x - reference;
}

/// phi_i = delta tanh(K delta e_i / epsilon)
template <typename Scalar>
Scalar robust_term(const Scalar& delta, const Scalar& epsilon, const Scalar& e) {
  return delta * tanh(robust_term_constant * delta / epsilon * e);
}

/// S_im = exp(-sum over j,l of (y_ijl - c_m)^2 / rho^2); center(k) is entry k of the centre.
template <typename Scalar, typename Center>
Scalar activation(int entries, const Scalar* y, Center center, const Scalar& width) {
  Scalar squares = 0.0;
  for (int k = 0; k < entries; ++k) {
    const Scalar distance = y[k] - center(k);
    squares += distance * distance;
  }
  return exp(-(squares / (width * width)));
}

/// u_i = -k e_i - W_i' S_i - phi_i with k = k1 (order 1) or k4 (order 2)
template <typename Scalar>
Scalar control(const Scalar& k, const Scalar& e, const Scalar& network, const Scalar& robust) {
  return -k * e - network - robust;
}

/// The control that reaches the plant: u within [-u_max, u_max].
inline Real within_bound(Real u, Real u_max) { return u > u_max ? u_max : u < -u_max ? -u_max : u; }
inline Dual within_bound(const Dual& u, const Dual& u_max) {
  return u.value > u_max.value ? u_max : u.value < -u_max.value ? -u_max : u;
}
inline Dependencies within_bound(const Dependencies& u, const Dependencies& u_max) { return (u + u_max).nonlinear(); }

/// w' = beta e (S - r w), with r = w'S / W_max on the sphere while e w'S >= 0, and 0 otherwise
template <typename Scalar>
Scalar weight_rate(const Scalar& beta, const Scalar& e, const Scalar& activation, const Scalar& r, const Scalar& w) {
  return beta * e * (activation - r * w);
}

/// z_i' = -k2 grad_i f_i(y_i)
template <typename Scalar>
Scalar reference_rate(const Scalar& k2, const Scalar& gradient) {
  return -k2 * gradient;
}

}  // namespace terms
}  // namespace mixed_order_game
