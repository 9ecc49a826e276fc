#include "directional_derivative.hpp"

#include <algorithm>

#include "equilibrium/equilibrium.hpp"

namespace mixed_order_game {

DirectionalDerivative::DirectionalDerivative(const Model& model, const ClosedLoop& loop)
    : model_(&model), loop_(&loop), tangent_(loop), x_star_(at(loop.shape().actions())) {}

Tangent DirectionalDerivative::along(const Changes& changes, Equations equations, const View& view,
                                     const Standing& standing) {
  const ModelVariables& variables = model_->variables;
  tangent_.clear();
  std::fill(x_star_.begin(), x_star_.end(), 0.0);
  for (std::size_t k = 0; k < changes.references.size(); ++k) {
    const auto reference = static_cast<int>(changes.references[k]);
    const Family& family = variables.family(reference);
    const int slot = variables.variable(reference).slot;
    if (family.is_state) tangent_.state[at(slot)] += changes.values[k];
    if (family.causality == Causality::input) tangent_.inputs[at(slot)] += changes.values[k];
    if (family.causality == Causality::independent) tangent_.time += changes.values[k];
  }
  if (equations == Equations::running) {
    tangent_.follow(standing.since_origin, standing.state, view.acting_inputs, *standing.modes);
    return tangent();
  }
  const Parameters direction = parameters_along(changes);
  tangent_.follow_parameters(direction, standing.since_origin, standing.state, view.acting_inputs, *standing.modes);
  if (view.x_star != nullptr) {
    x_star_ = nash_equilibrium_along(*loop_->parameters().cost, *direction.cost, loop_->shape(), view.x_star);
  }
  return tangent();
}

// A direction in the space of parameters has the form of the parameters: the table writes it as it writes them.
Parameters DirectionalDerivative::parameters_along(const Changes& changes) const {
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
  return direction.parameters;
}

Tangent DirectionalDerivative::along_run(const View& view, const Standing& standing, const Inputs& inputs) {
  tangent_.clear();
  std::copy_n(view.rate, tangent_.state.size(), tangent_.state.begin());
  inputs.rates(standing.since_origin, tangent_.inputs.data());
  tangent_.follow(standing.since_origin, standing.state, view.acting_inputs, *standing.modes);
  std::fill(x_star_.begin(), x_star_.end(), 0.0);
  return tangent();
}

Tangent DirectionalDerivative::tangent() const {
  return {.state = tangent_.state.data(),
          .rate = tangent_.rate.data(),
          .inputs = tangent_.inputs.data(),
          .control = tangent_.control.data(),
          .actions = tangent_.actions.data(),
          .shared = tangent_.shared.data(),
          .x_star = x_star_.data()};
}

}  // namespace mixed_order_game
