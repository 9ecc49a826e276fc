#include "newton/block_elimination.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "errors.hpp"
#include "random_game.hpp"

namespace mixed_order_game {
namespace {

using testing::RandomNumbers;

CommunicationGraph random_graph(int players, double density, std::uint64_t seed) {
  RandomNumbers random(seed);
  CommunicationGraph graph(players);
  for (int i = 1; i < players; ++i) {
    graph.set_weight(i, static_cast<int>(random.below(at(i))), 1.0);
    for (int j = 0; j < i; ++j) {
      if (random.chance(density)) graph.set_weight(i, j, 1.0);
    }
  }
  graph.refresh();
  return graph;
}

/// pattern[i * N + k], i > k: whether L has an entry there, by elimination on a table of all pairs.
std::vector<bool> filled_pattern(const CommunicationGraph& graph, const std::vector<int>& order) {
  const int n = graph.players();
  std::vector<bool> pattern(at(n) * at(n));
  const auto has = [&](int i, int k) { return pattern[at(std::max(i, k)) * at(n) + at(std::min(i, k))]; };
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) pattern[at(i * n + k)] = graph.weight(order[at(i)], order[at(k)]) != 0.0;
  }
  for (int k = 0; k < n; ++k) {
    for (int i = k + 1; i < n; ++i) {
      for (int j = k + 1; j < i; ++j) {
        if (has(i, k) && has(j, k)) pattern[at(i * n + j)] = true;
      }
    }
  }
  return pattern;
}

TEST(BlockElimination, HasEachEntryOfLOnce) {
  for (const double density : {0.0, 0.1, 0.3, 1.0}) {
    for (const int players : {2, 7, 12, 30, 33}) {
      const CommunicationGraph graph = random_graph(players, density, 7);
      const BlockElimination elimination(graph);
      EXPECT_EQ(elimination.full() % full_step, 0);
      std::vector<bool> pattern = filled_pattern(graph, elimination.order);
      std::vector<int> used(at(elimination.entries()), 0);
      for (int k = 0; k < elimination.listed; ++k) {
        for (int a = elimination.start[at(k)]; a < elimination.start[at(k + 1)]; ++a) {
          EXPECT_TRUE(pattern[at(elimination.row[at(a)] * players + k)]);
          pattern[at(elimination.row[at(a)] * players + k)] = false;
          ++used[at(a)];
        }
      }
      for (int i = elimination.listed; i < players; ++i) {
        for (int k = elimination.listed; k < i; ++k) {
          EXPECT_TRUE(pattern[at(i * players + k)]);
          pattern[at(i * players + k)] = false;
          ++used[at(elimination.full_entry(i, k))];
        }
      }
      EXPECT_EQ(std::count(pattern.begin(), pattern.end(), true), 0) << players << ", " << density;
      EXPECT_EQ(std::count(used.begin(), used.end(), 1), elimination.entries()) << players << ", " << density;
      if (density == 1.0) {
        EXPECT_EQ(elimination.full(), players / full_step * full_step);
      }
    }
  }
}

TEST(BlockElimination, CountsItsMemoryBeforeItIsTaken) {
  CommunicationGraph ring(1000);
  for (int i = 0; i < 1000; ++i) ring.set_weight(i, (i + 1) % 1000, 1.0);
  EXPECT_NO_THROW(require_moderate_factors(ring));
  EXPECT_LT(BlockElimination(ring).bytes(), 30'000'000);
  try {
    require_moderate_factors(random_graph(900, 1.0, 1));
    ADD_FAILURE() << "900 players who all see each other were taken";
  } catch (const GameError& error) {
    EXPECT_STREQ(error.what(),
                 "the graph of 900 players and 404550 edges needs 2932214400 bytes for factors of the estimates' "
                 "equations, expected at most 2147483648");
  }
  // N (N - 1) / 2 entries and N diagonal ones of 8 bytes in N blocks
  EXPECT_EQ(BlockElimination(random_graph(96, 1.0, 1)).bytes(), (96 * 95 / 2 + 96) * 96 * 8);
}

}  // namespace
}  // namespace mixed_order_game
