// Order and fill of the elimination that all estimate blocks share, before any number is known.
#pragma once

#include <cstdint>
#include <vector>

#include "game/communication_graph.hpp"

namespace mixed_order_game {

/// Players in an order of minimum degree, and the entries that L gets when they are eliminated; with a directed graph U
/// gets those of L'. From some column on L is full, with a complete graph from the first: of these columns, a multiple
/// of full_step of them, nothing is listed, unless the graph is directed.
struct BlockElimination {
  BlockElimination() = default;
  explicit BlockElimination(const CommunicationGraph& graph);

  bool directed = false;
  int blocks = 0;          ///< one for each player, of the hosted players each
  std::vector<int> order;  ///< order[k] is the player eliminated k-th
  int listed = 0;          ///< columns before the full ones
  std::vector<int> start;  ///< column k < listed: entries start[k] .. start[k + 1] - 1
  std::vector<int> row;    ///< their rows in elimination order, ascending

  [[nodiscard]] int players() const { return static_cast<int>(order.size()); }
  /// Entries of L: those of the listed columns, then the full ones in bands of full_step rows, see full_columns.ipp.
  [[nodiscard]] int entries() const { return start.back() + full() * (full() - 1) / 2; }
  /// Entry of row i in the full column k < i.
  [[nodiscard]] int full_entry(int i, int k) const;
  [[nodiscard]] int full() const { return players() - listed; }
  /// For each listed column the entries that its pairs of rows update.
  [[nodiscard]] std::vector<int> targets() const;
  /// Bytes that the factors of all blocks take, with their tables.
  [[nodiscard]] std::int64_t bytes() const;
};

/// Throws GameError when the factors of all blocks would take too much memory; takes little itself.
void require_moderate_factors(const CommunicationGraph& graph);

}  // namespace mixed_order_game
