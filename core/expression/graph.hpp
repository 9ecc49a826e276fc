// Expressions unrolled for a player: numbers, leaves and operations, each different one once. Derivatives are made of
// the same nodes, so that what values and derivatives share is evaluated once.
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <unordered_map>
#include <utility>
#include <vector>

#include "expression/operation.hpp"
#include "types.hpp"

namespace mixed_order_game {

/// What a leaf stands for; the index counts entries of a joint action, or named parameters.
enum class LeafKind : std::uint8_t { action, velocity, time, parameter };

struct Leaf {
  LeafKind kind = LeafKind::action;
  int index = 0;
  friend auto operator<=>(const Leaf&, const Leaf&) = default;
};

struct GraphNode {
  Operation operation = Operation::number;
  int a = -1;  ///< of a leaf: its number among the leaves
  int b = -1;
  Real value = 0.0;
};

class ExpressionGraph {
 public:
  /// Largest number of nodes; throws GameError beyond.
  explicit ExpressionGraph(std::size_t most_nodes) : most_nodes_(most_nodes) {}

  int number(Real value);
  int leaf(Leaf leaf);
  /// Folds numbers and leaves out what changes nothing; b is -1 for functions of one value.
  int make(Operation operation, int a, int b = -1);

  [[nodiscard]] const GraphNode& node(int k) const { return nodes_[at(k)]; }
  [[nodiscard]] const Leaf& leaf_of(int node) const { return leaves_[at(nodes_[at(node)].a)]; }
  /// All leaves that were asked for.
  [[nodiscard]] const std::vector<Leaf>& leaves() const { return leaves_; }
  [[nodiscard]] int size() const { return static_cast<int>(nodes_.size()); }
  [[nodiscard]] bool is_number(int node) const { return nodes_[at(node)].operation == Operation::number; }
  /// Whether none of the leaves that it is made of is anything but a named parameter.
  [[nodiscard]] bool has_only_parameters(int node) const;
  [[nodiscard]] bool is_number(int node, Real value) const {
    return nodes_[at(node)].operation == Operation::number && nodes_[at(node)].value == value;
  }

  /// The derivative of a node along every leaf that it depends on, in an order that follows from its structure.
  std::vector<std::pair<Leaf, int>> derivatives(int node);

 private:
  struct Key {
    Operation operation;
    int a;
    int b;
    std::uint64_t bits;
    friend bool operator==(const Key&, const Key&) = default;
  };
  struct Hash {
    std::size_t operator()(const Key& key) const;
  };
  int find_or_add(const GraphNode& node);
  /// Derivatives along a and b of a node, as nodes; -1 where there is no such operand.
  std::pair<int, int> partials(int node);

  std::size_t most_nodes_;
  std::vector<GraphNode> nodes_;
  std::vector<Leaf> leaves_;
  std::map<Leaf, int> leaf_nodes_;
  std::unordered_map<Key, int, Hash> known_;
};

/// One operation on reals.
Real apply(Operation operation, Real a, Real b);

}  // namespace mixed_order_game
