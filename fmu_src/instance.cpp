#include "instance.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "equilibrium.hpp"
#include "loop_jacobian.hpp"
#include "measures.hpp"

namespace mixed_order_game {

namespace {

// Importers form communication points by t += h or n * h: both stray by rounding, of t and of h.
Real time_tolerance(Real t, Real h) {
  return 64.0 * std::numeric_limits<Real>::epsilon() * std::fabs(t) + 1e-9 * std::fabs(h);
}

bool same_bits(std::span<const Real> a, std::span<const Real> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

std::string_view name_of(Type type) {
  switch (type) {
    case Type::real:
      return "Real";
    case Type::integer:
      return "Integer";
    case Type::boolean:
      return "Boolean";
  }
  return "";
}

std::string groups(const CommunicationGraph& graph) {
  constexpr std::size_t longest = 120;
  std::string text;
  for (const std::vector<int>& component : graph.components()) {
    text += text.empty() ? "{" : ", {";
    for (std::size_t k = 0; k < component.size(); ++k) text += (k == 0 ? "" : ", ") + std::to_string(component[k] + 1);
    text += "}";
    if (text.size() > longest) return text.substr(0, longest) + " ...";
  }
  return text;
}

void require_finite(Real value, const std::string& name) {
  if (std::isfinite(value)) return;
  throw Error(name + " is not finite (" + text_of(value) + "): the parameters or initial values are too large");
}

}  // namespace

Instance::Instance(Model model)
    : model_(std::move(model)),
      settings_(model_.game),
      loop_(model_.game.parameters),
      input_(model_.game.parameters.shape.actions()),
      initial_state_(at(loop_.layout().size())),
      initial_modes_(at(loop_.shape().actions())),
      signals_(loop_.shape()),
      rate_(initial_state_.size()),
      control_rate_(at(loop_.shape().actions())),
      d_ext_(at(loop_.shape().actions())) {}

void Instance::setup_experiment(const Experiment& experiment) {
  if (!std::isfinite(experiment.start_time)) {
    throw Error("the start time is " + text_of(experiment.start_time) + ", expected a finite number");
  }
  if (experiment.tolerance && !(*experiment.tolerance > 0.0 && *experiment.tolerance <= *largest(Range::tolerance))) {
    throw Error("the tolerance is " + text_of(*experiment.tolerance) + ", expected a positive number of at most 0.1");
  }
  if (experiment.stop_time &&
      !(std::isfinite(*experiment.stop_time) && *experiment.stop_time >= experiment.start_time)) {
    throw Error("the stop time is " + text_of(*experiment.stop_time) + ", expected a finite number of at least " +
                text_of(experiment.start_time) + ", the start time");
  }
  experiment_ = experiment;
  signals_valid_ = false;
}

void Instance::enter_initialization() { phase_ = Phase::initialization; }

void Instance::exit_initialization() {
  check_settings();
  prepare(Stage::signals);
  if (!std::all_of(rate_.begin(), rate_.end(), [](Real rate) { return std::isfinite(rate); })) {
    throw Error("the initial rates are not finite: the parameters or initial values are too large");
  }
  auto integrator = std::make_unique<Integrator>(loop_, input_, make_newton_solver(loop_.shape()));
  integrator->start(experiment_.start_time, tolerances());
  applied_ = model_.variables.save(settings_);
  integrator_ = std::move(integrator);
  touched_ = false;
  state_valid_ = signals_valid_ = control_rates_valid_ = false;
  phase_ = Phase::step_complete;
}

void Instance::reset() {
  settings_ = Settings(model_.game);
  experiment_ = {};
  integrator_.reset();
  applied_.clear();
  touched_ = failed_ = false;
  state_valid_ = signals_valid_ = control_rates_valid_ = equilibrium_valid_ = false;
  phase_ = Phase::instantiated;
}

int Instance::known(std::uint32_t reference, Type type) const {
  if (reference >= at(model_.variables.size())) {
    throw Error("value reference " + std::to_string(reference) + " is unknown, expected less than " +
                std::to_string(model_.variables.size()));
  }
  const auto number = static_cast<int>(reference);
  const Type actual = model_.variables.family(number).type;
  if (actual != type) {
    throw Error(model_.variables.name(number) + " has the type " + std::string(name_of(actual)) + ", not " +
                std::string(name_of(type)));
  }
  return number;
}

View Instance::view() const {
  View view;
  view.settings = &settings_;
  view.loop = &loop_;
  view.time = time();
  view.d_ext = d_ext_.data();
  view.state = integrator_ ? integrator_->state() : initial_state_.data();
  view.rate = rate_.data();
  view.signals = &signals_;
  view.control_rate = control_rate_.data();
  view.x_star = x_star_.data();
  view.statistics = statistics();
  return view;
}

void Instance::get(Type type, std::span<const std::uint32_t> references, Real* values) {
  const ModelVariables& variables = model_.variables;
  bool needed[static_cast<std::size_t>(Stage::equilibrium) + 1] = {};
  for (const std::uint32_t reference : references) {
    needed[static_cast<std::size_t>(variables.family(known(reference, type)).stage)] = true;
  }
  for (const Stage stage : {Stage::state, Stage::signals, Stage::equilibrium, Stage::input}) {
    if (needed[static_cast<std::size_t>(stage)]) prepare(stage);
  }
  const View source = view();
  scratch_.resize(references.size());
  for (std::size_t k = 0; k < references.size(); ++k) {
    const auto reference = static_cast<int>(references[k]);
    scratch_[k] = variables.read(reference, source);
    if (!std::isfinite(scratch_[k])) require_finite(scratch_[k], variables.name(reference));
  }
  std::copy(scratch_.begin(), scratch_.end(), values);
}

void Instance::set(Type type, std::span<const std::uint32_t> references, const Real* values) {
  const ModelVariables& variables = model_.variables;
  bool equilibrium_moved = false;
  for (std::size_t k = 0; k < references.size(); ++k) {
    const int reference = known(references[k], type);
    const Family& family = variables.family(reference);
    if (!may_be_set(family, phase_)) {
      throw Error(variables.name(reference) + " " + why_not_settable(family, phase_));
    }
    if (!contains(family.range, values[k])) {
      throw Error(variables.name(reference) + " was set to " + text_of(values[k]) + ", expected " +
                  std::string(expectation(family.range)));
    }
    equilibrium_moved = equilibrium_moved || family.moves_equilibrium;
  }
  for (std::size_t k = 0; k < references.size(); ++k) {
    const auto reference = static_cast<int>(references[k]);
    variables.family(reference).write(settings_, variables.variable(reference).slot, values[k]);
  }
  if (!references.empty()) settings_changed(equilibrium_moved);
}

void Instance::settings_changed(bool equilibrium_moved) {
  touched_ = true;
  if (equilibrium_moved) equilibrium_valid_ = false;
  // a run's outputs change with its next step, those of an instance that does not run yet change at once
  if (!integrator_) state_valid_ = signals_valid_ = false;
}

void Instance::set_input_derivatives(std::span<const std::uint32_t> references, const int* orders, const Real* values) {
  const ModelVariables& variables = model_.variables;
  for (std::size_t k = 0; k < references.size(); ++k) {
    const int reference = known(references[k], Type::real);
    const std::string name = variables.name(reference);
    if (variables.family(reference).causality != Causality::input) {
      throw Error(name + " is not an input, and only inputs have derivatives that can be set");
    }
    if (orders[k] < 1 || orders[k] > ExternalDisturbance::highest_derivative) {
      throw Error("derivative " + std::to_string(orders[k]) + " of " + name + " was set, expected an order from 1 to " +
                  std::to_string(ExternalDisturbance::highest_derivative));
    }
    if (!std::isfinite(values[k])) {
      throw Error("derivative " + std::to_string(orders[k]) + " of " + name + " was set to " + text_of(values[k]) +
                  ", expected a finite number");
    }
  }
  for (std::size_t k = 0; k < references.size(); ++k) {
    set_input_derivative(variables.variable(static_cast<int>(references[k])).slot, orders[k], values[k]);
  }
  if (!references.empty()) settings_changed(false);
}

// The polynomial set before goes on from here with one derivative changed. An input without derivatives is stored
// without a time, so that setting zeros again and again does not look like a change.
void Instance::set_input_derivative(int slot, int order, Real value) {
  constexpr int highest = ExternalDisturbance::highest_derivative;
  static_assert(highest == 3);
  ExternalDisturbance& input = settings_.input;
  const Real t = time();
  const auto polynomial = [&] { return input.numbers().subspan(at(slot) * (highest + 2), highest + 2); };
  const auto is_constant = [&] {
    return std::all_of(polynomial().begin() + 1, polynomial().begin() + highest + 1, [](Real c) { return c == 0.0; });
  };
  if (!is_constant() && polynomial()[highest + 1] != t) {
    const auto c = polynomial();
    const Real h = t - c[highest + 1];
    const Real shifted[] = {c[0] + h * (c[1] + h / 2.0 * (c[2] + h / 3.0 * c[3])), c[1] + h * (c[2] + h / 2.0 * c[3]),
                            c[2] + h * c[3], c[3]};
    input.set_value(slot, shifted[0]);
    for (int k = 1; k <= highest; ++k) input.set_derivative(slot, k, shifted[k], t);
  }
  if (value == 0.0 && is_constant()) return;
  input.set_derivative(slot, order, value, t);
  if (is_constant()) input.set_value(slot, input.value(slot));
}

void Instance::get_output_derivatives(std::span<const std::uint32_t> references, const int* orders, Real* values) {
  const ModelVariables& variables = model_.variables;
  for (std::size_t k = 0; k < references.size(); ++k) {
    const int reference = known(references[k], Type::real);
    const std::string name = variables.name(reference);
    if (variables.family(reference).read_derivative == nullptr) {
      throw Error(name + " is not an output, and only outputs have derivatives that can be read");
    }
    if (orders[k] < 1 || orders[k] > highest_output_derivative) {
      throw Error("derivative " + std::to_string(orders[k]) + " of " + name + " was asked for, expected order " +
                  std::to_string(highest_output_derivative));
    }
  }
  prepare_control_rates();
  for (const std::uint32_t reference : references) prepare(variables.family(static_cast<int>(reference)).stage);
  const View source = view();
  scratch_.resize(references.size());
  for (std::size_t k = 0; k < references.size(); ++k) {
    const auto reference = static_cast<int>(references[k]);
    scratch_[k] = variables.family(reference).read_derivative(source, variables.variable(reference).slot);
    require_finite(scratch_[k], "the derivative of " + variables.name(reference));
  }
  std::copy(scratch_.begin(), scratch_.end(), values);
}

void Instance::prepare(Stage stage) {
  switch (stage) {
    case Stage::settings:
      break;
    case Stage::input:
      settings_.input.values(time(), d_ext_.data());
      break;
    case Stage::state:
      prepare_state();
      break;
    case Stage::signals:
      prepare_signals();
      break;
    case Stage::equilibrium:
      prepare_state();
      prepare_equilibrium();
      break;
  }
}

void Instance::hand_over(const Settings& settings) {
  loop_.parameters() = settings.parameters;
  loop_.refresh();
  input_ = settings.input;
}

void Instance::prepare_state() {
  if (integrator_ || state_valid_) return;
  hand_over(settings_);
  loop_.initial_state(initial_state_.data());
  state_valid_ = true;
}

void Instance::prepare_signals() {
  prepare_state();
  if (signals_valid_) return;
  const View source = view();
  input_.values(source.time, d_ext_.data());
  loop_.evaluate(source.time, source.state, d_ext_.data(), integrator_ ? integrator_->modes() : initial_modes_,
                 signals_, rate_.data());
  signals_valid_ = true;
}

void Instance::prepare_equilibrium() {
  if (equilibrium_valid_) return;
  settings_.parameters.cost->refresh();
  x_star_ = nash_equilibrium(*settings_.parameters.cost, settings_.parameters.shape);
  equilibrium_valid_ = true;
}

// u depends on the state alone, so that u' = (d u / d state) state'; of the loop's Jacobian, the rows of the driven
// states hold d (u + g) / d state.
void Instance::prepare_control_rates() {
  prepare_signals();
  if (control_rates_valid_) return;
  const View source = view();
  const StateLayout& layout = loop_.layout();
  LoopJacobian jacobian(loop_);
  jacobian.linearize(source.state, signals_, integrator_ ? integrator_->modes() : initial_modes_);
  AlignedVector product(rate_.size());
  jacobian.multiply(rate_.data(), product.data());
  const SparseRows& pattern = loop_.parameters().dynamics->jacobian_pattern();
  for (int p = 0; p < loop_.shape().actions(); ++p) {
    const bool second = loop_.shape().is_second_order(loop_.shape().player_of(p));
    Real dynamics_rate = 0.0;
    for (int k = pattern.start[at(p)]; k < pattern.start[at(p + 1)]; ++k) {
      dynamics_rate += jacobian.dynamics[at(k)] * rate_[at(layout.x() + pattern.column[at(k)])];
    }
    control_rate_[at(p)] = product[at((second ? layout.reference() : layout.x()) + p)] - dynamics_rate;
  }
  control_rates_valid_ = true;
}

Tolerances Instance::tolerances() const {
  Tolerances tolerances;
  tolerances.relative = settings_.tolerance_relative > 0.0 ? settings_.tolerance_relative
                                                           : experiment_.tolerance.value_or(default_tolerance);
  tolerances.absolute = settings_.tolerance_absolute > 0.0 ? settings_.tolerance_absolute : 0.01 * tolerances.relative;
  return tolerances;
}

/// What involves several values, so that it can be judged only once all are set.
void Instance::check_settings() {
  const CommunicationGraph& graph = settings_.parameters.graph;
  if (!settings_.allow_disconnected && graph.components().size() > 1) {
    throw Error("the weights a[i,j] leave the players in separate groups " + groups(graph) +
                ", expected a connected graph, or allow_disconnected = true");
  }
  prepare_equilibrium();
}

Instance::Change Instance::judge_changes() {
  if (!touched_) return Change::none;
  const std::vector<Real> numbers = model_.variables.save(settings_);
  if (same_bits(numbers, applied_)) {
    touched_ = false;
    return Change::none;
  }
  const std::size_t parameters = model_.variables.saved_parameters();
  if (same_bits(std::span(numbers).first(parameters), std::span(applied_).first(parameters))) return Change::input;
  check_settings();
  return Change::parameters;
}

void Instance::apply(Change change) {
  if (change == Change::none) return;
  if (change == Change::parameters) {
    hand_over(settings_);
  } else {
    input_ = settings_.input;
  }
  applied_ = model_.variables.save(settings_);
  touched_ = false;
  integrator_->restart(change == Change::parameters);
}

void Instance::do_step(Real t, Real h) {
  const Real now = integrator_->time();
  if (!(h > 0.0) || !std::isfinite(h)) {
    throw Error("the step size is " + text_of(h) + ", expected a positive finite number");
  }
  if (!std::isfinite(t) || !(std::fabs(t - now) <= time_tolerance(std::max(std::fabs(t), std::fabs(now)), h))) {
    throw Error("the communication point is " + text_of(t) + ", expected " + text_of(now) +
                ", where the last step ended");
  }
  const Real end = std::max(t + h, now);
  if (!std::isfinite(end)) throw Error("the step ends at " + text_of(end) + ", expected a finite time");
  if (experiment_.stop_time && end > *experiment_.stop_time + time_tolerance(end, h)) {
    throw Error("the step from " + text_of(t) + " by " + text_of(h) + " ends after the stop time " +
                text_of(*experiment_.stop_time));
  }
  const Change change = judge_changes();
  signals_valid_ = control_rates_valid_ = false;
  try {
    apply(change);
    integrator_->advance(end);
  } catch (const std::exception& error) {
    phase_ = Phase::error;
    failed_ = true;
    throw IntegrationError("the step from t = " + text_of(t) + " by h = " + text_of(h) + " failed: " + error.what());
  }
}

Snapshot Instance::save() const {
  if (failed_) throw Error("there is no state to save after a failed integration");
  Snapshot snapshot;
  snapshot.phase = phase_;
  snapshot.experiment = experiment_;
  snapshot.settings = model_.variables.save(settings_);
  if (integrator_) {
    snapshot.applied = applied_;
    snapshot.checkpoint = integrator_->checkpoint();
  }
  return snapshot;
}

SnapshotSizes Instance::snapshot_sizes() const {
  return {.settings = model_.variables.saved_size(), .states = initial_state_.size(), .modes = initial_modes_.size()};
}

bool Instance::restore(const Snapshot& snapshot) {
  const ModelVariables& variables = model_.variables;
  variables.load(snapshot.settings, settings_);
  experiment_ = snapshot.experiment;
  failed_ = false;
  state_valid_ = signals_valid_ = control_rates_valid_ = equilibrium_valid_ = false;
  if (!snapshot.checkpoint) {
    integrator_.reset();
    applied_.clear();
    touched_ = false;
    phase_ = snapshot.phase;
    return true;
  }
  applied_ = snapshot.applied;
  touched_ = !same_bits(applied_, snapshot.settings);
  if (touched_) {
    Settings applied(model_.game);
    variables.load(applied_, applied);
    hand_over(applied);
  } else {
    hand_over(settings_);
  }
  if (!integrator_) integrator_ = std::make_unique<Integrator>(loop_, input_, make_newton_solver(loop_.shape()));
  bool repeated = true;
  try {
    repeated = integrator_->restore(*snapshot.checkpoint, tolerances());
  } catch (...) {
    phase_ = Phase::error;
    failed_ = true;
    throw;
  }
  phase_ = snapshot.phase;
  return repeated;
}

}  // namespace mixed_order_game
