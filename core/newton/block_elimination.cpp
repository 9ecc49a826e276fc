#include "newton/block_elimination.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <set>
#include <string>

#include "errors.hpp"

namespace mixed_order_game {

BlockElimination::BlockElimination(const CommunicationGraph& graph)
    : directed(graph.directed()), blocks(graph.players()) {
  const int n = graph.hosts();
  std::vector<Eigen::Triplet<double, int>> entries;
  for (int i = 0; i < n; ++i) entries.emplace_back(i, i, 1.0);
  for (const auto& [i, j] : graph.hosted_edges()) {
    entries.emplace_back(i, j, 1.0);
    entries.emplace_back(j, i, 1.0);
  }
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  Eigen::AMDOrdering<int>()(matrix, permutation);
  order.assign(permutation.indices().data(), permutation.indices().data() + n);
  std::vector<int> position(at(n));
  for (int k = 0; k < n; ++k) position[at(order[at(k)])] = k;

  // elimination of k joins all its later neighbours
  std::vector<std::set<int>> column(at(n));
  for (const auto& [i, j] : graph.hosted_edges()) {
    column[at(std::min(position[at(i)], position[at(j)]))].insert(std::max(position[at(i)], position[at(j)]));
  }
  for (int k = 0; k < n; ++k) {
    const std::set<int>& rows = column[at(k)];
    if (!rows.empty()) column[at(*rows.begin())].insert(std::next(rows.begin()), rows.end());
  }
  const auto is_full = [&](int k) { return column[at(k)].size() == at(n - 1 - k); };
  listed = n;
  while (!directed && listed > 0 && is_full(listed - 1)) --listed;
  listed += (n - listed) % full_step;
  start.push_back(0);
  for (int k = 0; k < listed; ++k) {
    row.insert(row.end(), column[at(k)].begin(), column[at(k)].end());
    start.push_back(static_cast<int>(row.size()));
  }
}

int BlockElimination::full_entry(int i, int k) const {
  const int column = k - listed;
  const int a = (i - listed) % full_step;  // row of the band
  const int band = i - listed - a;
  const int before = start.back() + band * (band - 1) / 2;
  if (column < band) return before + column * full_step + a;
  return before + band * full_step + a * (a - 1) / 2 + (column - band);
}

std::vector<int> BlockElimination::targets() const {
  std::vector<int> targets;
  for (int k = 0; k < listed; ++k) {
    for (int a = start[at(k)]; a < start[at(k + 1)]; ++a) {
      for (int b = start[at(k)]; b < a; ++b) {
        const int to = row[at(b)];  // the entry at row[a] of column row[b]
        if (to >= listed) {
          targets.push_back(full_entry(row[at(a)], to));
        } else {
          const auto found = std::lower_bound(row.begin() + start[at(to)], row.begin() + start[at(to + 1)], row[at(a)]);
          targets.push_back(static_cast<int>(found - row.begin()));
        }
      }
    }
  }
  return targets;
}

std::int64_t BlockElimination::bytes() const {
  const std::int64_t padded = (blocks + tile_length - 1) / tile_length * tile_length;
  std::int64_t pairs = 0;
  for (int k = 0; k < listed; ++k) {
    const std::int64_t rows = start[at(k + 1)] - start[at(k)];
    pairs += rows * (rows - 1) / 2;
  }
  return ((directed ? 2 : 1) * std::int64_t{entries()} + players()) * padded * std::int64_t{sizeof(Real)} +
         pairs * std::int64_t{sizeof(int)};
}

void require_moderate_factors(const CommunicationGraph& graph) {
  constexpr std::int64_t most_bytes = std::int64_t{2} << 30;
  const std::int64_t bytes = BlockElimination(graph).bytes();
  if (bytes <= most_bytes) return;
  throw GameError("the graph of " + std::to_string(graph.players()) + " players and " +
                  std::to_string(graph.edges().size()) + " edges needs " + std::to_string(bytes) +
                  " bytes for factors of the estimates' equations, expected at most " + std::to_string(most_bytes));
}

}  // namespace mixed_order_game
