#include "evaluation.hpp"

#include <cstring>

#include "equilibrium/equilibrium.hpp"

namespace mixed_order_game {

Evaluation::Evaluation(const Game& game)
    : loop_(game.parameters),
      conditions_(loop_),
      inputs_(loop_.inputs().size()),
      signals_(loop_.shape()),
      rate_(at(loop_.layout().size())),
      input_values_(at(loop_.inputs().size())),
      input_values_as_set_(input_values_.size()) {}

const Real* Evaluation::inputs_at(const Standing& standing) {
  inputs_.values(standing.since_origin, input_values_.data());
  return input_values_.data();
}

void Evaluation::act(const Settings& settings) {
  loop_.parameters() = settings.parameters;
  loop_.refresh();
  moved();
  act(settings.inputs);
}

void Evaluation::set_time_origin(Real time_origin) {
  if (time_origin == loop_.time_origin()) return;
  loop_.set_time_origin(time_origin);
  moved();
}

// Importers set their inputs at every evaluation, changed or not.
void Evaluation::act(const Inputs& inputs) {
  if (std::memcmp(inputs.numbers().data(), inputs_.numbers().data(), inputs.numbers().size_bytes()) == 0) return;
  inputs_ = inputs;
  moved();
}

void Evaluation::prepare(Stage stage, Settings& settings, const Standing& standing) {
  switch (stage) {
    case Stage::settings:
    case Stage::state:
    case Stage::statistics:
    case Stage::judgement:
      break;
    case Stage::inputs:
      settings.inputs.values(standing.since_origin, input_values_as_set_.data());
      break;
    case Stage::signals:
      prepare_signals(standing);
      break;
    case Stage::equilibrium:
      prepare_equilibrium(settings);
      break;
  }
}

void Evaluation::prepare_signals(const Standing& standing) {
  if (signals_valid_) return;
  loop_.evaluate(standing.since_origin, standing.state, inputs_at(standing), *standing.modes, signals_, rate_.data());
  signals_valid_ = true;
}

// Of the signals it writes those of seeking only, which prepare_signals finds for the same state.
void Evaluation::event_indicators(const Standing& standing, Real tolerance, Real* values) {
  conditions_.event_functions(standing.since_origin, standing.state, inputs_at(standing), *standing.modes, tolerance,
                              signals_, values);
}

void Evaluation::prepare_equilibrium(Settings& settings) {
  if (equilibrium_valid_) return;
  settings.parameters.refresh();
  x_star_ = nash_equilibrium(*settings.parameters.cost, settings.parameters.shape, settings.parameters.guess);
  equilibrium_valid_ = true;
}

View Evaluation::view(const Settings& settings, const Standing& standing) {
  View view;
  view.settings = &settings;
  view.loop = &loop_;
  view.time = standing.time;
  view.inputs = input_values_as_set_.data();
  view.state = standing.state;
  view.acting_inputs = inputs_at(standing);
  view.plants = loop_.plants(standing.state, view.acting_inputs, signals_);
  view.rate = rate_.data();
  view.signals = &signals_;
  view.x_star = equilibrium_valid_ ? x_star_.data() : nullptr;
  return view;
}

}  // namespace mixed_order_game
