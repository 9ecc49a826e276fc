// The Newton iteration of an implicit step of CVODE, attached to it as a SUNNonlinearSolver.
//
// A step solves  r(c) = c + rl1 zn1 - gamma f(t, ypred + c) = 0  for the correction c. It does what the library's own
// iteration does, with each pass over the vectors done once and without copies. It expects a good rate of convergence
// of a new factorization, believes in convergence only where the linearization holds, and where it fails begins once
// more, carefully: with a factorization at each iterate and corrections that the system may stop on their way.
#pragma once

#include <sundials/sundials_nonlinearsolver.h>

#include <cstdint>

#include "aligned_vector.hpp"

namespace mixed_order_game {

/// What the iteration needs to know of the system that is integrated. Results are CVODE's: 0 for success, positive when
/// a smaller step may help, negative otherwise.
class NewtonSystem {
 public:
  virtual int rate(Real t, const Real* state, Real* rate) noexcept = 0;  ///< need not be finite
  /// Replaces b by (I - gamma J)^-1 b with gamma and J of the last factorization.
  virtual int solve(Real* b) noexcept = 0;
  /// Whether the rates at this state, times gamma, are those that the factorized matrix foretells from the state of
  /// the last evaluation, weighted and up to the tolerance in each entry.
  virtual bool linearization_holds(const Real* state, Real gamma, const Real* weight, Real tolerance) noexcept = 0;
  /// Changes the state, to which a correction led from that of the last evaluation and factorization, where the
  /// correction went further than its linearization reaches; false when it did not.
  virtual bool stop_correction(Real* state) noexcept = 0;

 protected:
  ~NewtonSystem() = default;
};

class NewtonIteration {
 public:
  /// The system must outlive the iteration.
  NewtonIteration(NewtonSystem& system, int size, SUNContext context);
  ~NewtonIteration();
  NewtonIteration(const NewtonIteration&) = delete;
  NewtonIteration& operator=(const NewtonIteration&) = delete;

  [[nodiscard]] SUNNonlinearSolver handle() const { return handle_; }

  /// Evaluations of the rate and solves, since the last reset().
  [[nodiscard]] std::int64_t iterations() const { return iterations_; }

  /// Forgets everything, as if it were new.
  void reset();

 private:
  enum class Factorize { never, once, always };

  /// The step that CVODE is at: r(c) = c + rl1 zn1 - gamma f(t, predicted + c).
  struct Step {
    Real t;
    Real gamma;
    Real rl1;
    const Real* predicted;
    const Real* zn1;
    Real* y;  ///< the iterate, predicted + c
    Real* f;  ///< the rate there
  };
  static Step step_of(void* cvode);

  int solve(N_Vector correction, N_Vector weight, Real tolerance, bool factorize, void* cvode);
  int iterate(Real* correction, const Real* weight, Real tolerance, Factorize factorize, void* cvode);

  NewtonSystem& system_;
  SUNNonlinSolLSetupFn factor_ = nullptr;
  int most_iterations_ = 3;
  Step step_{};
  AlignedVector delta_;
  SUNNonlinearSolver handle_;  // made last: nothing after it can fail
  Real factored_gamma_ = 0.0;
  Real convergence_rate_ = 1.0;
  int last_iterations_ = 0;
  int last_failures_ = 0;
  std::int64_t iterations_ = 0;
};

}  // namespace mixed_order_game
