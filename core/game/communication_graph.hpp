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
  /// Of a loop that may host some of the players only: it knows the edges of those.
  explicit CommunicationGraph(const Shape& shape, bool directed = false);

  [[nodiscard]] int players() const { return players_; }
  [[nodiscard]] bool directed() const { return directed_; }
  [[nodiscard]] Real weight(int i, int j) const { return adjacency_[at(i) * at(players_) + at(j)]; }
  /// Sets a_ij, and a_ji unless the graph is directed; call refresh() after the last change.
  void set_weight(int i, int j, Real weight);

  /// Rebuilds the rows of neighbours.
  void refresh();
  /// Row h: the players that hosted player h hears.
  [[nodiscard]] NeighbourRows neighbours() const { return all_.view(); }
  /// Row h: the hosted ones among them, by their host numbers.
  [[nodiscard]] NeighbourRows hosted_neighbours() const { return hosted_.empty() ? all_.view() : inner_.view(); }
  /// The others, ascending, that any hosted player hears.
  [[nodiscard]] std::vector<int> heard_elsewhere() const;
  /// Pairs (i, j) with i < j of which one hears the other, in order.
  [[nodiscard]] std::vector<std::pair<int, int>> edges() const;
  /// Number of hosted players.
  [[nodiscard]] int hosts() const { return hosted_.empty() ? players_ : static_cast<int>(hosted_.size()); }
  /// The player that is hosted as number h.
  [[nodiscard]] int host(int h) const { return hosted_.empty() ? h : hosted_[at(h)]; }
  /// Edges between hosted players, by their host numbers.
  [[nodiscard]] std::vector<std::pair<int, int>> hosted_edges() const;

  /// Of an undirected graph the connected components, each in ascending order; one component means that it is
  /// connected.
  [[nodiscard]] std::vector<std::vector<int>> components() const;

  /// Players (i, j) such that nothing that i shares reaches j, not even by way of others; none when the graph is
  /// (strongly) connected.
  [[nodiscard]] std::optional<std::pair<int, int>> not_reached() const;

 private:
  struct Rows {
    std::vector<int> start{0};
    std::vector<int> neighbour = {};
    std::vector<Real> weight = {};
    [[nodiscard]] NeighbourRows view() const { return {start.data(), neighbour.data(), weight.data()}; }
  };

  int players_;
  bool directed_;
  std::vector<int> hosted_;  // as in Shape
  std::vector<Real> adjacency_;
  Rows all_;
  Rows inner_;  // of hosted players; where all are hosted, all_
};

}  // namespace mixed_order_game
