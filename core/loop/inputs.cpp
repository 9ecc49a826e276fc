#include "loop/inputs.hpp"

#include <algorithm>

namespace mixed_order_game {

Inputs::Inputs(int count) : numbers_(at(count) * stride), values_(at(count)) {}

bool Inputs::is_constant(int input) const {
  return std::none_of(polynomial(input) + 1, polynomial(input) + since, [](Real c) { return c != 0.0; });
}

void Inputs::set_value(int input, Real value) {
  if (!is_constant(input)) --varying_;
  std::fill_n(polynomial(input), stride, 0.0);
  polynomial(input)[0] = values_[at(input)] = value;
}

void Inputs::set_derivative(int input, int order, Real derivative, Real t) {
  if (!is_constant(input)) --varying_;
  polynomial(input)[order] = derivative;
  polynomial(input)[since] = t;
  if (!is_constant(input)) ++varying_;
}

void Inputs::values(Real t, Real* value) const {
  const int n = count();
  if (are_constant()) {
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
  varying_ = 0;
  for (int p = 0; p < count(); ++p) {
    values_[at(p)] = polynomial(p)[0];
    if (!is_constant(p)) ++varying_;
  }
}

}  // namespace mixed_order_game
