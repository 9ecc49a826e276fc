#include "instance.hpp"

#include <algorithm>
#include <cmath>

#include "loop/failure.hpp"
#include "newton/block_elimination.hpp"

namespace mixed_order_game {

namespace {

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

void require_length(std::size_t length, const char* what, std::size_t expected) {
  if (length == expected) return;
  throw Error("there are " + std::to_string(length) + " " + what + ", expected " + std::to_string(expected));
}

}  // namespace

Instance::Instance(Model model, Interface interface)
    : model_(std::move(model)),
      interface_(interface),
      settings_(model_.game),
      evaluation_(model_.game),
      directional_derivative_(model_, evaluation_.loop()),
      initial_state_(at(evaluation_.loop().layout().size())),
      initial_modes_(at(LocatedConditions::count(model_.game.parameters))) {}

Standing Instance::standing() const {
  if (co_simulation_) return co_simulation_->standing();
  if (model_exchange_) return model_exchange_->standing();
  return {
      .time = experiment_.start_time, .since_origin = 0.0, .state = initial_state_.data(), .modes = &initial_modes_};
}

Statistics Instance::statistics() const {
  if (co_simulation_) return co_simulation_->statistics();
  if (model_exchange_) return model_exchange_->statistics();
  return {};
}

namespace {

void require_valid(const Experiment& experiment) {
  if (!std::isfinite(experiment.start_time)) {
    throw Error("the start time is " + text_of(experiment.start_time) + ", expected a finite number");
  }
  if (experiment.tolerance && !(*experiment.tolerance > 0.0 && *experiment.tolerance <= *Range::tolerance.largest)) {
    throw Error("the tolerance is " + text_of(*experiment.tolerance) + ", expected a positive number of at most 0.1");
  }
  if (experiment.stop_time &&
      !(std::isfinite(*experiment.stop_time) && *experiment.stop_time >= experiment.start_time)) {
    throw Error("the stop time is " + text_of(*experiment.stop_time) + ", expected a finite number of at least " +
                text_of(experiment.start_time) + ", the start time");
  }
}

}  // namespace

void Instance::setup_experiment(const Experiment& experiment) {
  require_valid(experiment);
  experiment_ = experiment;
  evaluation_.set_time_origin(experiment_.start_time);
}

void Instance::enter_initialization() { phase_ = Phase::initialization; }

void Instance::exit_initialization() {
  check_settings();
  act();
  evaluation_.prepare_signals(standing());
  const AlignedVector& rate = evaluation_.rate();
  if (!std::all_of(rate.begin(), rate.end(), [](Real value) { return std::isfinite(value); })) {
    const std::string reason =
        unusable_start(evaluation_.loop(), evaluation_.acting_inputs(), evaluation_.signals(), rate.data());
    throw Error("the initial rates are not finite: " +
                (reason.empty() ? "the parameters or initial values are too large" : reason));
  }
  if (interface_ == Interface::model_exchange) {
    model_exchange_.emplace(evaluation_, experiment_.start_time, initial_state_, initial_modes_, judging_rule(),
                            evaluation_.x_star());
    phase_ = Phase::event_mode;
    return;
  }
  auto run = std::make_unique<CoSimulation>(evaluation_);
  run->start(tolerances(), model_.variables.save(settings_), judging_rule(), evaluation_.x_star());
  co_simulation_ = std::move(run);
  evaluation_.moved();
  phase_ = Phase::step_complete;
}

void Instance::reset() {
  settings_ = Settings(model_.game);
  experiment_ = {};
  evaluation_.set_time_origin(experiment_.start_time);
  co_simulation_.reset();
  model_exchange_.reset();
  touched_ = Change::parameters;
  failed_ = false;
  evaluation_.moved();
  evaluation_.costs_changed();
  phase_ = Phase::instantiated;
}

int Instance::known(std::uint32_t reference, Type type) const {
  if (reference < at(model_.variables.size())) {
    const auto number = static_cast<int>(reference);
    if (model_.variables.variable(number).type == type) return number;
  }
  refuse(reference, type);
}

void Instance::refuse(std::uint32_t reference, Type type) const {
  const ModelVariables& variables = model_.variables;
  if (reference >= at(variables.size())) {
    throw Error("value reference " + std::to_string(reference) + " is unknown, expected less than " +
                std::to_string(variables.size()));
  }
  const auto number = static_cast<int>(reference);
  throw Error(variables.name(number) + " has the type " + std::string(name_of(variables.variable(number).type)) +
              ", not " + std::string(name_of(type)));
}

/// What the variables need. Importers ask for the same ones at every communication point: those are not looked up
/// again.
const Instance::Stages& Instance::stages_of(Type type, std::span<const std::uint32_t> references) {
  if (type == known_type_ && references.size() == known_references_.size() &&
      std::equal(references.data(), references.data() + references.size(), known_references_.data())) {
    return known_stages_;
  }
  Stages needed{};
  for (const std::uint32_t reference : references) {
    needed[static_cast<std::size_t>(model_.variables.variable(known(reference, type)).stage)] = true;
  }
  known_references_.assign(references.begin(), references.end());
  known_type_ = type;
  return known_stages_ = needed;
}

void Instance::get(Type type, std::span<const std::uint32_t> references, Real* values) {
  const ModelVariables& variables = model_.variables;
  const Stages& needed = stages_of(type, references);
  View source = evaluation_.view(settings_, prepare(needed));
  if (needed[static_cast<std::size_t>(Stage::statistics)]) source.statistics = statistics();
  if (needed[static_cast<std::size_t>(Stage::judgement)]) {
    judgement_ = judgement();
    source.judgement = &judgement_;
  }
  scratch_.resize(references.size());
  for (std::size_t k = 0; k < references.size(); ++k) {
    const auto reference = static_cast<int>(references[k]);
    scratch_[k] = variables.read(reference, source);
    if (std::isfinite(scratch_[k])) continue;
    if (model_exchange_) throw NotComputable(variables.name(reference) + " is not finite");
    refuse_value(scratch_[k], variables.name(reference));
  }
  std::copy(scratch_.begin(), scratch_.end(), values);
}

/// Says why a value is not finite.
void Instance::refuse_value(Real value, const std::string& name) const {
  const std::string told = name + " is not finite (" + (std::isnan(value) ? "nan" : text_of(value)) + ")";
  if (!co_simulation_)
    throw Error(told + ": the parameters or initial values are too large, or it is not defined there");
  const Standing standing = co_simulation_->standing();
  const std::string growth = unbounded_growth(evaluation_.loop(), standing.state, evaluation_.acting_inputs());
  throw Error(told + " at t = " + number_text(standing.time, 15) +
              " s: " + (growth.empty() ? "it is not defined, or too large, for the values reached" : growth));
}

void Instance::set(Type type, std::span<const std::uint32_t> references, const Real* values) {
  const ModelVariables& variables = model_.variables;
  bool equilibrium_moved = false;
  bool state_set = false;
  bool errors_begin_anew = false;
  Change change = Change::none;
  for (std::size_t k = 0; k < references.size(); ++k) {
    const int reference = known(references[k], type);
    const Family& family = variables.family(reference);
    if (!may_be_set(family, phase_)) {
      throw Error(variables.name(reference) + " " + why_not_settable(family, phase_, interface_));
    }
    if (!family.range.contains(values[k])) {
      throw Error(variables.name(reference) + " was set to " + text_of(values[k]) + ", expected " +
                  family.range.expectation());
    }
    if (family.is_state) {
      state_set = true;
      continue;
    }
    if (family.only_judges) {
      errors_begin_anew = true;
      continue;
    }
    equilibrium_moved = equilibrium_moved || family.moves_equilibrium;
    change = std::max(change, family.causality == Causality::input ? Change::input : Change::parameters);
  }
  if (state_set) scratch_.assign(standing().state, standing().state + initial_state_.size());
  for (std::size_t k = 0; k < references.size(); ++k) {
    const auto reference = static_cast<int>(references[k]);
    const Variable& variable = variables.variable(reference);
    if (variable.state >= 0) {
      scratch_[at(variable.state)] = values[k];
    } else {
      variables.family(reference).write(settings_, variable.slot, values[k]);
    }
  }
  if (state_set) model_exchange_->set_state(scratch_);
  settings_changed(change, equilibrium_moved);
  if (!errors_begin_anew) return;
  if (co_simulation_) co_simulation_->begin_errors_anew(judging_rule().errors_from);
  if (model_exchange_) model_exchange_->begin_errors_anew(judging_rule().errors_from);
}

JudgingRule Instance::judging_rule() const {
  return {.settling_band = settings_.settling_band, .errors_from = settings_.judge_from - experiment_.start_time};
}

Judgement Instance::judgement() {
  if (co_simulation_) return co_simulation_->judgement();
  if (model_exchange_) return model_exchange_->judgement();
  act();
  if (model_.game.parameters.shape.hosts_all()) evaluation_.prepare_equilibrium(settings_);
  Judge judge(evaluation_.loop());
  judge.set_equilibrium(evaluation_.x_star());
  judge.start(0.0, judging_rule(), {initial_state_.data(), evaluation_.inputs_at(standing())}, initial_modes_);
  return judge.judgement();
}

void Instance::settings_changed(Change change, bool equilibrium_moved) {
  touched_ = std::max(touched_, change);
  if (equilibrium_moved) evaluation_.costs_changed();
}

void Instance::set_input_derivatives(std::span<const std::uint32_t> references, const int* orders, const Real* values) {
  const ModelVariables& variables = model_.variables;
  for (std::size_t k = 0; k < references.size(); ++k) {
    const int reference = known(references[k], Type::real);
    const auto derivative = [&] {
      return "derivative " + std::to_string(orders[k]) + " of " + variables.name(reference);
    };
    if (variables.family(reference).causality != Causality::input) {
      throw Error(variables.name(reference) + " is not an input, and only inputs have derivatives that can be set");
    }
    if (orders[k] < 1 || orders[k] > Inputs::highest_derivative) {
      throw Error(derivative() + " was set, expected an order from 1 to " + std::to_string(Inputs::highest_derivative));
    }
    if (!std::isfinite(values[k])) {
      throw Error(derivative() + " was set to " + text_of(values[k]) + ", expected a finite number");
    }
  }
  for (std::size_t k = 0; k < references.size(); ++k) {
    set_input_derivative(variables.variable(static_cast<int>(references[k])).slot, orders[k], values[k]);
  }
  if (!references.empty()) settings_changed(Change::input, false);
}

// The polynomial set before goes on from here with one derivative changed. An input without derivatives is stored
// without a time, so that setting zeros again and again does not look like a change.
void Instance::set_input_derivative(int slot, int order, Real value) {
  constexpr int highest = Inputs::highest_derivative;
  static_assert(highest == 3);
  Inputs& inputs = settings_.inputs;
  const Real t = standing().since_origin;
  const auto polynomial = [&] { return inputs.numbers().subspan(at(slot) * (highest + 2), highest + 2); };
  if (!inputs.is_constant(slot) && polynomial()[highest + 1] != t) {
    const auto c = polynomial();
    const Real h = t - c[highest + 1];
    const Real shifted[] = {c[0] + h * (c[1] + h / 2.0 * (c[2] + h / 3.0 * c[3])), c[1] + h * (c[2] + h / 2.0 * c[3]),
                            c[2] + h * c[3], c[3]};
    inputs.set_value(slot, shifted[0]);
    for (int k = 1; k <= highest; ++k) inputs.set_derivative(slot, k, shifted[k], t);
  }
  if (value == 0.0 && inputs.is_constant(slot)) return;
  inputs.set_derivative(slot, order, value, t);
  if (inputs.is_constant(slot)) inputs.set_value(slot, inputs.value(slot));
}

void Instance::get_output_derivatives(std::span<const std::uint32_t> references, const int* orders, Real* values) {
  const ModelVariables& variables = model_.variables;
  for (std::size_t k = 0; k < references.size(); ++k) {
    const int reference = known(references[k], Type::real);
    if (variables.family(reference).causality != Causality::output) {
      throw Error(variables.name(reference) + " is not an output, and only outputs have derivatives that can be read");
    }
    if (orders[k] < 1 || orders[k] > highest_output_derivative) {
      throw Error("derivative " + std::to_string(orders[k]) + " of " + variables.name(reference) +
                  " was asked for, expected order " + std::to_string(highest_output_derivative));
    }
  }
  const View source = prepare_tangent(references);
  const Tangent tangent = directional_derivative_.along_run(source, standing(), evaluation_.inputs());
  read_along(references, source, tangent, values);
}

void Instance::get_directional_derivative(std::span<const std::uint32_t> unknowns,
                                          std::span<const std::uint32_t> knowns, const Real* changes,
                                          Real* derivatives) {
  const Equations equations = phase_ == Phase::initialization ? Equations::initial : Equations::running;
  for (const std::uint32_t unknown : unknowns) {
    const int reference = known(unknown, Type::real);
    if (!is_unknown(model_, reference, equations)) throw Error(why_no_unknown(model_, reference, equations));
  }
  for (std::size_t k = 0; k < knowns.size(); ++k) {
    const int reference = known(knowns[k], Type::real);
    if (!is_known(model_, reference, equations)) throw Error(why_no_known(model_, reference, equations));
    if (!std::isfinite(changes[k])) {
      throw Error("the change of " + model_.variables.name(reference) + " is " + text_of(changes[k]) +
                  ", expected a finite number");
    }
  }
  const View source = prepare_tangent(unknowns);
  const Tangent tangent = directional_derivative_.along({knowns, changes}, equations, source, standing());
  read_along(unknowns, source, tangent, derivatives);
}

/// What a tangent needs, and the variables whose derivatives are asked for.
View Instance::prepare_tangent(std::span<const std::uint32_t> references) {
  Stages needed{};
  needed[static_cast<std::size_t>(Stage::signals)] = true;
  for (const std::uint32_t reference : references) {
    needed[static_cast<std::size_t>(model_.variables.family(static_cast<int>(reference)).stage)] = true;
  }
  return evaluation_.view(settings_, prepare(needed));
}

void Instance::read_along(std::span<const std::uint32_t> references, const View& source, const Tangent& tangent,
                          Real* values) {
  const ModelVariables& variables = model_.variables;
  scratch_.resize(references.size());
  for (std::size_t k = 0; k < references.size(); ++k) {
    const auto reference = static_cast<int>(references[k]);
    scratch_[k] = variables.family(reference).read_along(source, tangent, variables.variable(reference).slot);
    if (std::isfinite(scratch_[k])) continue;
    throw Error("the derivative of " + variables.name(reference) +
                " is not finite: a cost, dynamics or a disturbance has none where it is taken, or the parameters or "
                "initial values are too large");
  }
  std::copy(scratch_.begin(), scratch_.end(), values);
}

/// The settings act: at once, but from the next step on while co-simulation runs.
void Instance::act() {
  if (co_simulation_ || touched_ == Change::none) return;
  if (touched_ == Change::parameters) {
    evaluation_.act(settings_);
  } else {
    evaluation_.act(settings_.inputs);
  }
  if (!model_exchange_) {
    evaluation_.loop().initial_state(initial_state_.data());
    evaluation_.conditions().begin(0.0, initial_state_.data(), evaluation_.inputs_at(standing()), initial_modes_);
  }
  touched_ = Change::none;
}

Standing Instance::prepare(const Stages& needed) {
  const auto is_needed = [&](Stage stage) { return needed[static_cast<std::size_t>(stage)]; };
  if (is_needed(Stage::state) || is_needed(Stage::signals) || is_needed(Stage::equilibrium)) act();
  const Standing now = standing();
  for (const Stage stage : {Stage::inputs, Stage::signals, Stage::equilibrium}) {
    if (is_needed(stage)) evaluation_.prepare(stage, settings_, now);
  }
  return now;
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
  const bool hosts_all = settings_.parameters.shape.hosts_all();
  const auto apart = hosts_all ? graph.not_reached() : std::nullopt;
  if (!settings_.allow_disconnected && apart && graph.directed()) {
    throw Error("by the weights a[i,j] nothing of player " + std::to_string(apart->first + 1) + " reaches player " +
                std::to_string(apart->second + 1) +
                ", expected a strongly connected graph, or allow_disconnected = true");
  }
  if (!settings_.allow_disconnected && apart) {
    throw Error("the weights a[i,j] leave the players in separate groups " + groups(graph) +
                ", expected a connected graph, or allow_disconnected = true");
  }
  require_moderate_factors(graph);
  require_bounded_weights(settings_.parameters);
  settings_.parameters.judge_switching();
  if (hosts_all) evaluation_.prepare_equilibrium(settings_);
}

void Instance::do_step(Real t, Real h) {
  const Real end = co_simulation_->end_of_step(t, h, experiment_.stop_time);
  Change change = Change::none;
  std::vector<Real> numbers;
  if (touched_ == Change::input) change = co_simulation_->change_to(settings_.inputs.numbers());
  if (touched_ == Change::parameters) {
    numbers = model_.variables.save(settings_);
    change = co_simulation_->change_to(numbers, model_.variables.saved_parameters(), model_.variables.saved_inputs());
    if (change == Change::parameters) check_settings();
  }
  touched_ = Change::none;
  evaluation_.moved();
  try {
    if (change != Change::none) co_simulation_->prepare_change();
    if (change == Change::parameters) {
      evaluation_.act(settings_);
      co_simulation_->settings_act(std::move(numbers), evaluation_.x_star());
    }
    if (change == Change::input) {
      evaluation_.act(settings_.inputs);
      co_simulation_->inputs_act(settings_.inputs.numbers());
    }
    co_simulation_->advance(end);
  } catch (const std::exception& error) {
    phase_ = Phase::error;
    failed_ = true;
    throw IntegrationError("the step from t = " + text_of(t) + " by h = " + text_of(h) + " failed: " + error.what());
  }
}

void Instance::enter_event_mode() {
  act();
  model_exchange_->accept_step();
  phase_ = Phase::event_mode;
}

bool Instance::new_discrete_states() {
  event_indicators();  // where they are not finite, no mode can be found
  return model_exchange_->update_modes(tolerances().relative);
}

void Instance::enter_continuous_time_mode() {
  check_settings();
  act();
  model_exchange_->begin_after_event(evaluation_.x_star());
  phase_ = Phase::continuous_time_mode;
}

// Integrators evaluate the model beyond the stop time and interpolate back, so that not the time is judged but the
// step. They locate where an event indicator changes its sign. An indicator that is positive when a step is complete
// was passed over, and so is an event at a known time that the importer did not heed; what is due is then done at once.
bool Instance::completed_integrator_step() {
  const Real t = model_exchange_->standing().time;
  const auto& [tolerance, start, stop] = experiment_;
  if (stop && t > *stop + time_tolerance(t, *stop - start)) {
    throw Error("the step ends at " + text_of(t) + ", after the stop time " + text_of(*stop));
  }
  const std::span<const Real> indicators = event_indicators();
  model_exchange_->accept_step();
  return model_exchange_->is_event_due() ||
         std::any_of(indicators.begin(), indicators.end(), [](Real indicator) { return indicator > 0.0; });
}

void Instance::set_time(Real t) {
  if (!std::isfinite(t)) throw Error("the time was set to " + text_of(t) + ", expected a finite number");
  model_exchange_->set_time(t);
}

void Instance::set_continuous_states(std::span<const Real> state) {
  require_length(state.size(), "continuous states", initial_state_.size());
  for (std::size_t k = 0; k < state.size(); ++k) {
    if (std::isfinite(state[k])) continue;
    throw Error(model_.variables.name(model_.variables.states()[k]) + " was set to " + text_of(state[k]) +
                ", expected a finite number");
  }
  model_exchange_->set_state(state);
}

void Instance::get_continuous_states(std::span<Real> state) {
  require_length(state.size(), "continuous states", initial_state_.size());
  act();
  std::copy_n(standing().state, state.size(), state.begin());
}

void Instance::get_derivatives(std::span<Real> rate) {
  require_length(rate.size(), "derivatives", initial_state_.size());
  act();
  evaluation_.prepare_signals(standing());
  for (std::size_t k = 0; k < rate.size(); ++k) {
    if (std::isfinite(evaluation_.rate()[k])) continue;
    throw NotComputable("the derivative of " + model_.variables.name(model_.variables.states()[k]) + " is not finite");
  }
  std::copy(evaluation_.rate().begin(), evaluation_.rate().end(), rate.begin());
}

std::span<const Real> Instance::event_indicators() {
  act();
  scratch_.resize(at(LocatedConditions::located(model_.game.parameters)));
  evaluation_.event_indicators(standing(), tolerances().relative, scratch_.data());
  if (!std::all_of(scratch_.begin(), scratch_.end(), [](Real value) { return std::isfinite(value); })) {
    throw NotComputable("an event indicator is not finite");
  }
  return scratch_;
}

void Instance::get_event_indicators(std::span<Real> values) {
  require_length(values.size(), "event indicators", at(LocatedConditions::located(model_.game.parameters)));
  std::ranges::copy(event_indicators(), values.begin());
}

void Instance::get_nominals(std::span<Real> nominals) const {
  require_length(nominals.size(), "nominal values", initial_state_.size());
  for (std::size_t k = 0; k < nominals.size(); ++k) {
    nominals[k] = model_.variables.family(model_.variables.states()[k]).nominal;
  }
}

Snapshot Instance::save() {
  if (failed_) throw Error("there is no state to save after a failed integration");
  Snapshot snapshot;
  snapshot.interface = interface_;
  snapshot.phase = phase_;
  snapshot.experiment = experiment_;
  snapshot.settings = model_.variables.save(settings_);
  if (co_simulation_) snapshot.co_simulation = co_simulation_->save();
  if (model_exchange_) snapshot.model_exchange = model_exchange_->save();
  return snapshot;
}

SnapshotShape Instance::snapshot_shape() const {
  return {.interface = interface_,
          .settings = model_.variables.saved_size(),
          .states = initial_state_.size(),
          .inputs = at(evaluation_.loop().inputs().size()),
          .parameters = &model_.game.parameters,
          .steps = Integrator::most_steps_between_restarts(static_cast<int>(initial_state_.size()))};
}

Snapshot Instance::read(std::span<const char> bytes) const {
  Snapshot snapshot = from_bytes(bytes, model_.guid, snapshot_shape());
  require_valid(snapshot.experiment);
  model_.variables.require_settable(snapshot.settings);
  if (snapshot.co_simulation) model_.variables.require_settable(snapshot.co_simulation->acting);
  return snapshot;
}

bool Instance::restore(const Snapshot& snapshot) {
  // what may fail and be refused comes before any change
  Settings settings(model_.game);
  model_.variables.load(snapshot.settings, settings);
  std::optional<ModelExchange::Point> point = snapshot.model_exchange;
  std::unique_ptr<CoSimulation> fresh_run;
  std::optional<Settings> acting;
  if (snapshot.co_simulation) {
    acting.emplace(model_.game);
    model_.variables.load(snapshot.co_simulation->acting, *acting);
    if (!co_simulation_) fresh_run = std::make_unique<CoSimulation>(evaluation_);
  }

  settings_ = std::move(settings);
  experiment_ = snapshot.experiment;
  evaluation_.set_time_origin(experiment_.start_time);
  touched_ = Change::parameters;
  failed_ = false;
  evaluation_.moved();
  evaluation_.costs_changed();
  model_exchange_.reset();
  if (point) {
    evaluation_.act(settings_);
    model_exchange_.emplace(evaluation_, std::move(*point), experiment_.start_time);
  }
  if (!snapshot.co_simulation) {
    co_simulation_.reset();
    phase_ = snapshot.phase;
    return true;
  }
  if (fresh_run) co_simulation_ = std::move(fresh_run);
  try {
    evaluation_.act(*acting);
    const bool repeated = co_simulation_->restore(*snapshot.co_simulation, tolerances());
    phase_ = snapshot.phase;
    return repeated;
  } catch (...) {
    phase_ = Phase::error;
    failed_ = true;
    throw;
  }
}

}  // namespace mixed_order_game
