#include "estimate_blocks.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <set>

namespace mixed_order_game {

void EstimateBlocks::analyse(const CommunicationGraph& graph, int dimension) {
  players_ = graph.players();
  dimension_ = dimension;
  gain_.resize(at(players_) * at(players_));
  if (by_modes()) {
    find_modes(graph);
  } else {
    find_pattern(graph);
  }
}

void EstimateBlocks::find_modes(const CommunicationGraph& graph) {
  const int N = players_;
  const int n = N * dimension_;
  vector_.resize(at(N) * at(N) * at(n));
  for (AlignedVector* rows : {&eigenvalue_, &shared_, &inverse_}) rows->resize(at(N) * at(n));
  Eigen::MatrixXd laplacian = Eigen::MatrixXd::Zero(N, N);
  for (const auto& [i, k] : graph.edges()) {
    laplacian(i, k) = laplacian(k, i) = -graph.weight(i, k);
    laplacian(i, i) += graph.weight(i, k);
    laplacian(k, k) += graph.weight(i, k);
  }
  for (int j = 0; j < N; ++j) {
    Eigen::VectorXd seen(N);  // a_.j
    for (int i = 0; i < N; ++i) seen(i) = graph.weight(i, j);
    const Eigen::MatrixXd block = laplacian + Eigen::MatrixXd(seen.asDiagonal());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(block);
    const Eigen::VectorXd shared = solver.eigenvectors().transpose() * seen;
    for (int p = j; p < n; p += N) {
      for (int k = 0; k < N; ++k) {
        eigenvalue_[at(k * n + p)] = solver.eigenvalues()(k);
        shared_[at(k * n + p)] = shared(k);
        for (int i = 0; i < N; ++i) vector_[at((k * N + i) * n + p)] = solver.eigenvectors()(i, k);
      }
    }
  }
}

void EstimateBlocks::find_pattern(const CommunicationGraph& graph) {
  const int n = players_;
  std::vector<Eigen::Triplet<double, int>> entries;
  for (int i = 0; i < n; ++i) entries.emplace_back(i, i, 1.0);
  for (const auto& [i, j] : graph.edges()) {
    entries.emplace_back(i, j, 1.0);
    entries.emplace_back(j, i, 1.0);
  }
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  Eigen::AMDOrdering<int>()(matrix, permutation);
  order_.assign(permutation.indices().data(), permutation.indices().data() + n);
  std::vector<int> position(at(n));
  for (int k = 0; k < n; ++k) position[at(order_[at(k)])] = k;

  // elimination of k joins all its later neighbours
  std::vector<std::set<int>> column(at(n));
  for (const auto& [i, j] : graph.edges()) {
    column[at(std::min(position[at(i)], position[at(j)]))].insert(std::max(position[at(i)], position[at(j)]));
  }
  start_.assign(1, 0);
  row_.clear();
  for (int k = 0; k < n; ++k) {
    const std::set<int>& rows = column[at(k)];
    row_.insert(row_.end(), rows.begin(), rows.end());
    start_.push_back(static_cast<int>(row_.size()));
    if (!rows.empty()) column[at(*rows.begin())].insert(std::next(rows.begin()), rows.end());
  }
  target_.clear();
  for (int k = 0; k < n; ++k) {
    for (int a = start_[at(k)]; a < start_[at(k + 1)]; ++a) {
      for (int b = start_[at(k)]; b < a; ++b) {
        const int to = row_[at(b)];  // the entry at row[a] of column row[b]
        const auto found =
            std::lower_bound(row_.begin() + start_[at(to)], row_.begin() + start_[at(to + 1)], row_[at(a)]);
        target_.push_back(static_cast<int>(found - row_.begin()));
      }
    }
  }
  player_.clear();
  edge_.clear();
  degree_.clear();
  for (int k = 0; k < n; ++k) {
    for (int a = start_[at(k)]; a < start_[at(k + 1)]; ++a) {
      player_.push_back(order_[at(row_[at(a)])]);
      edge_.push_back(graph.weight(order_[at(k)], player_.back()));
    }
    Real degree = 0.0;
    for (int i = 0; i < n; ++i) degree += graph.weight(order_[at(k)], i);
    degree_.push_back(degree);
  }
  const std::size_t padded = at((n + tile_length - 1) / tile_length * tile_length);
  lower_.resize(row_.size() * padded);
  diagonal_.resize(at(n) * padded);
}

void EstimateBlocks::factor(const CommunicationGraph& graph, Real gamma_k3) {
  if (by_modes()) {
    kernels().factor_modes(modes(), gamma_k3, inverse_.data(), gain_.data());
    return;
  }
  const int n = players_;
  const NeighbourRows rows = graph.neighbours();
  std::fill(gain_.begin(), gain_.end(), 0.0);
  for (int i = 0; i < n; ++i) {
    for (int e = rows.start[i]; e < rows.start[i + 1]; ++e)
      gain_[at(i * n + rows.neighbour[e])] = gamma_k3 * rows.weight[e];
  }
  for (int first = 0; first < n; first += tile_length) {  // blocks first .. last - 1
    const int last = std::min(n, first + tile_length);
    Real* lower = lower_.data() + at(first) * row_.size();
    Real* diagonal = diagonal_.data() + first * n;
    for (std::size_t a = 0; a < edge_.size(); ++a)
      std::fill_n(lower + a * tile_length, tile_length, -gamma_k3 * edge_[a]);
    for (int k = 0; k < n; ++k) {
      Real* row = diagonal + k * tile_length;
      std::fill_n(row, tile_length, 1.0 + gamma_k3 * degree_[at(k)]);
      for (int j = first; j < last; ++j) row[j - first] += gain_[at(order_[at(k)] * n + j)];
    }
    kernels().factor_blocks(pattern(), lower, diagonal);
  }
  kernels().solve_blocks(pattern(), 1, lower_.data(), diagonal_.data(), gain_.data());
}

void EstimateBlocks::solve(Real* rows) const {
  if (by_modes()) {
    kernels().solve_modes(modes(), inverse_.data(), rows);
  } else {
    kernels().solve_blocks(pattern(), dimension_, lower_.data(), diagonal_.data(), rows);
  }
}

}  // namespace mixed_order_game
