#include "expression/interval.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>

namespace mixed_order_game {

namespace {

constexpr Real infinite = std::numeric_limits<Real>::infinity();

Real down(Real value) { return std::nextafter(value, -infinite); }
Real up(Real value) { return std::nextafter(value, infinite); }

/// A correctly rounded result and the sign of what rounding took away, where it is known; where not, both directions
/// are taken.
Interval rounded(Real value, Real rest) {
  if (std::isnan(value)) return {};
  if (std::isinf(value))
    return value > 0.0 ? Interval{std::numeric_limits<Real>::max(), infinite}
                       : Interval{-infinite, std::numeric_limits<Real>::lowest()};
  const bool unknown = std::isnan(rest) || (value != 0.0 && std::abs(value) < 1e-280);
  return {unknown || rest < 0.0 ? down(value) : value, unknown || rest > 0.0 ? up(value) : value};
}

Interval sum(Real a, Real b) {
  if (std::isinf(a) || std::isinf(b)) return Interval::of(a + b);
  const Real value = a + b;
  const Real of_b = value - a;
  return rounded(value, (a - (value - of_b)) + (b - of_b));
}

Interval product(Real a, Real b) {
  if (a == 0.0 || b == 0.0) return Interval::of(0.0);  // bounds of infinity stand for numbers as large as you like
  if (std::isinf(a) || std::isinf(b)) return Interval::of(a * b);
  Interval result = rounded(a * b, std::fma(a, b, -(a * b)));
  if (a * b == 0.0) result = (a > 0.0) == (b > 0.0) ? Interval{0.0, up(0.0)} : Interval{down(0.0), 0.0};
  return result;
}

Interval quotient(Real a, Real b) {
  if (a == 0.0) return Interval::of(0.0);
  if (std::isinf(b)) return Interval::of(0.0);
  const Real value = a / b;
  Interval result = rounded(value, std::fma(-value, b, a) * (b > 0.0 ? 1.0 : -1.0));
  if (value == 0.0) result = (a > 0.0) == (b > 0.0) ? Interval{0.0, up(0.0)} : Interval{down(0.0), 0.0};
  return result;
}

Interval hull(std::initializer_list<Interval> all) {
  Interval result = Interval::none();
  for (const Interval& one : all) {
    result = {std::min(result.lower, one.lower), std::max(result.upper, one.upper)};
  }
  return result;
}

Interval within(const Interval& a, const Interval& b) {
  return {std::max(a.lower, b.lower), std::min(a.upper, b.upper)};
}

/// A value of the library, with the units in the last place by which it may err.
Interval about(Real value) {
  constexpr Real units = 8.0;
  if (std::isnan(value)) return {};
  if (std::isinf(value)) return rounded(value, 0.0);
  const Real error =
      units * std::numeric_limits<Real>::epsilon() * std::abs(value) + std::numeric_limits<Real>::denorm_min();
  return {down(value - error), up(value + error)};
}

template <typename Function>
Interval rising(const Interval& a, Function function, Real least = -infinite, Real most = infinite) {
  return within({about(function(a.lower)).lower, about(function(a.upper)).upper}, {least, most});
}

Interval cosine(const Interval& a) {
  constexpr Real turn = 2.0 * std::numbers::pi;
  constexpr Real largest = 1e8;  // beyond, the rounding of turns counts
  if (!(a.upper - a.lower < turn) || a.magnitude() > largest) return {-1.0, 1.0};
  Interval result = hull({about(std::cos(a.lower)), about(std::cos(a.upper))});
  // extremes at k pi, with a margin for the rounding of pi
  constexpr Real margin = 1e-7;
  const int first = static_cast<int>(std::ceil((a.lower - margin) / std::numbers::pi));
  for (int k = first; k * std::numbers::pi <= a.upper + margin; ++k) {
    result = hull({result, Interval::of(k % 2 == 0 ? 1.0 : -1.0)});
  }
  return within(result, {-1.0, 1.0});
}

Interval logarithm(const Interval& a) {
  return {a.lower <= 0.0 ? -infinite : about(std::log(a.lower)).lower,
          a.upper <= 0.0 ? -infinite : about(std::log(a.upper)).upper};
}

Interval exponential(const Interval& a) {
  return rising(a, [](Real x) { return std::exp(x); }, 0.0);
}

/// Of an interval that has 0 at most as one of its ends.
Interval inverse(const Interval& a) {
  const Real lower = a.upper == 0.0 ? -infinite : quotient(1.0, a.upper).lower;
  const Real upper = a.lower == 0.0 ? infinite : quotient(1.0, a.lower).upper;
  return {lower, upper};
}

Real least_magnitude(const Interval& a) {
  return a.contains(0.0) ? 0.0 : std::min(std::abs(a.lower), std::abs(a.upper));
}

Real sign(Real value) { return value > 0.0 ? 1.0 : value < 0.0 ? -1.0 : 0.0; }

Interval power(const Interval& a, const Interval& b) {
  const bool is_integer = b.is_point() && b.lower == std::floor(b.lower);
  if (is_integer && a.lower < 0.0) {
    const Real n = b.lower;
    const bool is_even = std::fmod(n, 2.0) == 0.0;
    if (n < 0.0 && a.contains(0.0)) {
      if (is_even) return {about(std::pow(a.magnitude(), n)).lower, infinite};
      return a.upper > 0.0 ? Interval{} : Interval{-infinite, about(std::pow(a.lower, n)).upper};
    }
    Interval result = hull({about(std::pow(a.lower, n)), about(std::pow(a.upper, n))});
    if (is_even && a.contains(0.0)) result.lower = 0.0;
    return result;
  }
  // a >= 0, where a^b is monotone along each: it is extreme at corners
  const Real least = std::max(a.lower, 0.0);
  return within(hull({about(std::pow(least, b.lower)), about(std::pow(least, b.upper)),
                      about(std::pow(a.upper, b.lower)), about(std::pow(a.upper, b.upper))}),
                {0.0, infinite});
}

}  // namespace

Interval operator+(const Interval& a, const Interval& b) {
  return {sum(a.lower, b.lower).lower, sum(a.upper, b.upper).upper};
}

Interval operator-(const Interval& a) { return {-a.upper, -a.lower}; }

Interval operator-(const Interval& a, const Interval& b) { return a + -b; }

Interval operator*(const Interval& a, const Interval& b) {
  return hull(
      {product(a.lower, b.lower), product(a.lower, b.upper), product(a.upper, b.lower), product(a.upper, b.upper)});
}

Interval squared(const Interval& a) {
  const Real largest = a.magnitude();
  const Real least = least_magnitude(a);
  return {product(least, least).lower, product(largest, largest).upper};
}

Domain domain_of(Operation operation, const Interval& a, const Interval& b) {
  Domain domain{a, b};
  switch (operation) {
    case Operation::divide:
      if (b.is_point() && b.lower == 0.0) domain.b = Interval::none();
      domain.is_whole = !(b.lower < 0.0 && b.upper > 0.0);
      domain.meets_edge = b.contains(0.0);
      break;
    case Operation::power:
    case Operation::power_log: {
      const bool is_integer = b.is_point() && b.lower == std::floor(b.lower);
      if (operation == Operation::power_log || !is_integer) domain.a = within(a, {0.0, infinite});
      if (is_integer && b.lower < 0.0) domain.is_whole = !(a.lower < 0.0 && a.upper > 0.0);
      domain.meets_edge = (operation == Operation::power_log || b.lower < 0.0) && domain.a.contains(0.0);
      break;
    }
    case Operation::sqrt:
      domain.a = within(a, {0.0, infinite});
      break;
    case Operation::log:
      domain.a = within(a, {0.0, infinite});
      domain.meets_edge = domain.a.contains(0.0);
      break;
    case Operation::log1p:
      domain.a = within(a, {-1.0, infinite});
      domain.meets_edge = domain.a.contains(-1.0);
      break;
    case Operation::asin:
    case Operation::acos:
      domain.a = within(a, {-1.0, 1.0});
      break;
    case Operation::tan: {
      constexpr Real half_turn = std::numbers::pi;
      const Real branch = std::floor(a.lower / half_turn + 0.5);  // margins against rounding
      domain.is_whole = a.magnitude() < 1e8 && a.lower > (branch - 0.5) * half_turn + 1e-7 &&
                        a.upper < (branch + 0.5) * half_turn - 1e-7;
      break;
    }
    case Operation::atan2:
      domain.is_whole = !(a.contains(0.0) && b.lower <= 0.0);
      break;
    default:
      break;
  }
  return domain;
}

Interval enclose(Operation operation, const Interval& first, const Interval& second) {
  const Domain domain = domain_of(operation, first, second);
  const Interval& a = domain.a;
  const Interval& b = domain.b;
  if (a.is_empty() || b.is_empty()) return Interval::none();
  switch (operation) {
    case Operation::number:
    case Operation::leaf:
      return a;
    case Operation::add:
      return a + b;
    case Operation::subtract:
      return a - b;
    case Operation::multiply:
      return a * b;
    case Operation::divide: {
      if (!domain.is_whole) return {};
      if (b.lower == 0.0 || b.upper == 0.0 || std::isinf(a.magnitude()) || std::isinf(b.magnitude())) {
        return a * inverse(b);
      }
      return hull({quotient(a.lower, b.lower), quotient(a.lower, b.upper), quotient(a.upper, b.lower),
                   quotient(a.upper, b.upper)});
    }
    case Operation::negative:
      return -a;
    case Operation::power:
      return power(a, b);
    case Operation::power_log:
      return hull({power(a, b) * logarithm(a), a.lower == 0.0 ? Interval::of(0.0) : Interval::none()});
    case Operation::sqrt:
      return {std::max(0.0, down(std::sqrt(a.lower))), up(std::sqrt(a.upper))};
    case Operation::exp:
      return exponential(a);
    case Operation::expm1:
      return rising(a, [](Real x) { return std::expm1(x); }, -1.0);
    case Operation::log:
      return logarithm(a);
    case Operation::log1p:
      return {a.lower <= -1.0 ? -infinite : about(std::log1p(a.lower)).lower, about(std::log1p(a.upper)).upper};
    case Operation::sin:
      return cosine(a - Interval{down(0.5 * std::numbers::pi), up(0.5 * std::numbers::pi)});
    case Operation::cos:
      return cosine(a);
    case Operation::tan:
      return domain.is_whole ? rising(a, [](Real x) { return std::tan(x); }) : Interval{};
    case Operation::asin:
      return rising(a, [](Real x) { return std::asin(x); });
    case Operation::acos:
      return {std::max(0.0, about(std::acos(a.upper)).lower), about(std::acos(a.lower)).upper};
    case Operation::atan:
      return rising(a, [](Real x) { return std::atan(x); });
    case Operation::atan2: {
      if (!domain.is_whole) return {-4.0, 4.0};
      // the angle of a box that does not meet the cut is extreme at its corners
      return hull({about(std::atan2(a.lower, b.lower)), about(std::atan2(a.lower, b.upper)),
                   about(std::atan2(a.upper, b.lower)), about(std::atan2(a.upper, b.upper))});
    }
    case Operation::sinh:
      return rising(a, [](Real x) { return std::sinh(x); });
    case Operation::cosh:
      return rising({least_magnitude(a), a.magnitude()}, [](Real x) { return std::cosh(x); }, 1.0);
    case Operation::tanh:
      return rising(a, [](Real x) { return std::tanh(x); }, -1.0, 1.0);
    case Operation::erf:
      return rising(a, [](Real x) { return std::erf(x); }, -1.0, 1.0);
    case Operation::hypot:
      return within({about(std::hypot(least_magnitude(a), least_magnitude(b))).lower,
                     about(std::hypot(a.magnitude(), b.magnitude())).upper},
                    {0.0, infinite});
    case Operation::abs:
      return {least_magnitude(a), a.magnitude()};
    case Operation::min:
      return {std::min(a.lower, b.lower), std::min(a.upper, b.upper)};
    case Operation::max:
      return {std::max(a.lower, b.lower), std::max(a.upper, b.upper)};
    case Operation::floor:
      return {std::floor(a.lower), std::floor(a.upper)};
    case Operation::sign_of:
      return {a.lower >= 0.0 ? 1.0 : -1.0, a.upper >= 0.0 ? 1.0 : -1.0};
    case Operation::positive:
      return {a.lower > 0.0 ? 1.0 : 0.0, a.upper > 0.0 ? 1.0 : 0.0};
    case Operation::not_negative:
      return {a.lower >= 0.0 ? 1.0 : 0.0, a.upper >= 0.0 ? 1.0 : 0.0};
    case Operation::sign:
      return {sign(a.lower), sign(a.upper)};
    case Operation::choose:
      if (!a.contains(0.0)) return b;
      return a.is_point() ? Interval::of(0.0) : hull({Interval::of(0.0), b});
    case Operation::multiply_unless_zero:
      return a * b;
    case Operation::usable:
      return {0.0, 1.0};
    case Operation::alternating:
      if (a.is_point() && std::isfinite(a.lower)) return Interval::of(std::fmod(a.lower, 2.0) == 0.0 ? 1.0 : -1.0);
      return {-1.0, 1.0};
    case Operation::noise: {
      constexpr Real largest = 8.3;  // the quantile of 1 - 2^-53 is 8.21
      return {-largest, largest};
    }
  }
  return {};
}

}  // namespace mixed_order_game
