#include "model_exchange.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace mixed_order_game {

ModelExchange::ModelExchange(Evaluation& evaluation, Point start, Real start_time)
    : evaluation_(evaluation), point_(std::move(start)), start_time_(start_time) {
  moved();
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
