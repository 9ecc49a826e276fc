#include "loop/loop_tangent.hpp"

#include <algorithm>

namespace mixed_order_game {

LoopTangent::LoopTangent(const ClosedLoop& loop)
    : state(at(loop.layout().size())),
      inputs(at(loop.inputs().size())),
      control(at(loop.shape().own_entries())),
      rate(state.size()),
      actions(at(loop.shape().actions())),
      shared(actions.size()),
      loop_(&loop),
      equations_(loop.parameters()),
      state_(state.size()),
      inputs_(inputs.size()),
      rate_(state.size()) {
  for (const auto member : GainsAs<Dual>::members()) (numbers_.gains.*member).resize(at(loop.shape().players));
  numbers_.width.resize(at(loop.shape().players));
  numbers_.W_max.resize(at(loop.shape().players));
  numbers_.centers.resize(loop.parameters().rbf.centers.size());
  numbers_.u_max.resize(loop.parameters().u_max.size());
  const NeighbourRows neighbours = loop.parameters().graph.neighbours();
  for (int h = 0; h < loop.shape().hosts(); ++h) {
    numbers_.edges.emplace_back().reserve(at(neighbours.start[h + 1] - neighbours.start[h]));
  }
}

void LoopTangent::clear() {
  std::fill(state.begin(), state.end(), 0.0);
  std::fill(inputs.begin(), inputs.end(), 0.0);
  time = 0.0;
}

void LoopTangent::follow(Real t, const Real* at_state, const Real* at_inputs, const Modes& modes) {
  evaluate(nullptr, t, at_state, at_inputs, modes);
}

void LoopTangent::follow(const Parameters& direction, Real t, const Real* at_state, const Real* at_inputs,
                         const Modes& modes) {
  evaluate(&direction, t, at_state, at_inputs, modes);
}

void LoopTangent::follow_parameters(const Parameters& direction, Real t, const Real* at_state, const Real* at_inputs,
                                    const Modes& modes) {
  loop_->initial_state(direction.initial, state.data());
  evaluate(&direction, t, at_state, at_inputs, modes);
}

void LoopTangent::evaluate(const Parameters* direction, Real t, const Real* at_state, const Real* at_inputs,
                           const Modes& modes) {
  const Parameters& parameters = loop_->parameters();
  const auto set = [&](std::vector<Dual>& numbers, auto part, auto member) {
    const std::vector<Real>& values = (parameters.*part).*member;
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      numbers[k] = {values[k], direction == nullptr ? 0.0 : ((direction->*part).*member)[k]};
    }
  };
  for (std::size_t k = 0; k < declared_gains.size(); ++k) {
    set(numbers_.gains.*GainsAs<Dual>::members()[k], &Parameters::gains, Gains::members()[k]);
  }
  set(numbers_.width, &Parameters::rbf, &RbfNetwork::width);
  set(numbers_.W_max, &Parameters::rbf, &RbfNetwork::W_max);
  set(numbers_.centers, &Parameters::rbf, &RbfNetwork::centers);
  for (std::size_t k = 0; k < numbers_.u_max.size(); ++k) {
    numbers_.u_max[k] = {parameters.u_max[k], direction == nullptr ? 0.0 : direction->u_max[k]};
  }
  numbers_.robust = parameters.strategy.robust ? 1.0 : 0.0;
  numbers_.perturbed = parameters.strategy.perturbed ? 1.0 : 0.0;
  for (int h = 0; h < loop_->shape().hosts(); ++h) {
    const int i = loop_->shape().host(h);
    auto& row = numbers_.edges[at(h)];
    row.clear();
    for (int k = 0; k < loop_->shape().players; ++k) {
      const Dual weight(parameters.graph.weight(i, k), direction == nullptr ? 0.0 : direction->graph.weight(i, k));
      if (weight.value != 0.0 || weight.along != 0.0) row.push_back({k, weight});
    }
  }
  const auto family = [&](auto member) {
    return CoefficientsAlong((parameters.*member)->coefficients,
                             direction == nullptr ? nullptr : &(direction->*member)->coefficients);
  };
  const CoefficientsAlong cost = family(&Parameters::cost);
  const CoefficientsAlong dynamics = family(&Parameters::dynamics);
  const CoefficientsAlong disturbance = family(&Parameters::disturbance);
  numbers_.cost = &cost;
  numbers_.dynamics = &dynamics;
  numbers_.disturbance = &disturbance;

  for (std::size_t k = 0; k < state.size(); ++k) state_[k] = {at_state[k], state[k]};
  for (std::size_t k = 0; k < inputs.size(); ++k) inputs_[k] = {at_inputs[k], inputs[k]};
  equations_.evaluate_control(numbers_, state_.data(), inputs_.data(), modes);
  equations_.evaluate_rates(numbers_, {t, time}, state_.data(), inputs_.data(), modes, rate_.data());
  for (std::size_t p = 0; p < control.size(); ++p) control[p] = equations_.control[p].along;
  for (std::size_t k = 0; k < rate.size(); ++k) rate[k] = rate_[k].along;
  for (std::size_t k = 0; k < actions.size(); ++k) actions[k] = equations_.x[k].along;
  for (std::size_t k = 0; k < shared.size(); ++k) shared[k] = equations_.shared[k].along;
}

}  // namespace mixed_order_game
