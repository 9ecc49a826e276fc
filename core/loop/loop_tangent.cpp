#include "loop/loop_tangent.hpp"

#include <algorithm>

namespace mixed_order_game {

LoopTangent::LoopTangent(const ClosedLoop& loop)
    : state(at(loop.layout().size())),
      d_ext(at(loop.shape().actions())),
      control(d_ext.size()),
      rate(state.size()),
      loop_(&loop),
      equations_(loop.parameters()),
      state_(state.size()),
      d_ext_(d_ext.size()),
      rate_(state.size()) {
  for (const auto member : GainsAs<Dual>::members()) (numbers_.gains.*member).resize(at(loop.shape().players));
  numbers_.width.resize(at(loop.shape().players));
  numbers_.W_max.resize(at(loop.shape().players));
  numbers_.centers.resize(loop.parameters().rbf.centers.size());
  const NeighbourRows neighbours = loop.parameters().graph.neighbours();
  for (int i = 0; i < loop.shape().players; ++i) {
    numbers_.edges.emplace_back().reserve(at(neighbours.start[i + 1] - neighbours.start[i]));
  }
}

void LoopTangent::clear() {
  std::fill(state.begin(), state.end(), 0.0);
  std::fill(d_ext.begin(), d_ext.end(), 0.0);
  time = 0.0;
}

void LoopTangent::follow(Real t, const Real* at_state, const Modes& modes) { evaluate(nullptr, t, at_state, modes); }

void LoopTangent::follow_parameters(const Parameters& direction, Real t, const Real* at_state, const Modes& modes) {
  loop_->initial_state(direction.initial, state.data());
  evaluate(&direction, t, at_state, modes);
}

void LoopTangent::evaluate(const Parameters* direction, Real t, const Real* at_state, const Modes& modes) {
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
  numbers_.robust = parameters.strategy.robust ? 1.0 : 0.0;
  numbers_.perturbed = parameters.strategy.perturbed ? 1.0 : 0.0;
  for (int i = 0; i < loop_->shape().players; ++i) {
    auto& row = numbers_.edges[at(i)];
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
  for (std::size_t p = 0; p < d_ext.size(); ++p) d_ext_[p] = {0.0, d_ext[p]};
  equations_.evaluate_control(numbers_, state_.data());
  equations_.evaluate_rates(numbers_, {t, time}, state_.data(), d_ext_.data(), modes, rate_.data());
  for (std::size_t p = 0; p < control.size(); ++p) control[p] = equations_.control[p].along;
  for (std::size_t k = 0; k < rate.size(); ++k) rate[k] = rate_[k].along;
}

}  // namespace mixed_order_game
