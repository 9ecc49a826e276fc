// Reads the parts of a game file that expressions are made of: named parameters and texts.
#pragma once

#include <memory>
#include <optional>

#include "definition/toml_reader.hpp"
#include "expression/player_expressions.hpp"
#include "expression/unroll.hpp"
#include "families/expression_cost.hpp"

namespace mixed_order_game {

/// The table [parameters]; none when it is absent.
NamedParameters read_named_parameters(const TomlEntry& table);

/// Reads the expressions of one game. Errors name the entry, line and column, what stands there and what was expected.
class ExpressionReader {
 public:
  /// All must outlive it.
  ExpressionReader(std::string_view document, const Shape& shape, const NamedParameters& parameters)
      : document_(document), shape_(shape), parameters_(parameters) {}

  /// The cost of player i, when its table has an expression.
  [[nodiscard]] ExpressionCost::Text cost(const TomlEntry& entry, int i) const;
  /// One value for each coordinate of player i: one text in which l is the coordinate, or a list of texts. Graphs
  /// have the switches; texts are at own entries.
  void add_coordinates(const TomlEntry& entry, Purpose purpose, int i, PlayerExpressions& values,
                       std::vector<Switching::OfPlayer>& graphs, std::vector<ExpressionCost::Text>& texts) const;

 private:
  struct Unrolled {
    std::shared_ptr<ExpressionGraph> graph;
    int node;
  };
  void unroll_into(const TomlEntry& entry, const Place& place, ExpressionGraph& graph, int& node) const;

  std::string_view document_;
  const Shape& shape_;
  const NamedParameters& parameters_;
  mutable int cost_switches_ = 0;  // of the players before
};

}  // namespace mixed_order_game
