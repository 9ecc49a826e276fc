#include "external_disturbance.hpp"

#include <algorithm>

namespace mixed_order_game {

ExternalDisturbance::ExternalDisturbance(int entries) : numbers_(at(entries) * stride) {}

void ExternalDisturbance::set_value(int entry, Real value) {
  std::fill_n(polynomial(entry), stride, 0.0);
  polynomial(entry)[0] = value;
  find_derivatives();
}

void ExternalDisturbance::set_derivative(int entry, int order, Real derivative, Real t) {
  polynomial(entry)[order] = derivative;
  polynomial(entry)[since] = t;
  find_derivatives();
}

void ExternalDisturbance::find_derivatives() {
  has_derivatives_ = false;
  for (int p = 0; p < entries() && !has_derivatives_; ++p) {
    has_derivatives_ = std::any_of(polynomial(p) + 1, polynomial(p) + since, [](Real c) { return c != 0.0; });
  }
}

void ExternalDisturbance::values(Real t, Real* d_ext) const {
  const int n = entries();
  if (!has_derivatives_) {
    for (int p = 0; p < n; ++p) d_ext[p] = polynomial(p)[0];
    return;
  }
  for (int p = 0; p < n; ++p) {
    const Real* c = polynomial(p);
    const Real h = t - c[since];
    d_ext[p] = c[0] + h * (c[1] + h / 2.0 * (c[2] + h / 3.0 * c[3]));
  }
}

void ExternalDisturbance::rates(Real t, Real* rate) const {
  for (int p = 0; p < entries(); ++p) {
    const Real* c = polynomial(p);
    const Real h = t - c[since];
    rate[p] = c[1] + h * (c[2] + h / 2.0 * c[3]);
  }
}

void ExternalDisturbance::set_numbers(std::span<const Real> numbers) {
  std::copy(numbers.begin(), numbers.end(), numbers_.begin());
  find_derivatives();
}

}  // namespace mixed_order_game
