#include "loop/inputs.hpp"

#include <algorithm>

namespace mixed_order_game {

Inputs::Inputs(int count) : numbers_(at(count) * stride), values_(at(count)) {}

bool Inputs::is_constant(int input) const {
  return std::none_of(polynomial(input) + 1, polynomial(input) + since, [](Real c) { return c != 0.0; });
}

void Inputs::set_value(int input, Real value) {
  const bool was_constant = is_constant(input);
  std::fill_n(polynomial(input), stride, 0.0);
  polynomial(input)[0] = values_[at(input)] = value;
  if (!was_constant) find_derivatives();
}

void Inputs::set_derivative(int input, int order, Real derivative, Real t) {
  polynomial(input)[order] = derivative;
  polynomial(input)[since] = t;
  find_derivatives();
}

void Inputs::find_derivatives() {
  has_derivatives_ = false;
  for (int p = 0; p < count() && !has_derivatives_; ++p) has_derivatives_ = !is_constant(p);
}

void Inputs::values(Real t, Real* value) const {
  const int n = count();
  if (!has_derivatives_) {
    std::copy(values_.begin(), values_.end(), value);
    return;
  }
  for (int p = 0; p < n; ++p) {
    const Real* c = polynomial(p);
    const Real h = t - c[since];
    value[p] = c[0] + h * (c[1] + h / 2.0 * (c[2] + h / 3.0 * c[3]));
  }
}

void Inputs::rates(Real t, Real* rate) const {
  for (int p = 0; p < count(); ++p) {
    const Real* c = polynomial(p);
    const Real h = t - c[since];
    rate[p] = c[1] + h * (c[2] + h / 2.0 * c[3]);
  }
}

void Inputs::set_numbers(std::span<const Real> numbers) {
  std::copy(numbers.begin(), numbers.end(), numbers_.begin());
  for (int p = 0; p < count(); ++p) values_[at(p)] = polynomial(p)[0];
  find_derivatives();
}

}  // namespace mixed_order_game
