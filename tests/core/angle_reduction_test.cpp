#include "angle_reduction.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace mixed_order_game {
namespace {

struct Angle {
  Real frequency;
  Real time;
  Real phase;
  Real reduced;
};

// from exact fractions and 110 digits of pi, rounded once
constexpr Angle angles[] = {
    {1.0, 1.76e9, 0.0, -0x1.fd226fafc7038p-1},    {5.0, 1.76e9, -3.1, -0x1.c9f0dbbfffdc4p+0},
    {0.3, 1.76e9, 2.9, 0x1.4d03d10f41495p+1},     {8.7, -1.76e9, 0.4, 0x1.6251ec79bd9e3p+1},
    {123.456, 1.7e12, 1e3, 0x1.ef028901cc775p+0}, {6.283185307179586, 1e9, 0.0, -0x1.06fdab76a3f0cp-22},
    {2.0, 3.0, -1.5, -0x1.c87ed5110b461p+0},      {0.1, 0.1, 0.1, 0x1.c28f5c28f5c29p-4},
    {7.7, 1e15, 1e15, 0x1.697a57284a4c2p+1},      {0.0, 1e300, 0.25, 0.25},
};

TEST(ReducedAngle, IsExact) {
  for (const auto& [frequency, time, phase, reduced] : angles) {
    EXPECT_EQ(reduced_angle(frequency, time, phase), reduced) << frequency << ' ' << time << ' ' << phase;
  }
}

TEST(ReducedAngle, IsSomeAngleWhereATurnIsBelowTheResolutionOfTime) {
  EXPECT_TRUE(std::isfinite(reduced_angle(1e10, 1e10, 1.0)));
  EXPECT_TRUE(std::isfinite(reduced_angle(1e150, 1e150, -1e300)));
}

}  // namespace
}  // namespace mixed_order_game
