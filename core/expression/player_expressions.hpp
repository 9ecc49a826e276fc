// The expressions of all players for one purpose, at slots of the loop's vectors, with their exact derivatives along
// actions, velocities, time and named parameters.
#pragma once

#include <array>
#include <memory>

#include "expression/tape.hpp"
#include "families/coefficients.hpp"
#include "families/sparse_rows.hpp"
#include "numbers/dependencies.hpp"

namespace mixed_order_game {

/// What leaves stand for, in other numbers than reals.
template <typename Scalar>
struct LeafValuesAs {
  const Scalar* points = nullptr;
  int stride = 0;
  const Scalar* velocities = nullptr;
  const Scalar* time = nullptr;
  const CoefficientsAs<Scalar>* coefficients = nullptr;  ///< for the named parameters
  const Real* held = nullptr;  ///< by the switches; their events change nothing to first order

  [[nodiscard]] Scalar value(LeafKind kind, int index, int player) const {
    switch (kind) {
      case LeafKind::action:
        return points[player * stride + index];
      case LeafKind::velocity:
        return velocities[index];
      case LeafKind::time:
        return *time;
      case LeafKind::parameter:
      case LeafKind::held:
        break;
    }
    return coefficients->named(index);
  }
};

class PlayerExpressions {
 public:
  PlayerExpressions() = default;
  /// As many rows as there are slots. Players are numbers of rows of points: those of hosted players.
  PlayerExpressions(int slots, int players, int actions, int parameters);

  /// The value at a slot is a node of the player's graph; each slot once, and compile() after the last.
  void add(int slot, int player, std::shared_ptr<const ExpressionGraph> graph, int node);
  void compile();

  [[nodiscard]] bool empty() const { return values_.empty(); }
  /// value[slot] of every slot that has an expression; the others stay.
  void values(const LeafValues& leaves, Real* value) const;

  /// The same for the slots of one player.
  void value_of_player(int player, const LeafValues& leaves, Real* value) const {
    values_.evaluate_player(player, leaves, value);
  }

  /// Row slot: the indices of leaves of a kind along which its value changes.
  [[nodiscard]] const SparseRows& pattern(LeafKind kind) const { return patterns_[at(static_cast<int>(kind))]; }
  /// Indices of the leaves of a kind that the texts name, ascending: more than the pattern, where a derivative is zero.
  [[nodiscard]] const std::vector<int>& used(LeafKind kind) const { return used_[at(static_cast<int>(kind))]; }
  /// The entries of the pattern.
  void derivatives(LeafKind kind, const LeafValues& leaves, Real* entries) const;

  /// Adds to value[slot] in other numbers, from value and derivatives.
  void add_values(const LeafValuesAs<Dual>& leaves, Dual* value) const;
  void add_values(const LeafValuesAs<Dependencies>& leaves, Dependencies* value) const;

  [[nodiscard]] std::size_t memory() const;

 private:
  static constexpr std::size_t kinds = 4;
  /// What a derivative depends on.
  enum class Factor : std::uint8_t { number, parameters, anything };
  struct Member {
    int slot;
    int player;
    std::shared_ptr<const ExpressionGraph> graph;
    int node;
  };

  void find_switches(const std::vector<const Member*>& member_of);

  int slots_ = 0;
  int players_ = 0;
  int actions_ = 0;
  int parameters_ = 0;
  std::vector<Member> members_;
  std::vector<int> player_of_;  // by slot; -1 without an expression
  Tapes values_;
  std::array<SparseRows, kinds> patterns_;
  std::array<std::vector<int>, kinds> used_;
  std::array<std::vector<Factor>, kinds> factors_;  // along the patterns
  std::array<Tapes, kinds> derivatives_;
  std::array<SparseRows, kinds> switched_by_;  // the leaves that the switches of a value depend on
};

}  // namespace mixed_order_game
