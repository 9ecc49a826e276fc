// The angle of a sinusoid at a large time: frequency times time loses its digits when it is rounded to a double.
#pragma once

#include "types.hpp"

namespace mixed_order_game {

/// frequency time + phase modulo 2 pi, between -pi and pi, as if computed in exact arithmetic and rounded once; rad,
/// from rad/s, s and rad. Some equal angle beyond 1e16 rad, where one turn takes less than the resolution of time.
Real reduced_angle(Real frequency, Real time, Real phase);

}  // namespace mixed_order_game
