#include "polynomial_dynamics.hpp"

#include <algorithm>
#include <tuple>

namespace mixed_order_game {

PolynomialDynamics::PolynomialDynamics(int players, int dimension, std::vector<PolynomialTerm> terms)
    : gain(at(players), 1.0), players_(players) {
  std::sort(terms.begin(), terms.end(), [](const PolynomialTerm& a, const PolynomialTerm& b) {
    return std::tie(a.coordinate, a.player, a.other) < std::tie(b.coordinate, b.player, b.other);
  });
  auto term = terms.begin();
  for (int row = 0; row < players * dimension; ++row) {
    for (; term != terms.end() && term->coordinate * players + term->player == row; ++term) {
      pattern_.column.push_back(term->coordinate * players + term->other);
      linear_.push_back(term->linear);
      square_.push_back(term->square);
    }
    pattern_.start.push_back(pattern_.entries());
  }
}

std::unique_ptr<UnknownDynamics> PolynomialDynamics::clone() const {
  return std::make_unique<PolynomialDynamics>(*this);
}

void PolynomialDynamics::values(const Real* x, Real* g) const {
  for (int row = 0; row < pattern_.rows(); ++row) {
    Real sum = 0.0;
    for (int k = pattern_.start[at(row)]; k < pattern_.start[at(row + 1)]; ++k) {
      const Real xj = x[pattern_.column[at(k)]];
      sum += (linear_[at(k)] + square_[at(k)] * xj) * xj;  // G x_jl + H x_jl^2
    }
    g[row] = gain[at(row % players_)] * sum;
  }
}

void PolynomialDynamics::jacobian(const Real* x, Real* values) const {
  for (int row = 0; row < pattern_.rows(); ++row) {
    for (int k = pattern_.start[at(row)]; k < pattern_.start[at(row + 1)]; ++k) {
      const Real xj = x[pattern_.column[at(k)]];
      values[k] = gain[at(row % players_)] * (linear_[at(k)] + 2.0 * square_[at(k)] * xj);
    }
  }
}

std::unique_ptr<UnknownDynamics> PolynomialDynamics::zero_direction() const {
  auto direction = std::make_unique<PolynomialDynamics>(*this);
  std::fill(direction->gain.begin(), direction->gain.end(), 0.0);
  return direction;
}

// g is linear in the gains
void PolynomialDynamics::values_along(const UnknownDynamics& direction, const Real* x, Real* derivative) const {
  direction.values(x, derivative);
}

}  // namespace mixed_order_game
