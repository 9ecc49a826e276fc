// Intervals of reals with bounds rounded outwards: what comes out encloses every value that the operation takes.
#pragma once

#include <limits>

#include "expression/operation.hpp"
#include "types.hpp"

namespace mixed_order_game {

/// All numbers from lower to upper, bounds included; none when lower > upper.
struct Interval {
  Real lower = -std::numeric_limits<Real>::infinity();
  Real upper = std::numeric_limits<Real>::infinity();

  static Interval of(Real value) { return {value, value}; }
  static Interval none() { return {std::numeric_limits<Real>::infinity(), -std::numeric_limits<Real>::infinity()}; }
  [[nodiscard]] bool is_empty() const { return !(lower <= upper); }
  [[nodiscard]] bool is_point() const { return lower == upper; }
  [[nodiscard]] bool contains(Real value) const { return lower <= value && value <= upper; }
  /// The largest magnitude in it.
  [[nodiscard]] Real magnitude() const { return -lower > upper ? -lower : upper; }
};

Interval operator+(const Interval& a, const Interval& b);
Interval operator-(const Interval& a, const Interval& b);
Interval operator-(const Interval& a);
Interval operator*(const Interval& a, const Interval& b);

/// The arguments at which an operation has a finite value, as far as intervals hold them.
struct Domain {
  Interval a;
  Interval b;
  bool is_whole = true;     ///< false where they lie apart, such as those of 1/a on both sides of 0
  bool meets_edge = false;  ///< values grow without bound, or are none, at an edge: of b for a/b, else of a
};

/// That of arguments in a and b; b is not read for functions of one value.
Domain domain_of(Operation operation, const Interval& a, const Interval& b);

/// Encloses operation(a, b) for all arguments of the domain in a and b. Assumes that the library's functions err by a
/// few units in the last place at most.
Interval enclose(Operation operation, const Interval& a, const Interval& b);
/// a a, which is no product of two that differ.
Interval squared(const Interval& a);

}  // namespace mixed_order_game
