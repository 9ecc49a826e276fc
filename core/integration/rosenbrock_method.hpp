// Steps of the Rosenbrock method Rodas4P2, which need no history: where the rates jump again and again, CVODE would
// begin at order 1 each time.
//
// G. Steinebach, Improvement of Rosenbrock-Wanner method RODASP, in: Progress in Differential-Algebraic Equations II,
// Springer, 2020, 165-184: order 4, L-stable, stiffly accurate, with an embedded solution of order 3. In a step by h,
// stage i solves
//     (I - gamma h J) U_i = gamma h (f(t + c_i h, y + sum_j a_ij U_j) + sum_j C_ij / h U_j + d_i h df/dt).
// J is that of the Newton iteration. What it lacks, the derivatives of the activations, costs accuracy that the error
// estimate sees; the method keeps order 2 whatever J is.
#pragma once

#include <array>

#include "aligned_vector.hpp"
#include "types.hpp"

namespace mixed_order_game {

/// The system that is integrated. Results are 0 for success, positive when a smaller step may help, negative otherwise.
class RosenbrockSystem {
 public:
  virtual int rate(Real t, const Real* state, Real* rate) noexcept = 0;
  /// Factorizes I - gamma J where the step begins.
  virtual int factor(Real gamma) noexcept = 0;
  /// Replaces b by (I - gamma J)^-1 b.
  virtual int solve(Real* b) noexcept = 0;

 protected:
  ~RosenbrockSystem() = default;
};

/// Where a step begins.
struct RosenbrockStart {
  Real t;
  const Real* state;
  const Real* rate;
  const Real* rate_by_time;  ///< its partial derivative
};

class RosenbrockMethod {
 public:
  static constexpr int stages = 6;
  /// Of the rate, in one step, besides that where it begins.
  static constexpr int evaluations = stages - 1;
  /// Of the embedded solution, whose error is estimated.
  static constexpr int estimated_order = 3;

  /// The system must outlive the method.
  RosenbrockMethod(RosenbrockSystem& system, int size);

  /// From the start's t to t + h. The error is the estimate's weighted root mean square, not finite where a smaller
  /// step is needed. Negative results of the system are returned.
  int step(const RosenbrockStart& start, Real h, const Real* weight, Real* next, Real& error);

 private:
  RosenbrockSystem& system_;
  std::size_t size_;
  AlignedVector rate_;
  std::array<AlignedVector, stages> stage_;
};

}  // namespace mixed_order_game
