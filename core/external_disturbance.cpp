#include "external_disturbance.hpp"

#include <algorithm>
#include <iterator>

namespace mixed_order_game {

ExternalDisturbance::ExternalDisturbance(int entries) : polynomial_(at(entries)) {}

void ExternalDisturbance::set_value(int entry, Real value) {
  polynomial_[at(entry)] = Polynomial{};
  polynomial_[at(entry)].coefficient[0] = value;
  find_derivatives();
}

void ExternalDisturbance::set_derivative(int entry, int order, Real derivative, Real t) {
  polynomial_[at(entry)].coefficient[at(order)] = derivative;
  polynomial_[at(entry)].since = t;
  find_derivatives();
}

void ExternalDisturbance::find_derivatives() {
  has_derivatives_ = std::any_of(polynomial_.begin(), polynomial_.end(), [](const Polynomial& polynomial) {
    return std::any_of(std::next(polynomial.coefficient), std::end(polynomial.coefficient),
                       [](Real derivative) { return derivative != 0.0; });
  });
}

void ExternalDisturbance::values(Real t, Real* d_ext) const {
  if (!has_derivatives_) {
    for (std::size_t p = 0; p < polynomial_.size(); ++p) d_ext[p] = polynomial_[p].coefficient[0];
    return;
  }
  for (std::size_t p = 0; p < polynomial_.size(); ++p) {
    const auto& [c, since] = polynomial_[p];
    const Real h = t - since;
    d_ext[p] = c[0] + h * (c[1] + h / 2.0 * (c[2] + h / 3.0 * c[3]));
  }
}

void ExternalDisturbance::rates(Real t, Real* rate) const {
  for (std::size_t p = 0; p < polynomial_.size(); ++p) {
    const auto& [c, since] = polynomial_[p];
    const Real h = t - since;
    rate[p] = c[1] + h * (c[2] + h / 2.0 * c[3]);
  }
}

std::span<const Real> ExternalDisturbance::numbers() const {
  static_assert(sizeof(Polynomial) == (highest_derivative + 2) * sizeof(Real));
  return {reinterpret_cast<const Real*>(polynomial_.data()), polynomial_.size() * (highest_derivative + 2)};
}

void ExternalDisturbance::set_numbers(std::span<const Real> numbers) {
  std::copy(numbers.begin(), numbers.end(), reinterpret_cast<Real*>(polynomial_.data()));
  find_derivatives();
}

}  // namespace mixed_order_game
