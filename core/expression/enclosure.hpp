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

  /// Whether all operations are, so that derivatives tell how values change.
  [[nodiscard]] bool is_smooth() const { return is_smooth_; }

  enum class Definition {
    everywhere,
    convex,  ///< the points of the box at which the expressions are defined are a convex set
    nowhere,
    unknown,
  };
  /// Encloses the values at all points of the box at which the expressions are defined, in the order of the nodes.
  Definition evaluate(const std::function<Interval(const Leaf&)>& box, std::vector<Interval>& values) const;

 private:
  const ExpressionGraph& graph_;
  std::vector<int> nodes_;
  std::vector<int> needed_;  // ascending: operands before what is made of them
  bool is_smooth_ = true;
  mutable std::vector<Interval> rows_;       // by node
  mutable std::vector<unsigned char> form_;  // by node
};

}  // namespace mixed_order_game
