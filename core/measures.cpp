#include "measures.hpp"

#include <cmath>

namespace mixed_order_game {

Real nash_error(const Real* x, const Real* x_star, int entries) {
  Real squares = 0.0;
  for (int p = 0; p < entries; ++p) squares += (x[p] - x_star[p]) * (x[p] - x_star[p]);
  return std::sqrt(squares);
}

Real consensus_error(const ClosedLoop& loop, const Real* state, const Signals& signals) {
  const int n = loop.shape().actions();
  Real squares = 0.0;
  for (int i = 0; i < loop.shape().players; ++i) {
    squares += std::pow(nash_error(state + loop.layout().estimates_of(i), signals.shared.data(), n), 2);
  }
  return std::sqrt(squares);
}

Real gradient_norm(const ClosedLoop& loop, const Real* x) {
  std::vector<Real> gradient(at(loop.shape().actions()));
  loop.parameters().cost->own_gradients(x, 0, gradient.data());
  Real squares = 0.0;
  for (const Real g : gradient) squares += g * g;
  return std::sqrt(squares);
}

}  // namespace mixed_order_game
