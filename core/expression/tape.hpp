// Expressions of players, compiled: players whose expressions have the same structure are evaluated at once, one to a
// lane, and what several results share is evaluated once.
#pragma once

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "aligned_vector.hpp"
#include "expression/graph.hpp"

namespace mixed_order_game {

/// What leaves stand for.
struct LeafValues {
  const Real* points = nullptr;  ///< actions that player i sees: points + i * stride
  int stride = 0;
  const Real* velocities = nullptr;  ///< at entry(j, h); of second-order players
  Real time = 0.0;
  const Real* parameters = nullptr;
  const Real* held = nullptr;  ///< by the switches
};

/// What one player wants evaluated: nodes of its graph, and where their values go.
struct PlayerResults {
  int player = 0;
  const ExpressionGraph* graph = nullptr;
  std::vector<int> nodes = {};
  std::vector<int> places = {};
};

class Tapes {
 public:
  Tapes() = default;
  explicit Tapes(const std::vector<PlayerResults>& results);

  [[nodiscard]] bool empty() const { return tapes_ == nullptr || tapes_->empty(); }
  /// result[place] = value, for every place.
  void evaluate(const LeafValues& leaves, Real* result) const;
  /// The same for the results of one player.
  void evaluate_player(int player, const LeafValues& leaves, Real* result) const;
  /// Bytes that it holds, about.
  [[nodiscard]] std::size_t memory() const;

 private:
  struct LeafRow {
    int row;
    LeafKind kind;
    std::vector<int> index;  ///< by lane of a player
  };
  struct SumRow {
    int row;
    std::vector<int> index;  ///< of actions: term * lanes + lane
  };
  struct ResultRow {
    int row;
    std::vector<int> place;  ///< by lane
  };
  struct Tape {
    std::vector<int> players;  ///< by lane
    int lanes = 0;             ///< 1, or whole vectors with lanes at the end that repeat the first
    int rows = 0;
    std::vector<TapeInstruction> code;
    std::vector<LeafRow> leaves;
    std::vector<SumRow> sums;  ///< of actions, which are summed where they lie
    std::vector<ResultRow> results;
    std::vector<Real> start;  ///< all rows, with numbers where they stay
  };
  void run(std::size_t number, const LeafValues& leaves, Real* result) const;

  /// Tapes of one lane each, one behind the other, with equal operations side by side wherever operands allow it: the
  /// processor foresees what comes next.
  struct Joined {
    struct Leaf {
      int row;
      int index;
      int player;
    };
    std::vector<TapeInstruction> code;
    std::array<std::vector<Leaf>, leaf_kinds> leaves;  ///< by kind
    std::vector<std::pair<int, int>> results;          ///< row and place
    std::vector<Real> start;
  };
  static Joined joined(const std::vector<Tape>& tapes);
  void run_joined(const LeafValues& leaves, Real* result) const;

  std::shared_ptr<const std::vector<Tape>> tapes_;
  std::shared_ptr<const Joined> joined_;     // all tapes of one lane
  mutable std::vector<AlignedVector> rows_;  // of each tape
  mutable AlignedVector joined_rows_;
};

}  // namespace mixed_order_game
