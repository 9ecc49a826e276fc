// Unknown dynamics g_i(x) of the plants, as the closed loop sees them: values and Jacobian rows.
#pragma once

#include <memory>

#include "families/game_family.hpp"
#include "families/sparse_rows.hpp"
#include "loop/dependencies.hpp"
#include "loop/dual.hpp"

namespace mixed_order_game {

class UnknownDynamics : public GameFamily {
 public:
  using GameFamily::GameFamily;
  [[nodiscard]] virtual std::unique_ptr<UnknownDynamics> clone() const = 0;

  /// g[entry(i, l)] = g_il(x); both of length N D.
  virtual void values(const Real* x, Real* g) const = 0;
  virtual void values(const CoefficientsAs<Dual>& coefficients, const Dual* x, Dual* g) const = 0;
  virtual void values(const CoefficientsAs<Dependencies>& coefficients, const Dependencies* x,
                      Dependencies* g) const = 0;

  /// Row entry(i, l): the columns entry(j, h) at which d g_il / d x_jh may differ from zero.
  [[nodiscard]] virtual const SparseRows& jacobian_pattern() const = 0;

  /// The entries of jacobian_pattern() at x.
  virtual void jacobian(const Real* x, Real* values) const = 0;
};

}  // namespace mixed_order_game
