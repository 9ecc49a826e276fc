#include "game/communication_graph.hpp"

#include <gtest/gtest.h>

namespace mixed_order_game {
namespace {

using Components = std::vector<std::vector<int>>;
using Edges = std::vector<std::pair<int, int>>;

CommunicationGraph path_and_loner() {  // 0 - 3 - 1, 2 alone
  CommunicationGraph graph(4);
  graph.set_weight(3, 0, 2.5);
  graph.set_weight(1, 3, 0.5);
  graph.refresh();
  return graph;
}

TEST(CommunicationGraph, IsUndirected) {
  const CommunicationGraph graph = path_and_loner();
  EXPECT_EQ(graph.players(), 4);
  EXPECT_EQ(graph.weight(0, 3), 2.5);
  EXPECT_EQ(graph.weight(3, 0), 2.5);
  EXPECT_EQ(graph.weight(3, 1), 0.5);
  EXPECT_EQ(graph.weight(0, 1), 0.0);
  EXPECT_EQ(graph.weight(2, 2), 0.0);
}

TEST(CommunicationGraph, RowsListEachNeighbourOnceInOrder) {
  const CommunicationGraph graph = path_and_loner();
  const NeighbourRows rows = graph.neighbours();
  EXPECT_EQ(std::vector<int>(rows.start, rows.start + 5), (std::vector<int>{0, 1, 2, 2, 4}));
  EXPECT_EQ(std::vector<int>(rows.neighbour, rows.neighbour + 4), (std::vector<int>{3, 3, 0, 1}));
  EXPECT_EQ(std::vector<Real>(rows.weight, rows.weight + 4), (std::vector<Real>{2.5, 0.5, 2.5, 0.5}));
}

TEST(CommunicationGraph, ChangesShowAfterRefresh) {
  CommunicationGraph graph = path_and_loner();
  graph.set_weight(0, 3, 0.0);
  graph.set_weight(2, 1, 1.5);
  graph.refresh();
  const NeighbourRows rows = graph.neighbours();
  EXPECT_EQ(std::vector<int>(rows.start, rows.start + 5), (std::vector<int>{0, 0, 2, 3, 4}));
  EXPECT_EQ(std::vector<int>(rows.neighbour, rows.neighbour + 4), (std::vector<int>{2, 3, 1, 1}));
  EXPECT_EQ(graph.edges(), (Edges{{1, 2}, {1, 3}}));
}

TEST(CommunicationGraph, EdgesComeOnceWithTheSmallerPlayerFirst) {
  EXPECT_EQ(path_and_loner().edges(), (Edges{{0, 3}, {1, 3}}));
}

TEST(CommunicationGraph, ComponentsAreSortedGroups) {
  EXPECT_EQ(CommunicationGraph(3).components(), (Components{{0}, {1}, {2}}));
  CommunicationGraph graph = path_and_loner();
  EXPECT_EQ(graph.components(), (Components{{0, 1, 3}, {2}}));
  graph.set_weight(2, 0, 0.1);
  EXPECT_EQ(graph.components(), (Components{{0, 1, 2, 3}}));
}

TEST(CommunicationGraph, DirectedOnesHearOneWay) {
  CommunicationGraph graph(3, true);
  graph.set_weight(0, 2, 1.5);  // 2 -> 0 -> 1
  graph.set_weight(1, 0, 0.5);
  graph.refresh();
  EXPECT_EQ(graph.weight(2, 0), 0.0);
  const NeighbourRows rows = graph.neighbours();
  EXPECT_EQ(std::vector<int>(rows.start, rows.start + 4), (std::vector<int>{0, 1, 2, 2}));
  EXPECT_EQ(graph.edges(), (Edges{{0, 1}, {0, 2}}));
  EXPECT_EQ(graph.not_reached(), std::pair(0, 2));
  graph.set_weight(2, 1, 1.0);
  EXPECT_EQ(graph.not_reached(), std::nullopt);
  graph.set_weight(0, 2, 0.0);  // 0 -> 1 -> 2
  EXPECT_EQ(graph.not_reached(), std::pair(1, 0));
  EXPECT_EQ(path_and_loner().not_reached(), std::pair(0, 2));
}

}  // namespace
}  // namespace mixed_order_game
