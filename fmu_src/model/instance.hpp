// One instance of the model, as any version of FMI sees it: settings, the run, and what is read from it.
//
// Every call either succeeds or throws: Error when it was refused, and then nothing has changed; NotComputable,
// likewise, when a run by model exchange stands where the model has no finite values; IntegrationError when the
// integration failed, and then the instance is in the error state.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "co_simulation.hpp"
#include "directional_derivative.hpp"
#include "errors.hpp"
#include "evaluation.hpp"
#include "lifecycle.hpp"
#include "model.hpp"
#include "model_exchange.hpp"
#include "settings.hpp"
#include "snapshot.hpp"

namespace mixed_order_game {

/// The model has no finite values at this time and state.
class NotComputable : public Error {
 public:
  using Error::Error;
};

class Instance {
 public:
  Instance(Model model, Interface interface);
  Instance(const Instance&) = delete;  // the integrator refers to its members
  Instance& operator=(const Instance&) = delete;

  [[nodiscard]] const Model& model() const { return model_; }
  [[nodiscard]] Interface interface() const { return interface_; }
  [[nodiscard]] Phase phase() const { return phase_; }
  /// Of the last communication point, or as the importer set it, s.
  [[nodiscard]] Real time() const { return standing().time; }
  [[nodiscard]] Statistics statistics() const;

  void setup_experiment(const Experiment& experiment);
  void enter_initialization();
  void exit_initialization();
  void terminate() { phase_ = Phase::terminated; }
  void reset();

  void get(Type type, std::span<const std::uint32_t> references, Real* values);
  void set(Type type, std::span<const std::uint32_t> references, const Real* values);
  void set_input_derivatives(std::span<const std::uint32_t> references, const int* orders, const Real* values);
  void get_output_derivatives(std::span<const std::uint32_t> references, const int* orders, Real* values);
  /// derivatives[k] of unknown k along changes of the knowns; a known that is named twice changes by the sum.
  void get_directional_derivative(std::span<const std::uint32_t> unknowns, std::span<const std::uint32_t> knowns,
                                  const Real* changes, Real* derivatives);

  /// Co-simulation: moves from the communication point t to t + h.
  void do_step(Real t, Real h);

  // Model exchange
  void enter_event_mode();
  /// True when the state moved.
  bool new_discrete_states();
  /// The absolute time of the next event that is known beforehand; infinite when there is none.
  [[nodiscard]] Real next_event() const { return model_exchange_->next_event(); }
  void enter_continuous_time_mode();
  /// True when event mode has to be entered.
  bool completed_integrator_step();
  void set_time(Real t);
  void set_continuous_states(std::span<const Real> state);
  void get_continuous_states(std::span<Real> state);
  void get_derivatives(std::span<Real> rate);
  void get_event_indicators(std::span<Real> values);
  void get_nominals(std::span<Real> nominals) const;

  [[nodiscard]] Snapshot save();
  /// A state that to_bytes() wrote; anything else, and settings that could not have been set, are refused.
  [[nodiscard]] Snapshot read(std::span<const char> bytes) const;
  /// False when this machine's arithmetic does not repeat the steps that led to the saved state bit for bit; the run
  /// then goes on from that state with a restart of the integrator.
  bool restore(const Snapshot& snapshot);
  [[nodiscard]] SnapshotShape snapshot_shape() const;

 private:
  using Stages = std::array<bool, static_cast<std::size_t>(Stage::judgement) + 1>;

  /// The reference of a variable of this type; anything else is refused.
  [[nodiscard]] int known(std::uint32_t reference, Type type) const;
  [[noreturn]] void refuse(std::uint32_t reference, Type type) const;
  const Stages& stages_of(Type type, std::span<const std::uint32_t> references);
  [[noreturn]] void refuse_value(Real value, const std::string& name) const;
  [[nodiscard]] Standing standing() const;
  [[nodiscard]] Tolerances tolerances() const;
  void act();
  Standing prepare(const Stages& needed);
  [[nodiscard]] View prepare_tangent(std::span<const std::uint32_t> references);
  void read_along(std::span<const std::uint32_t> references, const View& source, const Tangent& tangent, Real* values);
  void settings_changed(Change change, bool equilibrium_moved);
  void set_input_derivative(int slot, int order, Real value);
  void check_settings();
  std::span<const Real> event_indicators();
  [[nodiscard]] JudgingRule judging_rule() const;
  [[nodiscard]] Judgement judgement();

  Model model_;
  Interface interface_;
  Phase phase_ = Phase::instantiated;
  bool failed_ = false;
  Experiment experiment_;
  Settings settings_;                    // as the importer set them
  Change touched_ = Change::parameters;  // what may differ from those that act
  Evaluation evaluation_;
  DirectionalDerivative directional_derivative_;
  AlignedVector initial_state_;
  Modes initial_modes_;
  // once the run has begun, one of them
  std::unique_ptr<CoSimulation> co_simulation_;
  std::optional<ModelExchange> model_exchange_;
  std::vector<Real> scratch_;
  Judgement judgement_;  // that was read last
  // the variables that were read last
  Type known_type_{};
  std::vector<std::uint32_t> known_references_;
  Stages known_stages_{};
};

}  // namespace mixed_order_game
