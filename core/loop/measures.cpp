#include "loop/measures.hpp"

#include <cmath>

namespace mixed_order_game {

Real nash_error(const Real* x, const Real* x_star, int entries) {
  Real squares = 0.0;
  for (int p = 0; p < entries; ++p) squares += (x[p] - x_star[p]) * (x[p] - x_star[p]);
  return std::sqrt(squares);
}

// d |x - x*| = (x - x*)'(dx - dx*) / |x - x*|
Real nash_error_along(const Real* x, const Real* x_star, const Real* x_along, const Real* x_star_along, int entries) {
  const Real error = nash_error(x, x_star, entries);
  if (error == 0.0) return 0.0;
  Real product = 0.0;
  for (int p = 0; p < entries; ++p) product += (x[p] - x_star[p]) * (x_along[p] - x_star_along[p]);
  return product / error;
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
