#include "evaluation.hpp"

#include <cstring>

#include "equilibrium.hpp"

namespace mixed_order_game {

Evaluation::Evaluation(const Game& game)
    : loop_(game.parameters),
      input_(game.parameters.shape.actions()),
      signals_(loop_.shape()),
      rate_(at(loop_.layout().size())),
      d_ext_(at(loop_.shape().actions())),
      d_ext_as_set_(at(loop_.shape().actions())) {}

void Evaluation::act(const Settings& settings) {
  loop_.parameters() = settings.parameters;
  loop_.refresh();
  moved();
  act(settings.input);
}

void Evaluation::set_time_origin(Real time_origin) {
  if (time_origin == loop_.time_origin()) return;
  loop_.set_time_origin(time_origin);
  moved();
}

// Importers set their inputs at every evaluation, changed or not.
void Evaluation::act(const ExternalDisturbance& input) {
  if (std::memcmp(input.numbers().data(), input_.numbers().data(), input.numbers().size_bytes()) == 0) return;
  input_ = input;
  moved();
}

void Evaluation::prepare(Stage stage, Settings& settings, const Standing& standing) {
  switch (stage) {
    case Stage::settings:
    case Stage::state:
    case Stage::statistics:
      break;
    case Stage::input:
      settings.input.values(standing.since_origin, d_ext_as_set_.data());
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
  input_.values(standing.since_origin, d_ext_.data());
  loop_.evaluate(standing.since_origin, standing.state, d_ext_.data(), *standing.modes, signals_, rate_.data());
  signals_valid_ = true;
}

// Of the signals it writes those of seeking only, which prepare_signals finds for the same state.
void Evaluation::event_indicators(const Standing& standing, Real tolerance, Real* values) {
  loop_.event_functions(standing.state, *standing.modes, tolerance, signals_, values);
}

void Evaluation::prepare_equilibrium(Settings& settings) {
  if (equilibrium_valid_) return;
  settings.parameters.refresh();
  x_star_ = nash_equilibrium(*settings.parameters.cost, settings.parameters.shape, settings.parameters.guess);
  equilibrium_valid_ = true;
}

View Evaluation::view(const Settings& settings, const Standing& standing) const {
  View view;
  view.settings = &settings;
  view.loop = &loop_;
  view.time = standing.time;
  view.d_ext = d_ext_as_set_.data();
  view.state = standing.state;
  view.rate = rate_.data();
  view.signals = &signals_;
  view.x_star = equilibrium_valid_ ? x_star_.data() : nullptr;
  return view;
}

}  // namespace mixed_order_game
