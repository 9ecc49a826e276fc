// A run by the FMU's own integrator, from one communication point to the next; changed settings act from the next step.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "evaluation.hpp"
#include "integrator.hpp"

namespace mixed_order_game {

class CoSimulation {
 public:
  /// All that a run consists of besides the settings that the importer made since its last step.
  struct Point {
    std::vector<Real> acting;  ///< settings that act, as ModelVariables::save gives them
    Checkpoint checkpoint;
  };

  /// The evaluation must outlive the run.
  explicit CoSimulation(const Evaluation& evaluation);

  /// Begins at time t with the loop's initial state.
  void start(Real t, Tolerances tolerances, std::vector<Real> acting);
  [[nodiscard]] Standing standing() const;
  [[nodiscard]] Statistics statistics() const { return integrator_.statistics(); }

  /// What differs, bit for bit, from the settings that act; the numbers of parameters come before those of inputs.
  [[nodiscard]] Change change_to(std::span<const Real> settings, std::size_t parameters) const;
  /// The evaluation has taken over changed settings.
  void settings_act(Change change, std::vector<Real> acting);

  /// Where a step from t by h ends; throws Error when it is none that can be taken.
  [[nodiscard]] Real end_of_step(Real t, Real h, std::optional<Real> stop_time) const;
  void advance(Real t_end) { integrator_.advance(t_end); }

  [[nodiscard]] Point save() const { return {acting_, integrator_.checkpoint()}; }
  /// As Integrator::restore; the evaluation has taken over the settings that act.
  bool restore(const Point& point, Tolerances tolerances);

 private:
  Integrator integrator_;
  std::vector<Real> acting_;
};

}  // namespace mixed_order_game
