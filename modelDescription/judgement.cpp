#include "judgement.hpp"

#include "equilibrium/equilibrium_verdict.hpp"
#include "errors.hpp"
#include "game/game.hpp"
#include "json_text.hpp"

namespace mixed_order_game {

namespace {

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
  GameExpressions expressions;
  const Game game = parse_game(toml, expressions);
  const Shape& shape = game.parameters.shape;
  if (!shape.hosts_all()) return "null\n";
  const EquilibriumVerdict verdict = judge_equilibrium(game.parameters, expressions.costs);
  using OfPlayer = EquilibriumVerdict::OfPlayer;
  return std::string("{\"kind\": \"") + name_of(verdict.kind) +
         "\",\n \"x_star\": " + json_actions(verdict.x_star, shape) + ",\n \"curvature\": " +
         json_list(verdict.players, [](const OfPlayer& player) { return json_number(player.curvature); }) +
         ",\n \"convex_within\": " +
         json_list(verdict.players, [](const OfPlayer& player) { return json_number(player.convex_within); }) +
         ",\n \"kinks\": " +
         json_list(verdict.players, [](const OfPlayer& player) { return json_string(player.kink); }) +
         ",\n \"monotonicity\": " + json_number(verdict.monotonicity) +
         ",\n \"is_affine\": " + (verdict.is_affine ? "true" : "false") + ",\n \"others\": " +
         json_list(verdict.others, [&](const std::vector<Real>& x) { return json_actions(x, shape); }) +
         ",\n \"undefined_at_start\": " +
         json_list(verdict.undefined_at_start, [](int player) { return std::to_string(player + 1); }) + "}\n";
}

}  // namespace mixed_order_game
