// The closed loop under the settings that act now, and what is computed from it only when a variable asks for it.
#pragma once

#include <span>

#include "loop/closed_loop.hpp"
#include "loop/inputs.hpp"
#include "loop/located_conditions.hpp"
#include "settings.hpp"

namespace mixed_order_game {

/// Where a run stands.
struct Standing {
  Real time = 0.0;          ///< absolute, s
  Real since_origin = 0.0;  ///< the same, from the loop's time origin on
  const Real* state = nullptr;
  const Modes* modes = nullptr;
};

class Evaluation {
 public:
  explicit Evaluation(const Game& game);
  Evaluation(const Evaluation&) = delete;  // integrators refer to its members
  Evaluation& operator=(const Evaluation&) = delete;

  [[nodiscard]] const ClosedLoop& loop() const { return loop_; }
  [[nodiscard]] const LocatedConditions& conditions() const { return conditions_; }
  [[nodiscard]] const Inputs& inputs() const { return inputs_; }
  /// The values of those that act, where the run stands.
  const Real* inputs_at(const Standing& standing);

  /// These settings, or these inputs, act from here on.
  void act(const Settings& settings);
  void act(const Inputs& inputs);
  /// The loop counts time from here on, s.
  void set_time_origin(Real time_origin);
  /// The run stands somewhere else, or goes on from another run.
  void moved() { signals_valid_ = false; }
  /// The costs, whose equilibrium is asked for, are others.
  void costs_changed() { equilibrium_valid_ = false; }

  /// Computes what the variables of a stage need.
  void prepare(Stage stage, Settings& settings, const Standing& standing);
  void prepare_signals(const Standing& standing);
  /// As LocatedConditions::event_functions.
  void event_indicators(const Standing& standing, Real tolerance, Real* values);
  /// Throws GameError when the game has no unique equilibrium.
  void prepare_equilibrium(Settings& settings);
  /// That prepare_equilibrium found; empty where it was not asked for.
  [[nodiscard]] std::span<const Real> x_star() const { return x_star_; }

  /// Signals and rates that prepare_signals found.
  [[nodiscard]] const Signals& signals() const { return signals_; }
  [[nodiscard]] const AlignedVector& rate() const { return rate_; }
  /// Inputs that act there.
  [[nodiscard]] const Real* acting_inputs() const { return input_values_.data(); }
  [[nodiscard]] View view(const Settings& settings, const Standing& standing);

 private:
  ClosedLoop loop_;
  LocatedConditions conditions_;
  Inputs inputs_;

  bool signals_valid_ = false;
  bool equilibrium_valid_ = false;
  Signals signals_;
  AlignedVector rate_;
  AlignedVector input_values_;  // that act
  AlignedVector input_values_as_set_;
  std::vector<Real> x_star_;
};

}  // namespace mixed_order_game
