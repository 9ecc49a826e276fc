// The weighted communication graph A = [a_ij] of the players: player i hears player j where a_ij > 0. Undirected,
// a_ij = a_ji, unless it is directed.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "kernels/kernels.hpp"
#include "types.hpp"

namespace mixed_order_game {

class CommunicationGraph {
 public:
  explicit CommunicationGraph(int players, bool directed = false);

  [[nodiscard]] int players() const { return players_; }
  [[nodiscard]] bool directed() const { return directed_; }
  [[nodiscard]] Real weight(int i, int j) const { return adjacency_[at(i) * at(players_) + at(j)]; }
  /// Sets a_ij, and a_ji unless the graph is directed; call refresh() after the last change.
  void set_weight(int i, int j, Real weight);

  /// Rebuilds the rows of neighbours.
  void refresh();
  [[nodiscard]] NeighbourRows neighbours() const { return {start_.data(), neighbour_.data(), weight_.data()}; }
  /// Pairs (i, j) with i < j of which one hears the other, in order.
  [[nodiscard]] std::vector<std::pair<int, int>> edges() const;

  /// Of an undirected graph the connected components, each in ascending order; one component means that it is
  /// connected.
  [[nodiscard]] std::vector<std::vector<int>> components() const;

  /// Players (i, j) such that nothing that i shares reaches j, not even by way of others; none when the graph is
  /// (strongly) connected.
  [[nodiscard]] std::optional<std::pair<int, int>> not_reached() const;

 private:
  int players_;
  bool directed_;
  std::vector<Real> adjacency_;
  std::vector<int> start_;
  std::vector<int> neighbour_;
  std::vector<Real> weight_;
};

}  // namespace mixed_order_game
