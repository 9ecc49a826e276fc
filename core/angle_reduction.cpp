#include "angle_reduction.hpp"

#include <cmath>

namespace mixed_order_game {

namespace {

/// The unevaluated sum of two doubles.
struct DoubleDouble {
  Real high = 0.0;
  Real low = 0.0;
};

// Knuth: high + low is a + b exactly
DoubleDouble exact_sum(Real a, Real b) {
  const Real sum = a + b;
  const Real of_b = sum - a;
  return {sum, (a - (sum - of_b)) + (b - of_b)};
}

DoubleDouble exact_product(Real a, Real b) {
  const Real product = a * b;
  return {product, std::fma(a, b, -product)};
}

DoubleDouble operator+(DoubleDouble a, DoubleDouble b) {
  const auto [high, rest] = exact_sum(a.high, b.high);
  const auto [low, tail] = exact_sum(a.low, b.low);
  const auto [sum, carry] = exact_sum(high, rest + low);
  return exact_sum(sum, carry + tail);
}

}  // namespace

Real reduced_angle(Real frequency, Real time, Real phase) {
  constexpr Real two_pi[] = {0x1.921fb54442d18p+2, 0x1.1a62633145c07p-52, -0x1.f1976b7ed8fbcp-108};
  DoubleDouble angle = exact_product(frequency, time) + DoubleDouble{phase, 0.0};
  for (int pass = 0; pass < 2; ++pass) {  // the second one, where rounding counted a turn too many or too few
    const Real turns = std::nearbyint(angle.high / two_pi[0]);
    for (const Real part : two_pi) angle = angle + exact_product(-turns, part);
  }
  return angle.high;
}

}  // namespace mixed_order_game
