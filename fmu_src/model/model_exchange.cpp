#include "model_exchange.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace mixed_order_game {

ModelExchange::ModelExchange(Evaluation& evaluation, Point point, Real start_time)
    : evaluation_(evaluation),
      point_(std::move(point)),
      start_time_(start_time),
      judge_(evaluation.loop()),
      path_([this](Real t) { return between(t); }),
      state_between_(point_.state.size()),
      inputs_between_(at(evaluation.loop().inputs().size())) {
  moved();
  if (point_.accepted_state.empty()) return;
  judge_.resume(point_.judgement);
  const Judge::Place accepted{point_.accepted_state.data(), point_.accepted_inputs.data()};
  judge_.stand(point_.accepted_time - start_time_, accepted, point_.modes);
  Signals signals(evaluation_.loop().shape());
  accepted_rate_.resize(point_.state.size());
  evaluation_.loop().evaluate(point_.accepted_time - evaluation_.loop().time_origin(), accepted.state, accepted.inputs,
                              point_.modes, signals, accepted_rate_.data());
}

ModelExchange::ModelExchange(Evaluation& evaluation, Real start_time, const AlignedVector& state, const Modes& modes,
                             const JudgingRule& rule, std::span<const Real> x_star)
    : ModelExchange(evaluation, {.time = start_time, .state = state, .modes = modes}, start_time) {
  judge_.set_equilibrium(x_star);
  judge_.start(0.0, rule, place(), point_.modes);
  note_accepted();
}

// Importers may set any time, far from the start that they gave, too. The origin follows in long strides: it depends on
// nothing but the time, and what counts from it keeps its digits.
void ModelExchange::moved() {
  constexpr Real stride = 4096.0;  // s
  evaluation_.set_time_origin(start_time_ + stride * std::floor((point_.time - start_time_) / stride));
  evaluation_.moved();
}

Standing ModelExchange::standing() const {
  return {point_.time, point_.time - evaluation_.loop().time_origin(), point_.state.data(), &point_.modes};
}

void ModelExchange::set_time(Real t) {
  if (t == point_.time) return;
  point_.time = t;
  moved();
}

void ModelExchange::set_state(std::span<const Real> state) {
  if (std::memcmp(state.data(), point_.state.data(), state.size_bytes()) == 0) return;
  std::copy(state.begin(), state.end(), point_.state.begin());
  evaluation_.moved();
}

Real ModelExchange::next_event() const {
  return evaluation_.conditions().next_event(standing().since_origin, point_.modes);
}

bool ModelExchange::is_event_due() const {
  return evaluation_.conditions().is_due(standing().since_origin, point_.modes);
}

Judge::Place ModelExchange::place() { return {point_.state.data(), evaluation_.inputs_at(standing())}; }

void ModelExchange::note_accepted() {
  const Judge::Place here = place();
  point_.accepted_time = point_.time;
  point_.accepted_state = point_.state;
  point_.accepted_inputs.assign(here.inputs, here.inputs + inputs_between_.size());
  evaluation_.prepare_signals(standing());
  accepted_rate_ = evaluation_.rate();
}

/// Along Hermite's cubic; inputs are taken as linear.
Judge::Place ModelExchange::between(Real t) {
  const Judge::Place here = place();
  const Real begin = point_.accepted_time - start_time_;
  const Real end = point_.time - start_time_;
  if (t >= end) return here;
  hermite_cubic({begin, point_.accepted_state, accepted_rate_}, {end, point_.state, evaluation_.rate()}, t,
                state_between_);
  const Real s = (t - begin) / (end - begin);
  for (std::size_t k = 0; k < inputs_between_.size(); ++k) {
    inputs_between_[k] = (1.0 - s) * point_.accepted_inputs[k] + s * here.inputs[k];
  }
  return {state_between_.data(), inputs_between_.data()};
}

void ModelExchange::accept_step() {
  if (point_.time > point_.accepted_time) {
    evaluation_.prepare_signals(standing());
    judge_.pass(point_.time - start_time_, path_, point_.modes);
    judge_.forget_past();
  } else {  // the importer went back by itself, or changed the state or inputs where it stands
    judge_.jump(point_.time - start_time_, place(), point_.modes);
  }
  note_accepted();
}

void ModelExchange::begin_after_event(std::span<const Real> x_star) {
  judge_.set_equilibrium(x_star);
  judge_.jump(point_.time - start_time_, place(), point_.modes);
  note_accepted();
}

void ModelExchange::begin_errors_anew(Real from) { judge_.begin_errors_anew(point_.time - start_time_, from, place()); }

ModelExchange::Point ModelExchange::save() const {
  Point point = point_;
  point.judgement = judge_.judgement();
  return point;
}

bool ModelExchange::update_modes(Real tolerance) {
  const ClosedLoop& loop = evaluation_.loop();
  Signals signals(loop.shape());
  Modes modes = point_.modes;
  const Real* inputs = evaluation_.inputs_at(standing());
  point_.events += evaluation_.conditions()
                       .pass(standing().since_origin, point_.state.data(), inputs, tolerance, nullptr, signals, modes)
                       .events;
  AlignedVector state = point_.state;
  loop.project(modes, inputs, signals, state.data());
  const bool moved = state != point_.state;
  if (moved || modes != point_.modes) evaluation_.moved();
  point_.state = std::move(state);
  point_.modes = std::move(modes);
  return moved;
}

}  // namespace mixed_order_game
