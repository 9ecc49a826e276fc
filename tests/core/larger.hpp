// The largest of many sizes, for tests: std::max passes over what is no number.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace mixed_order_game::testing {

/// The larger of a record and a size; one that is no number counts as infinite.
inline double larger(double record, double size) {
  return std::isnan(size) ? std::numeric_limits<double>::infinity() : std::max(record, size);
}

}  // namespace mixed_order_game::testing
