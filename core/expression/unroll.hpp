// From the syntax tree of an expression to its graph for one player: indices become numbers, sums over players become
// additions, and conditions on indices choose.
#pragma once

#include "expression/graph.hpp"
#include "expression/named_parameters.hpp"
#include "expression/syntax.hpp"

namespace mixed_order_game {

/// What an expression is for, which decides what it may depend on.
enum class Purpose { cost, dynamics, disturbance };

struct Place {
  const Shape* shape;
  const NamedParameters* parameters;
  Purpose purpose;
  int player;      ///< i, from zero
  int coordinate;  ///< l, from zero; -1 where there is none
};

/// The node of the expression; the graph has its switches. Throws ExpressionError that names what has no meaning there.
int unroll(const Syntax& syntax, const Place& place, ExpressionGraph& graph);

/// Whether a name is taken by the language, so that no parameter can have it.
bool is_reserved_name(std::string_view name);

}  // namespace mixed_order_game
