// g_i(x)_l = gain_i sum_j (G_ijl x_jl + H_ijl x_jl^2), the family of the paper's example.
#pragma once

#include "unknown_dynamics.hpp"

namespace mixed_order_game {

/// One term of g_il: linear * x_jl + square * x_jl^2.
struct PolynomialTerm {
  int player = 0;      ///< i
  int other = 0;       ///< j
  int coordinate = 0;  ///< l
  Real linear = 0.0;   ///< G_ijl
  Real square = 0.0;   ///< H_ijl
};

class PolynomialDynamics final : public UnknownDynamics {
 public:
  /// Terms in any order, at most one for each (player, other, coordinate).
  PolynomialDynamics(int players, int dimension, std::vector<PolynomialTerm> terms);

  std::vector<Real> gain;  ///< scales g_i, at i; may change at any time

  [[nodiscard]] std::unique_ptr<UnknownDynamics> clone() const override;
  void values(const Real* x, Real* g) const override;
  [[nodiscard]] const SparseRows& jacobian_pattern() const override { return pattern_; }
  void jacobian(const Real* x, Real* values) const override;
  [[nodiscard]] bool is_constant(int entry) const override { return square_[at(entry)] == 0.0; }
  [[nodiscard]] std::unique_ptr<UnknownDynamics> zero_direction() const override;
  void values_along(const UnknownDynamics& direction, const Real* x, Real* derivative) const override;

 private:
  int players_;
  SparseRows pattern_;
  std::vector<Real> linear_;  // along pattern_
  std::vector<Real> square_;
};

}  // namespace mixed_order_game
