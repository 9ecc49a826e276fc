// Forward sensitivities: how the state of a run changes with parameters of the loop, to first order.
//
// Each solves the variational equation s' = J s + df/dp along the run, at the ends of the integrator's own steps, by
// the BDF formula of the order that the integrator took there, through the values at those times:
//
//     s' = c_0 s + sum over j = 1 .. q of c_j s_j,    (I - gamma J) s = gamma (df/dp - sum_j c_j s_j)
//
// with gamma = 1 / c_0, by the elimination that solves the run's Newton systems. What that leaves out of J is taken at
// a predicted s.
//
// At an event where rates jump, s+ = s- + (f- - f+) dt*/dp, with dt*/dp from the condition that ends there; the state
// is continuous. Where a column begins or ceases to slide along the sphere without a jump of its rates, J jumps, and
// the values before take on what makes them a smooth past of those after.
//
// Feehery, Tolsma, Barton: Efficient sensitivity analysis of large-scale differential-algebraic systems, Applied
// Numerical Mathematics 25 (1997), for solving them after each step of the state; Galan, Feehery, Barton: Parametric
// sensitivity functions for hybrid discrete/continuous systems, Applied Numerical Mathematics 31 (1999), for the jump.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "integration/step_follower.hpp"
#include "loop/inputs.hpp"
#include "loop/located_conditions.hpp"
#include "loop/loop_tangent.hpp"
#include "newton/newton_solver.hpp"

namespace mixed_order_game {

class Sensitivities final : public StepFollower {
 public:
  /// Along directions, which have the form of the loop's parameters. The loop hosts all players with their plants;
  /// where expressions switch with jumps, no direction changes named parameters. Loop and inputs must outlive it.
  Sensitivities(const ClosedLoop& loop, const Inputs& inputs, std::vector<Parameters> directions);

  [[nodiscard]] int count() const { return static_cast<int>(directions_.size()); }
  /// ds/dp along direction number k at a time within the last step: of the state's length, valid until the next call.
  [[nodiscard]] const Real* at_time(Real t, int k);

  void begin(Real t) override;
  void step(Real t, int order, const Real* state, const Modes& modes) override;
  void pass_event(const Event& event) override;

 private:
  static constexpr int highest_order = 5;
  using Weights = std::array<Real, highest_order + 1>;  // of the last nodes, newest first

  struct Node {
    Real t = 0.0;
    std::vector<AlignedVector> values;  // by direction
  };
  /// Within a step a column began or ceased to slide along the sphere, by e w'S = 0: rates go on, J jumps.
  struct Kink {
    Real t;
    int column;
    bool error_turned;  ///< e passed through zero; otherwise w'S did
    bool ceased;
  };
  struct Direction {
    Parameters along;
    bool changes_control;    // k1, k2, k4, delta or epsilon
    bool changes_weights;    // k2 or beta
    bool changes_estimates;  // k3
    bool changes_others;     // besides gains and the initial state
  };

  [[nodiscard]] static Direction classified(Parameters along);
  [[nodiscard]] const Node& node(int age) const {
    return nodes_[at((newest_ + age) % static_cast<int>(nodes_.size()))];
  }
  [[nodiscard]] Weights interpolation(Real t, int points) const;
  void combine(const Weights& weights, int points, int age, int k, int first, int last, Real* sum) const;
  void find_kinks(Real t);
  void pass_kinks(int k, Real t, Real gamma, const Real* state);
  [[nodiscard]] Real turning_along(const Kink& kink, int k, const Real* state, const Real* s) const;
  void linearize(Real t, const Real* state, const Modes& modes);
  void add_parameter_rates(const Direction& direction, Real t, const Real* state, const Modes& modes, Real factor,
                           Real* b);
  void add_gain_rates(const Direction& direction, const Real* state, Real factor, Real* b) const;
  void add_activation_rates(const Real* state, const Real* dy, Real factor, Real* b);

  const ClosedLoop& loop_;
  const Inputs& inputs_;
  std::vector<Direction> directions_;
  int size_;
  std::unique_ptr<NewtonSolver> newton_;
  LoopJacobian jacobian_;
  LoopTangent tangent_;
  LocatedConditions conditions_;

  std::array<Node, highest_order + 2> nodes_;  // ends of steps since the last jump
  int newest_ = 0;
  int count_ = 0;
  int order_ = 1;  // of the last step
  // columns where the last step ended
  Real columns_time_ = 0.0;
  bool has_columns_ = false;
  std::vector<std::uint8_t> slides_;
  AlignedVector error_, network_;
  std::vector<Kink> kinks_;  // within the step that is made

  // scratch
  Signals signals_;
  AlignedVector input_values_, rate_, rate_before_, predicted_, value_;
  AlignedVector activation_change_, network_change_, moment_, sum_;
};

}  // namespace mixed_order_game
