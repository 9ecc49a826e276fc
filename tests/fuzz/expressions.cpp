// Any text as an expression: read, unrolled for every player, compiled and evaluated with its derivatives, or refused.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "errors.hpp"
#include "expression/switching.hpp"
#include "expression/unroll.hpp"

using namespace mixed_order_game;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  static const Shape shape{.players = 3, .dimension = 2, .neurons = 1, .order = {1, 2, 2}};
  static const NamedParameters named = [] {
    NamedParameters parameters;
    parameters.declared.push_back({.name = "p"});
    parameters.declared.push_back({.name = "h", .size = {3}, .first = 1});
    parameters.declared.push_back({.name = "R", .fixed = true, .size = {2, 2}, .first = 4});
    parameters.values = {1.5, -2.0, 0.0, 3.0, 0.0, 1.0, 1.0, 0.0};
    return parameters;
  }();
  static const std::vector<Real> point{0.5, -1.0, 0.0, 2.0, 1e3, -0.25};
  const std::string_view text(reinterpret_cast<const char*>(bytes), size);
  for (const Purpose purpose : {Purpose::cost, Purpose::dynamics, Purpose::disturbance}) {
    try {
      const Syntax syntax = parse_expression(text);
      std::vector<Switching::OfPlayer> graphs;
      int switches = 0;
      PlayerExpressions expressions(shape.actions(), shape.players, shape.actions(), 8);
      for (int i = 0; i < shape.players; ++i) {
        const auto graph = std::make_shared<ExpressionGraph>(20'000, switches);
        for (int l = 0; l < shape.dimension; ++l) {
          const Place place{.shape = &shape, .parameters = &named, .purpose = purpose, .player = i, .coordinate = l};
          expressions.add(shape.entry(i, l), i, graph, unroll(syntax, place, *graph));
        }
        switches += static_cast<int>(graph->switches().size());
        graphs.push_back({i, i, graph});
      }
      expressions.compile();
      const Switching switching(graphs, "text", shape.players, shape.actions(), 8);
      LeafValues leaves{.points = point.data(),
                        .stride = 0,
                        .velocities = point.data(),
                        .time = 0.5,
                        .parameters = named.values.data()};
      std::vector<Real> held(at(switching.count()));
      switching.own_values(leaves, 0.0, 0.5, held.data());
      leaves.held = held.data();
      std::vector<Real> ends(at(switching.located()));
      switching.event_functions(leaves, ends.data());
      if (!(switching.next_event(leaves, 0.0, 0.5) > 0.5)) std::abort();
      for (int k = 0; k < switching.count(); ++k) {
        if (!switching.can_hold(k, held[at(k)])) std::abort();
      }
      std::vector<Real> values(point.size());
      expressions.values(leaves, values.data());
      for (const LeafKind kind : {LeafKind::action, LeafKind::velocity, LeafKind::time, LeafKind::parameter}) {
        std::vector<Real> entries(at(expressions.pattern(kind).entries()));
        expressions.derivatives(kind, leaves, entries.data());
      }
    } catch (const ExpressionError&) {
    } catch (const Error&) {
    }
  }
  return 0;
}
