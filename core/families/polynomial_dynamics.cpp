#include "families/polynomial_dynamics.hpp"

#include <map>

namespace mixed_order_game {

namespace {

constexpr Coefficient declared[] = {
    {.key = "linear", .symbol = "coefficients", .indices = Indices::term},
    {.key = "square", .symbol = "coefficients", .indices = Indices::term},
    {.variable = "dynamics_gain",
     .description = "Scales the unknown dynamics g_i",
     .indices = Indices::player,
     .unit = {"1", "1"},
     .start = 1.0},
};

}  // namespace

PolynomialDynamics::PolynomialDynamics(const Shape& shape)
    : UnknownDynamics(Coefficients(declared, shape.players, shape.dimension)), shape_(shape) {
  pattern_.start.assign(at(shape.own_entries() + 1), 0);
  no_velocities_ = pattern_;
  for (int row = 0; row < shape.own_entries(); ++row) player_.push_back(shape.player_of_own(row));
}

std::unique_ptr<UnknownDynamics> PolynomialDynamics::clone() const {
  return std::make_unique<PolynomialDynamics>(*this);
}

void PolynomialDynamics::refresh() {
  if (is_built_) return;                       // the game file fixes the terms
  std::map<int, std::pair<Real, Real>> terms;  // G and H by slot entry(i, l) N + j
  for (const auto& [slot, value] : coefficients.terms(linear)) terms[slot].first = value;
  for (const auto& [slot, value] : coefficients.terms(square)) terms[slot].second = value;
  std::erase_if(terms, [](const auto& term) { return term.second.first == 0.0 && term.second.second == 0.0; });
  SparseRows pattern;
  linear_.clear();
  square_.clear();
  const int N = shape_.players;
  for (int row = 0; row < no_velocities_.rows(); ++row) {
    const int entry = shape_.entry_of_own(row);
    for (auto term = terms.lower_bound(entry * N); term != terms.end() && term->first / N == entry; ++term) {
      pattern.column.push_back(entry / N * N + term->first % N);
      linear_.push_back(term->second.first);
      square_.push_back(term->second.second);
    }
    pattern.start.push_back(pattern.entries());
  }
  pattern_ = std::move(pattern);
  is_built_ = true;
}

template <typename Scalar, typename Gain>
void PolynomialDynamics::values_as(const Scalar* x, Gain gain_of, Scalar* g) const {
  const int* column = pattern_.column.data();
  const Real* G = linear_.data();
  const Real* H = square_.data();
  int k = 0;
  for (std::size_t row = 0; row < player_.size(); ++row) {
    Scalar sum = 0.0;
    for (const int end = pattern_.start[row + 1]; k < end; ++k) {
      const Scalar& xj = x[column[k]];
      sum += (G[k] + H[k] * xj) * xj;  // G x_jl + H x_jl^2
    }
    g[row] = gain_of(player_[row]) * sum;
  }
}

void PolynomialDynamics::values(const Real* x, const Real* /*v*/, Real* g, const Real* /*held*/) const {
  values_as(x, [&](int i) { return coefficients[gain][at(i)]; }, g);
}

void PolynomialDynamics::values(const CoefficientsAs<Dual>& along, const Dual* x, const Dual* /*v*/, Dual* g,
                                const Real* /*held*/) const {
  values_as(x, [&](int i) { return along.value(gain, i); }, g);
}

void PolynomialDynamics::values(const CoefficientsAs<Dependencies>& of, const Dependencies* x,
                                const Dependencies* /*v*/, Dependencies* g) const {
  values_as(x, [&](int i) { return of.value(gain, i); }, g);
}

void PolynomialDynamics::jacobian(const Real* x, const Real* /*v*/, Real* values, const Real* /*held*/) const {
  for (std::size_t row = 0; row < player_.size(); ++row) {
    const Real scale = coefficients[gain][at(player_[row])];
    for (int k = pattern_.start[row]; k < pattern_.start[row + 1]; ++k) {
      const Real xj = x[pattern_.column[at(k)]];
      values[k] = scale * (linear_[at(k)] + 2.0 * square_[at(k)] * xj);
    }
  }
}

}  // namespace mixed_order_game
