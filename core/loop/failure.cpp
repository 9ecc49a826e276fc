#include "loop/failure.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <tuple>

namespace mixed_order_game {

namespace {

constexpr Real too_large = 1e150;  // its square can still be added up
constexpr Real out_of_proportion = 1e6;

std::string indexed(std::string name, const std::vector<int>& indices) {  // from zero
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

namespace {

struct Named {
  const char* name;
  std::vector<int> index;  // from zero, a player's first
};

Named state_entry(const ClosedLoop& loop, int k) {
  const Shape& shape = loop.shape();
  const StateLayout& layout = loop.layout();
  const int own = shape.own_entries();
  for (int p = 0; p < own && k < layout.estimates(); ++p) {
    const int i = shape.player_of_own(p);
    const int l = p / shape.hosts();
    if (k == layout.x_of(p)) return {"x", {i, l}};
    if (k == layout.reference_of(p)) return {shape.is_second_order(i) ? "v" : "z", {i, l}};
  }
  if (k < layout.weights()) {
    const int h = (k - layout.estimates()) / shape.actions();
    const int entry = (k - layout.estimates()) % shape.actions();
    return {"y", {shape.host(h), shape.player_of(entry), shape.coordinate_of(entry)}};
  }
  const int m = (k - layout.weights()) / own;
  const int p = (k - layout.weights()) % own;
  return {"W", {shape.player_of_own(p), m, p / shape.hosts()}};
}

}  // namespace

std::string state_name(const ClosedLoop& loop, int k) {
  const auto [name, index] = state_entry(loop, k);
  return indexed(name, index);
}

std::string input_name(const ClosedLoop& loop, int k) {
  const Shape& shape = loop.shape();
  const InputLayout& inputs = loop.inputs();
  const auto of_entry = [&](const char* name, int entry) {
    return indexed(name, {shape.player_of(entry), shape.coordinate_of(entry)});
  };
  if (k < inputs.x()) return of_entry("d_ext", shape.entry_of_own(k));
  if (k < inputs.v()) return of_entry("x", inputs.actions()[at(k - inputs.x())]);
  if (k < inputs.y_of(0)) return of_entry("v", inputs.velocities()[at(k - inputs.v())]);
  if (k < inputs.xbar_of(0)) {
    const int entry = (k - inputs.y_of(0)) % shape.actions();
    const int j = inputs.heard()[at((k - inputs.y_of(0)) / shape.actions())];
    return indexed("y", {j, shape.player_of(entry), shape.coordinate_of(entry)});
  }
  const int from_xbar = k - inputs.xbar_of(0);
  return indexed("xbar", {inputs.heard()[at(from_xbar / shape.dimension)], from_xbar % shape.dimension});
}

std::string unbounded_growth(const ClosedLoop& loop, const Real* state, const Real* inputs) {
  const int size = loop.layout().weights();  // the weights are bounded
  AlignedVector initial(at(loop.layout().size()));
  loop.initial_state(initial.data());
  const auto larger = [](Real a, Real b) { return std::isnan(b) || std::fabs(a) < std::fabs(b); };
  const Real largest_at_start = std::fabs(*std::max_element(initial.begin(), initial.begin() + size, larger));
  const auto is_out_of_proportion = [&](Real value) {
    return !(std::fabs(value) <= out_of_proportion * std::max(1.0, largest_at_start));
  };
  const Real* const grown = std::max_element(state, state + size, larger);
  const Real* const told = std::max_element(inputs, inputs + loop.inputs().size(), larger);
  if (is_out_of_proportion(*told) && !larger(*told, *grown)) {
    return "the input " + input_name(loop, static_cast<int>(told - inputs)) + " is " + number_text(*told);
  }
  if (!is_out_of_proportion(*grown)) return {};
  const auto [name, index] = state_entry(loop, static_cast<int>(grown - state));
  return "player " + std::to_string(index[0] + 1) + " grows without bound: " + indexed(name, index) + " has reached " +
         number_text(*grown);
}

std::string unusable_rate(const ClosedLoop& loop, const Real* inputs, const Signals& signals, const Real* rate) {
  const Shape& shape = loop.shape();
  const auto usable = [](Real value) { return std::fabs(value) < too_large; };
  for (int k = 0; k < loop.inputs().size(); ++k) {
    if (!usable(inputs[k])) return "the input " + input_name(loop, k) + " is " + number_text(inputs[k]);
  }
  const bool perturbed = loop.parameters().strategy.perturbed;
  for (const auto& [name, signal, acts] : {std::tuple{"gradient of the cost", &signals.gradient, true},
                                           {"unknown dynamics", &signals.dynamics, perturbed},
                                           {"disturbance", &signals.disturbance, true}}) {
    for (int p = 0; p < shape.own_entries() && acts; ++p) {
      const Real value = (*signal)[at(p)];
      if (usable(value)) continue;
      return std::string("the ") + name + " of player " + std::to_string(shape.player_of_own(p) + 1) + " is " +
             number_text(value);
    }
  }
  const Real* end = rate + loop.layout().size();
  const Real* found = std::find_if_not(rate, end, usable);
  if (found == end) return {};
  return "the rate of " + state_name(loop, static_cast<int>(found - rate)) + " is " + number_text(*found);
}

std::string unusable_start(const ClosedLoop& loop, const Real* inputs, const Signals& signals, const Real* rate) {
  const Shape& shape = loop.shape();
  for (int p = 0; p < shape.own_entries(); ++p) {
    const Real value = signals.gradient[at(p)];
    if (std::isfinite(value)) continue;
    const std::string player = std::to_string(shape.player_of_own(p) + 1);
    return "the gradient of the cost of player " + player + " is " + number_text(value) +
           " at its first estimates, expected y0[" + player +
           ",j,l] at which the cost is defined, and z0, which estimates of players of order 1 follow (both are 0 "
           "where" +
           " the game file does not give them)";
  }
  return unusable_rate(loop, inputs, signals, rate);
}

}  // namespace mixed_order_game
