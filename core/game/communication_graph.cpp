#include "game/communication_graph.hpp"

#include <algorithm>

namespace mixed_order_game {

CommunicationGraph::CommunicationGraph(int players, bool directed)
    : players_(players), directed_(directed), adjacency_(at(players) * at(players)) {
  refresh();
}

CommunicationGraph::CommunicationGraph(const Shape& shape, bool directed)
    : players_(shape.players),
      directed_(directed),
      hosted_(shape.hosted),
      adjacency_(at(shape.players) * at(shape.players)) {
  refresh();
}

void CommunicationGraph::set_weight(int i, int j, Real weight) {
  adjacency_[at(i) * at(players_) + at(j)] = weight;
  if (!directed_) adjacency_[at(j) * at(players_) + at(i)] = weight;
}

void CommunicationGraph::refresh() {
  all_ = {};
  inner_ = {};
  for (int h = 0; h < hosts(); ++h) {
    int number = 0;  // of the next hosted player from j on
    for (int j = 0; j < players_; ++j) {
      while (number < hosts() && host(number) < j) ++number;
      const Real a = weight(host(h), j);
      if (a == 0.0) continue;
      all_.neighbour.push_back(j);
      all_.weight.push_back(a);
      if (hosted_.empty() || number == hosts() || host(number) != j) continue;
      inner_.neighbour.push_back(number);
      inner_.weight.push_back(a);
    }
    all_.start.push_back(static_cast<int>(all_.neighbour.size()));
    inner_.start.push_back(static_cast<int>(inner_.neighbour.size()));
  }
}

std::vector<int> CommunicationGraph::heard_elsewhere() const {
  std::vector<int> heard;
  for (int j = 0; j < players_; ++j) {
    if (hosted_.empty() || std::binary_search(hosted_.begin(), hosted_.end(), j)) continue;
    for (int h = 0; h < hosts(); ++h) {
      if (weight(host(h), j) == 0.0) continue;
      heard.push_back(j);
      break;
    }
  }
  return heard;
}

std::vector<std::pair<int, int>> CommunicationGraph::hosted_edges() const {
  if (hosted_.empty()) return edges();
  std::vector<std::pair<int, int>> edges;
  for (int h = 0; h < hosts(); ++h) {
    for (int k = h + 1; k < hosts(); ++k) {
      if (weight(host(h), host(k)) > 0.0 || weight(host(k), host(h)) > 0.0) edges.emplace_back(h, k);
    }
  }
  return edges;
}

std::vector<std::pair<int, int>> CommunicationGraph::edges() const {
  std::vector<std::pair<int, int>> edges;
  for (int i = 0; i < players_; ++i) {
    for (int j = i + 1; j < players_; ++j) {
      if (weight(i, j) > 0.0 || weight(j, i) > 0.0) edges.emplace_back(i, j);
    }
  }
  return edges;
}

std::vector<std::vector<int>> CommunicationGraph::components() const {
  std::vector<std::vector<int>> components;
  std::vector<bool> seen(at(players_), false);
  for (int root = 0; root < players_; ++root) {
    if (seen[at(root)]) continue;
    std::vector<int> component{root};
    seen[at(root)] = true;
    for (std::size_t next = 0; next < component.size(); ++next) {
      for (int j = 0; j < players_; ++j) {
        if (!seen[at(j)] && weight(component[next], j) > 0.0) {
          seen[at(j)] = true;
          component.push_back(j);
        }
      }
    }
    std::sort(component.begin(), component.end());
    components.push_back(std::move(component));
  }
  return components;
}

// Strongly connected: every player is reached from the first one, and the first one from every player.
std::optional<std::pair<int, int>> CommunicationGraph::not_reached() const {
  for (const bool from_first : {true, false}) {
    std::vector<int> found{0};
    std::vector<bool> seen(at(players_), false);
    seen[0] = true;
    for (std::size_t next = 0; next < found.size(); ++next) {
      for (int j = 0; j < players_; ++j) {
        const Real heard = from_first ? weight(j, found[next]) : weight(found[next], j);
        if (seen[at(j)] || !(heard > 0.0)) continue;
        seen[at(j)] = true;
        found.push_back(j);
      }
    }
    const auto missing = std::find(seen.begin(), seen.end(), false);
    if (missing == seen.end()) continue;
    const int j = static_cast<int>(missing - seen.begin());
    return from_first ? std::pair(0, j) : std::pair(j, 0);
  }
  return std::nullopt;
}

}  // namespace mixed_order_game
