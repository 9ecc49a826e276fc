#include "judgement.hpp"

#include <cmath>

#include "equilibrium_verdict.hpp"
#include "errors.hpp"
#include "game.hpp"
#include "number_text.hpp"

namespace mixed_order_game {

namespace {

template <typename Range, typename Text>
std::string list_of(const Range& range, Text text) {
  std::string list;
  for (const auto& one : range) list += (list.empty() ? "[" : ", ") + text(one);
  return list.empty() ? "[]" : list + "]";
}

std::string number(Real value) { return std::isfinite(value) ? text_of(value) : "null"; }

/// One list for each player, of its coordinates.
std::string actions(const std::vector<Real>& x, const Shape& shape) {
  std::vector<std::vector<Real>> rows(at(shape.players));
  for (int i = 0; i < shape.players; ++i) {
    for (int l = 0; l < shape.dimension; ++l) rows[at(i)].push_back(x[at(shape.entry(i, l))]);
  }
  return list_of(rows, [](const auto& row) { return list_of(row, number); });
}

const char* name_of(EquilibriumVerdict::Kind kind) {
  switch (kind) {
    case EquilibriumVerdict::Kind::nash:
      return "Nash equilibrium";
    case EquilibriumVerdict::Kind::local_nash:
      return "local Nash equilibrium";
    case EquilibriumVerdict::Kind::open:
      break;
  }
  return "second-order condition open";
}

}  // namespace

std::string judgement(std::string_view toml) {
  std::vector<ExpressionCost::Text> cost_expressions;
  const Game game = parse_game(toml, cost_expressions);
  const Shape& shape = game.parameters.shape;
  if (!shape.hosts_all()) return "null\n";
  const EquilibriumVerdict verdict = judge_equilibrium(game.parameters, cost_expressions);
  using OfPlayer = EquilibriumVerdict::OfPlayer;
  return std::string("{\"kind\": \"") + name_of(verdict.kind) + "\",\n \"x_star\": " + actions(verdict.x_star, shape) +
         ",\n \"curvature\": " +
         list_of(verdict.players, [](const OfPlayer& player) { return number(player.curvature); }) +
         ",\n \"convex_within\": " +
         list_of(verdict.players, [](const OfPlayer& player) { return number(player.convex_within); }) +
         ",\n \"monotonicity\": " + number(verdict.monotonicity) +
         ",\n \"is_affine\": " + (verdict.is_affine ? "true" : "false") +
         ",\n \"others\": " + list_of(verdict.others, [&](const std::vector<Real>& x) { return actions(x, shape); }) +
         ",\n \"undefined_at_start\": " +
         list_of(verdict.undefined_at_start, [](int player) { return std::to_string(player + 1); }) + "}\n";
}

}  // namespace mixed_order_game
