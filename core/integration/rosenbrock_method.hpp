// Steps of the Rosenbrock method Rodas5P, which need no history: where the rates jump again and again, CVODE would
// begin at order 1 each time.
//
// G. Steinebach, Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the Julia
// Differential Equations package, BIT Numerical Mathematics 63 (2023), 27: order 5, L-stable, stiffly accurate, with an
// embedded solution of order 4. In a step by h, stage i solves
//     (I - gamma h J) U_i = gamma h (f(t + c_i h, y + sum_j a_ij U_j) + sum_j C_ij / h U_j + d_i h df/dt).
// J is that of the Newton iteration. What it lacks, the derivatives of the activations, costs accuracy that the error
// estimate sees.
#pragma once

#include <array>

#include "aligned_vector.hpp"
#include "types.hpp"

namespace mixed_order_game {

/// The system that is integrated. Results are 0 for success, positive when a smaller step may help, negative otherwise.
class RosenbrockSystem {
 public:
  virtual int rate(Real t, const Real* state, Real* rate) noexcept = 0;
  /// Factorizes I - gamma J at the state of the last evaluation.
  virtual int newton_matrix(const Real* state, Real gamma) noexcept = 0;
  /// Replaces b by (I - gamma J)^-1 b.
  virtual int solve(Real* b) noexcept = 0;

 protected:
  ~RosenbrockSystem() = default;
};

class RosenbrockMethod {
 public:
  static constexpr int stages = 8;
  /// Of the rate, in one step.
  static constexpr int evaluations = stages + 1;
  /// Of the embedded solution, whose error is estimated.
  static constexpr int estimated_order = 4;

  /// The system must outlive the method.
  RosenbrockMethod(RosenbrockSystem& system, int size);

  /// From a state at t to t + h, with rates that see time at a resolution. The error is the estimate's weighted root
  /// mean square, not finite where a smaller step is needed. Negative results of the system are returned.
  int step(Real t, Real h, Real resolution, const Real* state, const Real* weight, Real* next, Real& error);

 private:
  RosenbrockSystem& system_;
  std::size_t size_;
  AlignedVector rate_, rate_by_time_;
  std::array<AlignedVector, stages> stage_;
};

}  // namespace mixed_order_game
