#include "constants.hpp"

#include <cmath>

#include "equilibrium/box_constants.hpp"
#include "errors.hpp"
#include "json_text.hpp"
#include "requested_settings.hpp"

namespace mixed_order_game {

namespace {

std::vector<Interval> box_of(const TomlEntry& entry, const Shape& shape) {
  const std::string expected = "a list of " + std::to_string(shape.actions()) + " pairs of bounds";
  if (entry.length(expected) != at(shape.actions())) entry.fail(expected);
  std::vector<Interval> box(at(shape.actions()));
  for (int i = 0; i < shape.players; ++i) {
    for (int l = 0; l < shape.dimension; ++l) {
      const TomlEntry pair = entry.item(at(i * shape.dimension + l));
      if (pair.length("two bounds") != 2) pair.fail("two bounds");
      Interval& side = box[at(shape.entry(i, l))];
      side = {pair.item(0).number(), pair.item(1).number()};
      if (!(side.lower <= side.upper)) pair.fail("a lower bound and an upper one");
    }
  }
  return box;
}

std::string bound(const BoxBound& one) {
  return "{\"proved\": " + json_number(one.proved) + ", \"sampled\": " + json_number(one.sampled) + "}";
}

/// The lower or upper bounds of the entries, rows and columns by player, then by coordinate.
std::string matrix(const std::vector<Interval>& entries, const Shape& shape, Real Interval::* side) {
  std::vector<int> order;
  for (int i = 0; i < shape.players; ++i) {
    for (int l = 0; l < shape.dimension; ++l) order.push_back(shape.entry(i, l));
  }
  return json_list(order, [&](int row) {
    return json_list(
        order, [&](int column) { return json_number(entries[at(row) * at(shape.actions()) + at(column)].*side); });
  });
}

std::string jacobian(const JacobianBounds& bounds, const Shape& shape) {
  return "{\"lipschitz\": " + json_list(bounds.lipschitz, bound) +
         ",\n  \"lower\": " + matrix(bounds.entries, shape, &Interval::lower) +
         ",\n  \"upper\": " + matrix(bounds.entries, shape, &Interval::upper) + "}";
}

}  // namespace

std::string constants(std::string_view toml, std::string_view request) {
  const Model model(toml);
  const toml::table document = parse_toml(request);
  const TomlEntry asked(document);
  asked.accept_keys({"box", "speed", "settings"});
  const Shape& shape = model.game.parameters.shape;
  if (!shape.hosts_all()) throw GameError("some players are elsewhere, expected a game with all of its players");
  const Parameters parameters = settings_with(asked["settings"], model).parameters;
  GameExpressions expressions;
  parse_game(toml, expressions);
  const Real speed = asked["speed"].number();
  if (!(speed >= 0.0)) asked["speed"].fail("a speed of at least 0");
  const BoxConstants found = box_constants(parameters, expressions, box_of(asked["box"], shape), speed);
  std::vector<Real> gradient(at(shape.actions()));
  parameters.cost->own_gradients(parameters.initial.y.data(), shape.actions(), gradient.data());
  return "{\"monotonicity\": " + bound(found.monotonicity) + ",\n \"gradients\": " + jacobian(found.gradients, shape) +
         ",\n \"dynamics\": " + jacobian(found.dynamics, shape) +
         ",\n \"velocities\": " + jacobian(found.velocities, shape) +
         ",\n \"dynamics_size\": " + json_actions(found.dynamics_size, shape) +
         ",\n \"disturbance_size\": " + json_actions(found.disturbance_size, shape) +
         ",\n \"first_gradients\": " + json_actions(gradient, shape) +
         ",\n \"open\": " + json_list(found.open, json_string) + "}\n";
}

}  // namespace mixed_order_game
