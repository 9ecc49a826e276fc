// Unknown dynamics g_i(x, v) of the hosted players' plants, as the closed loop sees them: values and Jacobian rows at
// own entries. The vectors x and v have N D entries; of v those of second-order players count.
#pragma once

#include <memory>

#include "families/game_family.hpp"
#include "families/sparse_rows.hpp"
#include "numbers/dependencies.hpp"
#include "numbers/dual.hpp"

namespace mixed_order_game {

class UnknownDynamics : public GameFamily {
 public:
  using GameFamily::GameFamily;
  [[nodiscard]] virtual std::unique_ptr<UnknownDynamics> clone() const = 0;

  /// g[own entry] = g_il(x, v). Switches have the values that are held, or, without any, those that they have there.
  virtual void values(const Real* x, const Real* v, Real* g, const Real* held = nullptr) const = 0;
  virtual void values(const CoefficientsAs<Dual>& coefficients, const Dual* x, const Dual* v, Dual* g,
                      const Real* held = nullptr) const = 0;
  virtual void values(const CoefficientsAs<Dependencies>& coefficients, const Dependencies* x, const Dependencies* v,
                      Dependencies* g) const = 0;

  /// Row of an own entry: the columns entry(j, h) at which d g_il / d x_jh may differ from zero.
  [[nodiscard]] virtual const SparseRows& jacobian_pattern() const = 0;

  /// The entries of jacobian_pattern().
  virtual void jacobian(const Real* x, const Real* v, Real* values, const Real* held = nullptr) const = 0;

  /// The same along v.
  [[nodiscard]] virtual const SparseRows& velocity_pattern() const = 0;
  virtual void velocity_jacobian(const Real* x, const Real* v, Real* values, const Real* held = nullptr) const = 0;

  /// Entries of x and of v that are looked at, in any order, repeats allowed.
  [[nodiscard]] virtual std::vector<int> actions_used() const = 0;
  [[nodiscard]] virtual std::vector<int> velocities_used() const = 0;
};

}  // namespace mixed_order_game
