// Numbers with a derivative: value + along h, to first order in h.
#pragma once

#include <cmath>

#include "types.hpp"

namespace mixed_order_game {

struct Dual {
  Real value = 0.0;
  Real along = 0.0;

  Dual() = default;
  Dual(Real number) : value(number) {}  // NOLINT(google-explicit-constructor): numbers are constants
  Dual(Real number, Real derivative) : value(number), along(derivative) {}

  Dual& operator+=(const Dual& other) {
    value += other.value;
    along += other.along;
    return *this;
  }
};

inline Dual operator-(const Dual& a) { return {-a.value, -a.along}; }
inline Dual operator+(const Dual& a, const Dual& b) { return {a.value + b.value, a.along + b.along}; }
inline Dual operator-(const Dual& a, const Dual& b) { return {a.value - b.value, a.along - b.along}; }
inline Dual operator*(const Dual& a, const Dual& b) {
  return {a.value * b.value, a.along * b.value + a.value * b.along};
}
inline Dual operator/(const Dual& a, const Dual& b) {
  const Real ratio = a.value / b.value;
  return {ratio, (a.along - ratio * b.along) / b.value};
}

inline Dual exp(const Dual& a) {
  const Real power = std::exp(a.value);
  return {power, power * a.along};
}
inline Dual tanh(const Dual& a) {
  const Real tangent = std::tanh(a.value);
  return {tangent, (1.0 - tangent) * (1.0 + tangent) * a.along};
}
inline Dual sin(const Dual& a) { return {std::sin(a.value), std::cos(a.value) * a.along}; }

/// Where it lies, for conditions.
inline Real value_of(const Dual& a) { return a.value; }
inline Real value_of(Real a) { return a; }

}  // namespace mixed_order_game
