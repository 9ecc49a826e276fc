#include "directional_derivative.hpp"

#include <algorithm>

#include "equilibrium.hpp"

namespace mixed_order_game {

DirectionalDerivative::DirectionalDerivative(const Model& model, const ClosedLoop& loop)
    : model_(&model),
      loop_(&loop),
      tangent_(loop),
      d_ext_(at(loop.shape().actions())),
      x_star_(at(loop.shape().actions())) {}

Tangent DirectionalDerivative::along(const Changes& changes, Equations equations, const View& view,
                                     const LoopJacobian& jacobian) {
  if (equations == Equations::initial) {
    follow_parameters(changes, view, jacobian);
  } else {
    follow_states(changes, jacobian);
  }
  std::fill(d_ext_.begin(), d_ext_.end(), 0.0);
  for (std::size_t k = 0; k < changes.references.size(); ++k) {
    const auto reference = static_cast<int>(changes.references[k]);
    const Causality causality = model_->variables.family(reference).causality;
    if (causality == Causality::input) d_ext_[at(model_->variables.variable(reference).slot)] += changes.values[k];
    if (causality == Causality::independent) tangent_.add_time(view.time, changes.values[k]);
  }
  tangent_.add_input(d_ext_.data());
  return tangent();
}

void DirectionalDerivative::follow_states(const Changes& changes, const LoopJacobian& jacobian) {
  std::fill(tangent_.state.begin(), tangent_.state.end(), 0.0);
  for (std::size_t k = 0; k < changes.references.size(); ++k) {
    const auto reference = static_cast<int>(changes.references[k]);
    const int state = model_->variables.family(reference).state;
    if (state >= 0) tangent_.state[at(state + model_->variables.variable(reference).slot)] += changes.values[k];
  }
  tangent_.follow_state(jacobian);
  std::fill(x_star_.begin(), x_star_.end(), 0.0);
}

// A direction in the space of parameters has the form of the parameters: the table writes it as it writes them.
void DirectionalDerivative::follow_parameters(const Changes& changes, const View& view, const LoopJacobian& jacobian) {
  Settings direction(model_->game);
  direction.parameters = loop_->parameters().zero_direction();
  View written;
  written.settings = &direction;
  for (std::size_t k = 0; k < changes.references.size(); ++k) {
    const auto reference = static_cast<int>(changes.references[k]);
    const Family& family = model_->variables.family(reference);
    if (family.causality != Causality::parameter) continue;
    const Real before = model_->variables.read(reference, written);
    family.write(direction, model_->variables.variable(reference).slot, before + changes.values[k]);
  }
  direction.parameters.refresh();
  tangent_.follow_parameters(jacobian, direction.parameters, view.time, view.state, *view.signals);
  if (view.x_star != nullptr) {
    x_star_ =
        nash_equilibrium_along(*loop_->parameters().cost, *direction.parameters.cost, loop_->shape(), view.x_star);
  }
}

Tangent DirectionalDerivative::along_run(const View& view, const LoopJacobian& jacobian) {
  std::copy_n(view.rate, tangent_.state.size(), tangent_.state.begin());
  tangent_.follow_state(jacobian);
  std::fill(x_star_.begin(), x_star_.end(), 0.0);
  return tangent();
}

Tangent DirectionalDerivative::tangent() const {
  return {.state = tangent_.state.data(),
          .rate = tangent_.rate.data(),
          .control = tangent_.control.data(),
          .x_star = x_star_.data()};
}

}  // namespace mixed_order_game
