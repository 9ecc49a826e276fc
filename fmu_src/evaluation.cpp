#include "evaluation.hpp"

#include "equilibrium.hpp"
#include "loop_jacobian.hpp"

namespace mixed_order_game {

Evaluation::Evaluation(const Game& game)
    : loop_(game.parameters),
      input_(game.parameters.shape.actions()),
      signals_(loop_.shape()),
      rate_(at(loop_.layout().size())),
      control_rate_(at(loop_.shape().actions())),
      d_ext_(at(loop_.shape().actions())),
      d_ext_as_set_(at(loop_.shape().actions())) {}

void Evaluation::act(const Settings& settings) {
  loop_.parameters() = settings.parameters;
  loop_.refresh();
  act(settings.input);
}

void Evaluation::act(const ExternalDisturbance& input) {
  input_ = input;
  moved();
}

void Evaluation::prepare(Stage stage, Settings& settings, const Standing& standing) {
  switch (stage) {
    case Stage::settings:
    case Stage::state:
      break;
    case Stage::input:
      settings.input.values(standing.time, d_ext_as_set_.data());
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
  input_.values(standing.time, d_ext_.data());
  loop_.evaluate(standing.time, standing.state, d_ext_.data(), *standing.modes, signals_, rate_.data());
  signals_valid_ = true;
}

// u depends on the state alone, so that u' = (d u / d state) state'; of the loop's Jacobian, the rows of the driven
// states hold d (u + g) / d state.
void Evaluation::prepare_control_rates(const Standing& standing) {
  prepare_signals(standing);
  if (control_rates_valid_) return;
  const StateLayout& layout = loop_.layout();
  LoopJacobian jacobian(loop_);
  jacobian.linearize(standing.state, signals_, *standing.modes);
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

void Evaluation::prepare_equilibrium(Settings& settings) {
  if (equilibrium_valid_) return;
  settings.parameters.cost->refresh();
  x_star_ = nash_equilibrium(*settings.parameters.cost, settings.parameters.shape);
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
  view.control_rate = control_rate_.data();
  view.x_star = x_star_.data();
  view.statistics = standing.statistics;
  return view;
}

}  // namespace mixed_order_game
