// A run by the FMU's own integrator, from one communication point to the next; changed settings act from the next step.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "evaluation.hpp"
#include "integration/integrator.hpp"

namespace mixed_order_game {

class CoSimulation {
 public:
  /// All that a run consists of besides the settings that the importer made since its last step.
  struct Point {
    std::vector<Real> acting;  ///< settings that act, as ModelVariables::save gives them
    Real time = 0.0;           ///< of the communication point, absolute
    Checkpoint checkpoint;
  };

  /// The evaluation must outlive the run.
  explicit CoSimulation(const Evaluation& evaluation);

  /// Begins at the loop's time origin with its initial state; x_star is empty where it is not known.
  void start(Tolerances tolerances, std::vector<Real> acting, const JudgingRule& rule, std::span<const Real> x_star);
  [[nodiscard]] Standing standing() const;
  [[nodiscard]] Statistics statistics() const { return integrator_.statistics(); }

  /// What differs, bit for bit, from the settings that act: numbers of parameters come first, of inputs last.
  [[nodiscard]] Change change_to(std::span<const Real> settings, std::size_t parameters, std::size_t inputs) const;
  /// The same where nothing but inputs was touched.
  [[nodiscard]] Change change_to(std::span<const Real> inputs) const;
  /// The evaluation is about to take over changed settings.
  void prepare_change() { integrator_.prepare_change(); }
  /// The evaluation has taken them over.
  void settings_act(std::vector<Real> acting, std::span<const Real> x_star);
  /// The evaluation has taken over these inputs alone.
  void inputs_act(std::span<const Real> inputs);

  /// Where a step from t by h ends; throws Error when it is none that can be taken.
  [[nodiscard]] Real end_of_step(Real t, Real h, std::optional<Real> stop_time) const;
  void advance(Real t_end);

  [[nodiscard]] Judgement judgement() { return integrator_.judgement(); }
  /// As Integrator's; from the loop's time origin on.
  void begin_errors_anew(Real from) { integrator_.begin_errors_anew(from); }

  [[nodiscard]] Point save() { return {acting_, time_, integrator_.checkpoint()}; }
  /// As Integrator::restore; the evaluation has taken over the settings that act and the start time.
  bool restore(const Point& point, Tolerances tolerances);

 private:
  const ClosedLoop& loop_;
  Integrator integrator_;
  Real time_ = 0.0;
  std::vector<Real> acting_;
};

}  // namespace mixed_order_game
