// Cost functions f_i(x) of the players, as the closed loop sees them: values, own-action gradients
// grad_i f_i and the rows of their Hessian. Another family of games implements this interface.
#pragma once

#include <memory>

#include "families/game_family.hpp"
#include "families/sparse_rows.hpp"
#include "numbers/dependencies.hpp"
#include "numbers/dual.hpp"

namespace mixed_order_game {

class Cost : public GameFamily {
 public:
  using GameFamily::GameFamily;
  [[nodiscard]] virtual std::unique_ptr<Cost> clone() const = 0;

  /// f_i(x) of a hosted player for a joint action x of length N D.
  [[nodiscard]] virtual Real value(int i, const Real* x) const = 0;

  /// gradient[own entry (h, l)] = d f_i / d x_il at the joint action points + h * stride, for every hosted player
  /// i = host(h). A stride of N D evaluates each player at its own estimate y_i, a stride of 0 all players at one x.
  /// Switches have the values that are held, or, without any, those that they have at the points.
  virtual void own_gradients(const Real* points, int stride, Real* gradient, const Real* held = nullptr) const = 0;
  virtual void own_gradients(const CoefficientsAs<Dual>& coefficients, const Dual* points, int stride, Dual* gradient,
                             const Real* held = nullptr) const = 0;
  virtual void own_gradients(const CoefficientsAs<Dependencies>& coefficients, const Dependencies* points, int stride,
                             Dependencies* gradient) const = 0;

  /// Row of own entry (h, l): the columns entry(j, m) at which d^2 f_i / (d x_il d x_jm) may differ from zero.
  [[nodiscard]] virtual const SparseRows& hessian_pattern() const = 0;

  /// The entries of hessian_pattern(), row (h, l) at the joint action points + h * stride.
  virtual void hessian_rows(const Real* points, int stride, Real* values, const Real* held = nullptr) const = 0;

  /// Whether the gradients are affine, so that the Hessian is the same everywhere.
  [[nodiscard]] virtual bool is_affine() const = 0;
};

}  // namespace mixed_order_game
