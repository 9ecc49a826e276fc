#include "estimate_blocks.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace mixed_order_game {

void EstimateBlocks::analyse(const CommunicationGraph& graph, int dimension) {
  factored_ = 0.0;
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
  elimination_ = BlockElimination(graph);
  target_ = elimination_.targets();
  const int n = players_;
  const std::vector<int>& order = elimination_.order;
  player_.clear();
  edge_.clear();
  degree_.clear();
  for (int k = 0; k < elimination_.listed; ++k) {
    for (int a = elimination_.start[at(k)]; a < elimination_.start[at(k + 1)]; ++a) {
      player_.push_back(order[at(elimination_.row[at(a)])]);
      edge_.push_back(graph.weight(order[at(k)], player_.back()));
    }
  }
  edge_.resize(at(elimination_.entries()));
  for (int i = elimination_.listed; i < n; ++i) {
    for (int k = elimination_.listed; k < i; ++k) {
      edge_[at(elimination_.full_entry(i, k))] = graph.weight(order[at(k)], order[at(i)]);
    }
  }
  for (int k = 0; k < n; ++k) {
    Real degree = 0.0;
    for (int i = 0; i < n; ++i) degree += graph.weight(order[at(k)], i);
    degree_.push_back(degree);
  }
  const std::size_t padded = at((n + tile_length - 1) / tile_length * tile_length);
  lower_.resize(edge_.size() * padded);
  diagonal_.resize(at(n) * padded);
}

void EstimateBlocks::factor(const CommunicationGraph& graph, Real gamma_k3) {
  if (gamma_k3 == factored_) return;
  factored_ = gamma_k3;
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
    Real* lower = lower_.data() + at(first) * edge_.size();
    Real* diagonal = diagonal_.data() + first * n;
    for (std::size_t a = 0; a < edge_.size(); ++a)
      std::fill_n(lower + a * tile_length, tile_length, -gamma_k3 * edge_[a]);
    for (int k = 0; k < n; ++k) {
      Real* row = diagonal + k * tile_length;
      std::fill_n(row, tile_length, 1.0 + gamma_k3 * degree_[at(k)]);
      for (int j = first; j < last; ++j) row[j - first] += gain_[at(elimination_.order[at(k)] * n + j)];
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
