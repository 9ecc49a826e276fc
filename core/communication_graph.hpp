// The undirected, weighted communication graph A = [a_ij] of the players.
#pragma once

#include <vector>

#include "kernels/kernels.hpp"
#include "types.hpp"

namespace mixed_order_game {

class CommunicationGraph {
 public:
  explicit CommunicationGraph(int players);

  [[nodiscard]] int players() const { return players_; }
  [[nodiscard]] Real weight(int i, int j) const { return adjacency_[at(i) * at(players_) + at(j)]; }
  /// Sets a_ij and a_ji; call refresh() after the last change.
  void set_weight(int i, int j, Real weight);

  /// Rebuilds the rows of neighbours.
  void refresh();
  [[nodiscard]] NeighbourRows neighbours() const { return {start_.data(), neighbour_.data(), weight_.data()}; }
  /// Edges (i, j) with i < j and a_ij > 0, in order.
  [[nodiscard]] std::vector<std::pair<int, int>> edges() const;

  /// The connected components, each in ascending order; one component means that the graph is connected.
  [[nodiscard]] std::vector<std::vector<int>> components() const;

 private:
  int players_;
  std::vector<Real> adjacency_;
  std::vector<int> start_;
  std::vector<int> neighbour_;
  std::vector<Real> weight_;
};

}  // namespace mixed_order_game
