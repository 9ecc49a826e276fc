// Unknown dynamics g_i(x) of the plants, as the closed loop sees them: values and Jacobian rows.
#pragma once

#include <memory>

#include "sparse_rows.hpp"
#include "types.hpp"

namespace mixed_order_game {

class UnknownDynamics {
 public:
  virtual ~UnknownDynamics() = default;
  [[nodiscard]] virtual std::unique_ptr<UnknownDynamics> clone() const = 0;

  /// g[entry(i, l)] = g_il(x); both of length N D.
  virtual void values(const Real* x, Real* g) const = 0;

  /// Row entry(i, l): the columns entry(j, h) at which d g_il / d x_jh may differ from zero.
  [[nodiscard]] virtual const SparseRows& jacobian_pattern() const = 0;

  /// The entries of jacobian_pattern() at x.
  virtual void jacobian(const Real* x, Real* values) const = 0;
  /// Whether an entry of jacobian_pattern() is the same at every x.
  [[nodiscard]] virtual bool is_constant(int entry) const = 0;

  /// The same family with every coefficient that can change zero, for the coefficients of a direction.
  [[nodiscard]] virtual std::unique_ptr<UnknownDynamics> zero_direction() const = 0;

  /// The derivative of values() with respect to those coefficients, along those of a direction.
  virtual void values_along(const UnknownDynamics& direction, const Real* x, Real* derivative) const = 0;
};

}  // namespace mixed_order_game
