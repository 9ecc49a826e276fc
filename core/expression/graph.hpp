// Expressions unrolled for a player: numbers, leaves and operations, each different one once. Derivatives are made of
// the same nodes, so that what values and derivatives share is evaluated once.
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "expression/operation.hpp"
#include "types.hpp"

namespace mixed_order_game {

/// What a leaf stands for; the index counts entries of a joint action, or named parameters.
/// Held values belong to switches.
enum class LeafKind : std::uint8_t { action, velocity, time, parameter, held };
constexpr std::size_t leaf_kinds = 5;

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

/// How the value that a switch holds follows from a node s.
enum class SwitchKind : std::uint8_t {
  positive,      ///< 1 where s > 0, else 0
  not_negative,  ///< 1 where s >= 0, else 0
  sign,          ///< -1, 0 or 1
  count,         ///< the largest integer k with k step <= s
};

/// What changes an expression abruptly: its value is held between events, which are located.
struct Switch {
  SwitchKind kind = SwitchKind::positive;
  int value = -1;         ///< the node s
  int step = -1;          ///< of a count: a node of parameters
  int guard = -1;         ///< a node: nothing depends on the switch where that is 0; -1: there is none
  bool is_timed = false;  ///< s is affine in time while other switches hold, so that events are known beforehand
  bool is_bend = false;   ///< values are continuous there, and nothing has to be held
  std::string text = {};  ///< that it stands for
};

/// What a node of parameters must be, judged when they are set.
struct Requirement {
  enum class Kind : std::uint8_t { positive, seed };
  Kind kind = Kind::positive;
  int node = -1;
  std::string text = {};  ///< that it stands for, as in "b of mod(a, b)"
};

class ExpressionGraph {
 public:
  /// Largest number of nodes; throws GameError beyond. Its switches are numbered from the first one on.
  explicit ExpressionGraph(std::size_t most_nodes, int first_switch = 0)
      : most_nodes_(most_nodes), first_switch_(first_switch) {}

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
  [[nodiscard]] bool has_only_parameters(int node) const { return (traits_[at(node)] & (varying | holding)) == 0; }
  /// Whether any of them is an action, a velocity or time.
  [[nodiscard]] bool varies(int node) const { return (traits_[at(node)] & varying) != 0; }
  /// Whether any of them is a held value.
  [[nodiscard]] bool holds(int node) const { return (traits_[at(node)] & holding) != 0; }
  /// Whether it may have no finite value at some finite point.
  [[nodiscard]] bool may_be_undefined(int node) const { return (traits_[at(node)] & undefined) != 0; }
  [[nodiscard]] bool is_number(int node, Real value) const {
    return nodes_[at(node)].operation == Operation::number && nodes_[at(node)].value == value;
  }

  /// The leaf of a switch's held value. Of two switches that are equal but for their guards one is made.
  int held(Switch wanted);
  [[nodiscard]] const std::vector<Switch>& switches() const { return switches_; }
  [[nodiscard]] int first_switch() const { return first_switch_; }

  std::vector<Requirement> requirements;

  /// The derivative of a node along every leaf but held values that it depends on, in an order that follows from its
  /// structure.
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

  // what is in a node or in what it is made of
  static constexpr std::uint8_t varying = 1;
  static constexpr std::uint8_t holding = 2;
  static constexpr std::uint8_t undefined = 4;
  [[nodiscard]] std::uint8_t traits_of(const GraphNode& node) const;

  std::size_t most_nodes_;
  std::vector<GraphNode> nodes_;
  std::vector<std::uint8_t> traits_;
  std::vector<Leaf> leaves_;
  std::map<Leaf, int> leaf_nodes_;
  std::unordered_map<Key, int, Hash> known_;
  int first_switch_;
  std::vector<Switch> switches_;
};

/// One operation on reals.
Real apply(Operation operation, Real a, Real b);

}  // namespace mixed_order_game
