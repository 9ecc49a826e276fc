// External disturbances d_i(t) of the plants, as the closed loop sees them.
#pragma once

#include <memory>

#include "types.hpp"

namespace mixed_order_game {

class Disturbance {
 public:
  virtual ~Disturbance() = default;
  [[nodiscard]] virtual std::unique_ptr<Disturbance> clone() const = 0;

  /// d[entry(i, l)] = d_il(t); t in seconds.
  virtual void values(Real t, Real* d) const = 0;
  /// rate[entry(i, l)] = d/dt d_il(t).
  virtual void rates(Real t, Real* rate) const = 0;

  /// The same family with every coefficient zero, for the coefficients of a direction.
  [[nodiscard]] virtual std::unique_ptr<Disturbance> zero_direction() const = 0;

  /// The derivative of values() with respect to the coefficients, along those of a direction.
  virtual void values_along(const Disturbance& direction, Real t, Real* derivative) const = 0;
};

}  // namespace mixed_order_game
