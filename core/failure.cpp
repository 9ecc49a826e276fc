#include "failure.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <tuple>

namespace mixed_order_game {

namespace {

constexpr Real too_large = 1e150;  // its square can still be added up
constexpr Real out_of_proportion = 1e6;

std::string indexed(std::string name, std::initializer_list<int> indices) {  // from zero
  char before = '[';
  for (const int index : indices) {
    name += before + std::to_string(index + 1);
    before = ',';
  }
  return name + ']';
}

}  // namespace

std::string number_text(Real value, int digits) {
  char text[40];
  return {text, std::to_chars(text, text + sizeof text, value, std::chars_format::general, digits).ptr};
}

std::string state_name(const ClosedLoop& loop, int k) {
  const Shape& shape = loop.shape();
  const StateLayout& layout = loop.layout();
  const int row = k / shape.actions();
  const int p = k % shape.actions();
  const int i = shape.player_of(p);
  const int l = shape.coordinate_of(p);
  if (k < layout.reference()) return indexed("x", {i, l});
  if (k < layout.estimates()) return indexed(shape.is_second_order(i) ? "v" : "z", {i, l});
  if (k < layout.weights()) return indexed("y", {row - 2, i, l});
  return indexed("W", {i, row - 2 - shape.players, l});
}

std::string unbounded_growth(const ClosedLoop& loop, const Real* state) {
  const Shape& shape = loop.shape();
  const int size = loop.layout().weights();  // the weights are bounded
  AlignedVector initial(at(loop.layout().size()));
  loop.initial_state(initial.data());
  const auto larger = [](Real a, Real b) { return std::isnan(b) || std::fabs(a) < std::fabs(b); };
  const int k = static_cast<int>(std::max_element(state, state + size, larger) - state);
  const Real largest_at_start = std::fabs(*std::max_element(initial.begin(), initial.begin() + size, larger));
  if (std::fabs(state[k]) <= out_of_proportion * std::max(1.0, largest_at_start)) return {};
  const int estimate = k - loop.layout().estimates();
  const int player = estimate < 0 ? shape.player_of(k % shape.actions()) : estimate / shape.actions();
  return "player " + std::to_string(player + 1) + " grows without bound: " + state_name(loop, k) + " has reached " +
         number_text(state[k]);
}

std::string unusable_rate(const ClosedLoop& loop, const Real* d_ext, const Signals& signals, const Real* rate) {
  const Shape& shape = loop.shape();
  const auto usable = [](Real value) { return std::fabs(value) < too_large; };
  for (int p = 0; p < shape.actions(); ++p) {
    if (!usable(d_ext[p])) {
      return "the input " + indexed("d_ext", {shape.player_of(p), shape.coordinate_of(p)}) + " is " +
             number_text(d_ext[p]);
    }
  }
  const bool perturbed = loop.parameters().strategy.perturbed;
  for (const auto& [name, signal, acts] : {std::tuple{"gradient of the cost", &signals.gradient, true},
                                           {"unknown dynamics", &signals.dynamics, perturbed},
                                           {"disturbance", &signals.disturbance, true}}) {
    for (int p = 0; p < shape.actions() && acts; ++p) {
      const Real value = (*signal)[at(p)];
      if (usable(value)) continue;
      return std::string("the ") + name + " of player " + std::to_string(shape.player_of(p) + 1) + " is " +
             number_text(value);
    }
  }
  const Real* end = rate + loop.layout().size();
  const Real* found = std::find_if_not(rate, end, usable);
  if (found == end) return {};
  return "the rate of " + state_name(loop, static_cast<int>(found - rate)) + " is " + number_text(*found);
}

}  // namespace mixed_order_game
