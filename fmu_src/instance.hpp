// One instance of the model, as any version of FMI sees it: settings, the run, and what is read from it.
//
// Every call either succeeds or throws: Error when it was refused, and then nothing has changed; IntegrationError when
// the integration failed, and then the instance is in the error state.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "errors.hpp"
#include "lifecycle.hpp"
#include "model.hpp"
#include "settings.hpp"
#include "snapshot.hpp"

namespace mixed_order_game {

class Instance {
 public:
  explicit Instance(Model model);
  Instance(const Instance&) = delete;  // the integrator refers to its members
  Instance& operator=(const Instance&) = delete;

  [[nodiscard]] const Model& model() const { return model_; }
  [[nodiscard]] Phase phase() const { return phase_; }
  /// Time of the last communication point, s.
  [[nodiscard]] Real time() const { return integrator_ ? integrator_->time() : experiment_.start_time; }
  [[nodiscard]] Statistics statistics() const { return integrator_ ? integrator_->statistics() : Statistics{}; }

  void setup_experiment(const Experiment& experiment);
  void enter_initialization();
  void exit_initialization();
  void terminate() { phase_ = Phase::terminated; }
  void reset();

  void get(Type type, std::span<const std::uint32_t> references, Real* values);
  void set(Type type, std::span<const std::uint32_t> references, const Real* values);
  void set_input_derivatives(std::span<const std::uint32_t> references, const int* orders, const Real* values);
  void get_output_derivatives(std::span<const std::uint32_t> references, const int* orders, Real* values);

  /// Moves from the communication point t to t + h.
  void do_step(Real t, Real h);

  [[nodiscard]] Snapshot save() const;
  /// False when this machine's arithmetic does not repeat the steps that led to the saved state bit for bit; the run
  /// then goes on from that state with a restart of the integrator.
  bool restore(const Snapshot& snapshot);
  [[nodiscard]] SnapshotSizes snapshot_sizes() const;

 private:
  [[nodiscard]] int known(std::uint32_t reference, Type type) const;
  [[nodiscard]] Tolerances tolerances() const;
  [[nodiscard]] View view() const;
  void prepare(Stage stage);
  void prepare_state();
  void prepare_signals();
  void prepare_equilibrium();
  void prepare_control_rates();
  void settings_changed(bool equilibrium_moved);
  void set_input_derivative(int slot, int order, Real value);
  void check_settings();

  /// What differs, bit for bit, between the settings and those that the integrator works with.
  enum class Change { none, input, parameters };
  Change judge_changes();
  void apply(Change change);
  /// Hands settings on to the loop and the input that the integrator reads.
  void hand_over(const Settings& settings);

  Model model_;
  Phase phase_ = Phase::instantiated;
  bool failed_ = false;
  Experiment experiment_;
  Settings settings_;  // as the importer set them

  // as the integrator knows them
  ClosedLoop loop_;
  ExternalDisturbance input_;
  std::vector<Real> applied_;  // their numbers, once the run has begun
  std::unique_ptr<Integrator> integrator_;
  bool touched_ = false;  // settings_ may differ from applied_

  // computed when asked for
  bool state_valid_ = false;
  bool signals_valid_ = false;
  bool control_rates_valid_ = false;
  bool equilibrium_valid_ = false;
  AlignedVector initial_state_;
  Modes initial_modes_;
  Signals signals_;
  AlignedVector rate_;
  AlignedVector control_rate_;
  AlignedVector d_ext_;
  std::vector<Real> x_star_;
  std::vector<Real> scratch_;
};

}  // namespace mixed_order_game
