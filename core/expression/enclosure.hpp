// Enclosures of an expression's values over a box of what its leaves stand for.
#pragma once

#include <functional>
#include <vector>

#include "expression/graph.hpp"
#include "expression/interval.hpp"

namespace mixed_order_game {

class Enclosure {
 public:
  /// Of some nodes of a graph, which has to outlive it.
  Enclosure(const ExpressionGraph& graph, std::vector<int> nodes);

  /// The leaves that the nodes are made of, once each.
  [[nodiscard]] std::vector<Leaf> leaves() const;

  enum class Definition {
    everywhere,
    convex,  ///< the points of the box at which the expressions are defined are a convex set
    unknown,
    nowhere,
  };
  struct Found {
    Definition definition = Definition::everywhere;
    const Switch* kink = nullptr;  ///< one that may switch in the box, so that values there tell less
  };
  /// Encloses the values at all points of the box at which the expressions are defined, in the order of the nodes.
  /// Switches hold what their own conditions say at each point; where one is not decided, all that it can hold.
  /// Branches that no point of the box takes need not be defined.
  Found evaluate(const std::function<Interval(const Leaf&)>& box, std::vector<Interval>& values) const;
  /// The same for actions in a box and parameters at their values; any other leaf may be anything.
  Found evaluate(const std::vector<Interval>& actions, const std::vector<Real>& parameters,
                 std::vector<Interval>& values) const;

 private:
  struct Node {
    Interval value;
    unsigned char form = 0;
    Found found = {};
  };
  [[nodiscard]] Node of_switch(const Switch& one) const;
  [[nodiscard]] Node of_branch(const GraphNode& node) const;

  const ExpressionGraph& graph_;
  std::vector<int> nodes_;
  std::vector<int> needed_;    // ascending: operands before what is made of them
  bool has_branches_ = false;  // that need not be taken
  mutable std::vector<Node> rows_;
};

}  // namespace mixed_order_game
