// The part of the Newton matrix that belongs to the estimates.
//
// The consensus law couples y_ij only with y_kj of the same j and coordinate, so I - gamma J splits into the N matrices
// B_j = I + gamma K3 (L + diag(a_.j)) with K3 the diagonal of k3, each used for every coordinate. Where a loop
// hosts some of the players only, these are the rows and columns of the hosted ones; what they hear from the others
// stays on the diagonal. All have the pattern of the graph: one symbolic analysis (minimum degree), and a numeric L D
// L' that treats the N blocks side by side. For few players it is faster to have the eigenvectors of all L +
// diag(a_.j), which no gamma changes: factorizing is then a division for each.
//
// Where k3 differs from player to player, K3 = k3_1 S^2 with a diagonal S, and S^-1 B_j S is symmetric: the same
// methods work on  I + gamma k3_1 S (L + diag(a_.j)) S  between two scalings of rows. Of a directed graph the blocks
// are row dominant, whatever k3 is, and have an L U without pivoting.
#pragma once

#include <vector>

#include "aligned_vector.hpp"
#include "newton/block_elimination.hpp"

namespace mixed_order_game {

class EstimateBlocks {
 public:
  /// Symbolic analysis, or eigenvectors; needed again when the graph or k3, one for each hosted player, has changed.
  void analyse(const CommunicationGraph& graph, const std::vector<Real>& k3, int dimension);

  /// Numeric factors for gamma > 0.
  void factor(Real gamma);

  /// Solves for rows y_i of dimension * N entries of the hosted players, in place.
  void solve(Real* rows) const;

  /// gain[h * N + j] = d y_ij / d xbar_j of hosted player i = host(h) when everything else is eliminated: column j is
  /// gamma B_j^-1 K3 a_.j.
  [[nodiscard]] const AlignedVector& shared_signal_gain() const { return gain_; }

 private:
  [[nodiscard]] bool by_eigenvectors() const { return hosts_ <= most_players_by_eigenvectors && !directed_; }
  [[nodiscard]] bool has_analysed(const CommunicationGraph& graph, const std::vector<Real>& k3, int dimension) const;
  void find_pattern(const CommunicationGraph& graph);
  void find_eigenvectors(const CommunicationGraph& graph);
  void factor_tiles(Real gamma_k3);
  void solve_tiles(int width, Real* rows) const;
  void scale_rows(int width, Real* rows) const;
  [[nodiscard]] Real scale(int i) const { return scale_.empty() ? 1.0 : scale_[at(i)]; }
  [[nodiscard]] BlockPattern pattern() const {
    return {hosts_,
            players_,
            elimination_.listed,
            elimination_.start.data(),
            elimination_.row.data(),
            elimination_.order.data(),
            player_.data(),
            target_.data()};
  }
  [[nodiscard]] BlockEigenvectors eigenvectors() const {
    return {hosts_, players_, dimension_ * players_, vector_.data(), eigenvalue_.data(), shared_.data()};
  }

  int players_ = 0;
  int hosts_ = 0;
  int dimension_ = 0;
  bool directed_ = false;
  Real k3_ = 0.0;            // of the first of them
  std::vector<Real> scale_;  // S; empty when k3 is the same for all, or the graph directed
  std::vector<Real> row_;    // factor of each row of the graph: s_i, or k3_i / k3_1 of a directed one
  Real factored_ = 0.0;      // gamma k3_, or 0
  AlignedVector seen_;       // row_i a_ij
  AlignedVector gain_;
  // by elimination
  BlockElimination elimination_;
  std::vector<int> player_;  // by host number
  std::vector<int> target_;
  AlignedVector edge_;       // row_i a_ik s_k of each entry's edge; 0 where elimination fills in
  AlignedVector back_edge_;  // of a directed graph, row_k a_ki
  AlignedVector degree_;     // row_i s_i times the sum of each eliminated player's weights
  AlignedVector lower_;
  AlignedVector upper_;  // of a directed graph
  AlignedVector diagonal_;
  // by eigenvectors
  AlignedVector vector_;
  AlignedVector eigenvalue_;
  AlignedVector shared_;
  AlignedVector inverse_;
};

}  // namespace mixed_order_game
