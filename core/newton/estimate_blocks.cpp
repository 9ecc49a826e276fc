#include "newton/estimate_blocks.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace mixed_order_game {

void EstimateBlocks::analyse(const CommunicationGraph& graph, const std::vector<Real>& k3, int dimension) {
  factored_ = 0.0;
  if (has_analysed(graph, k3, dimension)) {
    k3_ = k3[0];
    return;
  }
  players_ = graph.players();
  hosts_ = graph.hosts();
  dimension_ = dimension;
  directed_ = graph.directed();
  k3_ = k3[0];
  scale_.clear();
  row_.clear();
  for (const Real own : k3) row_.push_back(directed_ ? own / k3_ : std::sqrt(own / k3_));
  if (!directed_ && std::any_of(k3.begin(), k3.end(), [&](Real other) { return other != k3_; })) scale_ = row_;
  gain_.resize(at(hosts_) * at(players_));
  seen_.clear();
  for (int h = 0; h < hosts_; ++h) {
    for (int j = 0; j < players_; ++j) seen_.push_back(row_[at(h)] * graph.weight(graph.host(h), j));
  }
  if (by_eigenvectors()) {
    find_eigenvectors(graph);
  } else {
    find_pattern(graph);
  }
}

/// Whether all is as it was, but for a common factor of k3.
bool EstimateBlocks::has_analysed(const CommunicationGraph& graph, const std::vector<Real>& k3, int dimension) const {
  if (players_ != graph.players() || hosts_ != graph.hosts() || dimension_ != dimension ||
      directed_ != graph.directed()) {
    return false;
  }
  for (int h = 0; h < hosts_; ++h) {
    const Real row = directed_ ? k3[at(h)] / k3[0] : std::sqrt(k3[at(h)] / k3[0]);
    if (row != row_[at(h)]) return false;
    for (int j = 0; j < players_; ++j) {
      if (seen_[at(h * players_ + j)] != row * graph.weight(graph.host(h), j)) return false;
    }
  }
  return true;
}

void EstimateBlocks::find_eigenvectors(const CommunicationGraph& graph) {
  const int H = hosts_;
  const int n = players_ * dimension_;
  vector_.resize(at(H) * at(H) * at(n));
  for (AlignedVector* rows : {&eigenvalue_, &shared_, &inverse_}) rows->resize(at(H) * at(n));
  Eigen::MatrixXd laplacian = Eigen::MatrixXd::Zero(H, H);
  for (const auto& [i, k] : graph.hosted_edges()) {
    const Real weight = graph.weight(graph.host(i), graph.host(k));
    laplacian(i, k) = laplacian(k, i) = -weight;
    laplacian(i, i) += weight;
    laplacian(k, k) += weight;
  }
  for (const int j : graph.heard_elsewhere()) {
    for (int i = 0; i < H; ++i) laplacian(i, i) += graph.weight(graph.host(i), j);
  }
  for (int i = 0; i < H; ++i) {
    for (int k = 0; k < H; ++k) laplacian(i, k) *= scale(i) * scale(k);
  }
  for (int j = 0; j < players_; ++j) {
    Eigen::VectorXd seen(H);
    Eigen::VectorXd own(H);  // diagonal of S diag(a_.j) S
    for (int i = 0; i < H; ++i) {
      seen(i) = seen_[at(i * players_ + j)];
      own(i) = scale(i) * seen(i);
    }
    const Eigen::MatrixXd block = laplacian + Eigen::MatrixXd(own.asDiagonal());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(block);
    const Eigen::VectorXd shared = solver.eigenvectors().transpose() * seen;
    for (int p = j; p < n; p += players_) {
      for (int k = 0; k < H; ++k) {
        eigenvalue_[at(k * n + p)] = solver.eigenvalues()(k);
        shared_[at(k * n + p)] = shared(k);
        for (int i = 0; i < H; ++i) vector_[at((k * H + i) * n + p)] = solver.eigenvectors()(i, k);
      }
    }
  }
}

void EstimateBlocks::find_pattern(const CommunicationGraph& graph) {
  elimination_ = BlockElimination(graph);
  target_ = elimination_.targets();
  const int n = hosts_;
  const std::vector<int>& order = elimination_.order;
  const auto weight = [&](int h, int k) { return graph.weight(graph.host(h), graph.host(k)); };
  player_.clear();
  edge_.clear();
  back_edge_.clear();
  degree_.clear();
  for (int k = 0; k < elimination_.listed; ++k) {
    for (int a = elimination_.start[at(k)]; a < elimination_.start[at(k + 1)]; ++a) {
      player_.push_back(order[at(elimination_.row[at(a)])]);
      const int i = player_.back();
      const int h = order[at(k)];
      edge_.push_back(row_[at(i)] * weight(i, h) * scale(h));
      if (directed_) back_edge_.push_back(row_[at(h)] * weight(h, i));
    }
  }
  edge_.resize(at(elimination_.entries()));
  for (int i = elimination_.listed; i < n; ++i) {
    for (int k = elimination_.listed; k < i; ++k) {
      const int h = order[at(k)];
      edge_[at(elimination_.full_entry(i, k))] = scale(h) * weight(h, order[at(i)]) * scale(order[at(i)]);
    }
  }
  for (int k = 0; k < n; ++k) {
    Real degree = 0.0;
    for (int i = 0; i < players_; ++i) degree += graph.weight(graph.host(order[at(k)]), i);
    degree_.push_back(row_[at(order[at(k)])] * degree * scale(order[at(k)]));
  }
  const std::size_t padded = at((players_ + tile_length - 1) / tile_length * tile_length);
  lower_.resize(edge_.size() * padded);
  upper_.resize(back_edge_.size() * padded);
  diagonal_.resize(at(n) * padded);
}

void EstimateBlocks::factor(Real gamma) {
  const Real gamma_k3 = gamma * k3_;
  if (gamma_k3 == factored_) return;
  factored_ = gamma_k3;
  if (by_eigenvectors()) {
    kernels().factor_by_eigenvectors(eigenvectors(), gamma_k3, inverse_.data(), gain_.data());
  } else {
    factor_tiles(gamma_k3);
  }
  scale_rows(1, gain_.data());
}

void EstimateBlocks::factor_tiles(Real gamma_k3) {
  const int n = players_;
  kernels().scale(hosts_ * n, gamma_k3, seen_.data(), gain_.data());
  for (int first = 0; first < n; first += tile_length) {  // blocks first .. last - 1
    const int last = std::min(n, first + tile_length);
    Real* lower = lower_.data() + at(first) * edge_.size();
    Real* diagonal = diagonal_.data() + first * hosts_;
    for (std::size_t a = 0; a < edge_.size(); ++a)
      std::fill_n(lower + a * tile_length, tile_length, -gamma_k3 * edge_[a]);
    Real* upper = upper_.data() + at(first) * back_edge_.size();
    for (std::size_t a = 0; a < back_edge_.size(); ++a)
      std::fill_n(upper + a * tile_length, tile_length, -gamma_k3 * back_edge_[a]);
    for (int k = 0; k < hosts_; ++k) {
      Real* row = diagonal + k * tile_length;
      std::fill_n(row, tile_length, 1.0 + gamma_k3 * degree_[at(k)]);
      for (int j = first; j < last; ++j) {
        row[j - first] += scale(elimination_.order[at(k)]) * gain_[at(elimination_.order[at(k)] * n + j)];
      }
    }
    if (directed_) {
      kernels().factor_directed_blocks(pattern(), lower, upper, diagonal);
    } else {
      kernels().factor_blocks(pattern(), lower, diagonal);
    }
  }
  solve_tiles(1, gain_.data());
}

void EstimateBlocks::solve(Real* rows) const {
  if (!scale_.empty()) {
    const int n = players_ * dimension_;
    for (int i = 0; i < hosts_; ++i) kernels().scale(n, 1.0 / scale_[at(i)], rows + i * n, rows + i * n);
  }
  if (by_eigenvectors()) {
    kernels().solve_by_eigenvectors(eigenvectors(), inverse_.data(), rows);
  } else {
    solve_tiles(dimension_, rows);
  }
  scale_rows(dimension_, rows);
}

void EstimateBlocks::solve_tiles(int width, Real* rows) const {
  if (directed_) {
    kernels().solve_directed_blocks(pattern(), width, lower_.data(), upper_.data(), diagonal_.data(), rows);
  } else {
    kernels().solve_blocks(pattern(), width, lower_.data(), diagonal_.data(), rows);
  }
}

/// S times the rows, of width * N entries.
void EstimateBlocks::scale_rows(int width, Real* rows) const {
  const int n = players_ * width;
  for (int i = 0; i < static_cast<int>(scale_.size()); ++i) {
    kernels().scale(n, scale_[at(i)], rows + i * n, rows + i * n);
  }
}

}  // namespace mixed_order_game
