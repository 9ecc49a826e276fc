// What the importer says about the run, and how far the times that it forms may stray.
#pragma once

#include <cmath>
#include <limits>
#include <optional>

#include "types.hpp"

namespace mixed_order_game {

struct Experiment {
  std::optional<Real> tolerance;
  Real start_time = 0.0;
  std::optional<Real> stop_time;
};

/// Importers form times by t += h or n * h: both stray by rounding, of t and of h.
inline Real time_tolerance(Real t, Real h) {
  return 64.0 * std::numeric_limits<Real>::epsilon() * std::fabs(t) + 1e-9 * std::fabs(h);
}

/// How far a step of size h may end, at t, after the stop time: sums of steps stray by more than one rounding.
inline Real stop_tolerance(Real t, Real h) { return time_tolerance(t, h) + 1e-4 * h; }

}  // namespace mixed_order_game
