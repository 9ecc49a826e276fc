// The part of the Newton matrix that belongs to the estimates.
//
// The consensus law couples y_ij only with y_kj of the same j and coordinate, so I - gamma J splits into the N matrices
// B_j = I + gamma k3 (L + diag(a_.j)), each used for every coordinate. All have the pattern of the graph: one symbolic
// analysis (minimum degree), and a numeric L D L' that treats the N blocks side by side. For few players it is faster
// to have the eigenvectors of all L + diag(a_.j), which no gamma changes: factorizing is then a division for each.
#pragma once

#include <vector>

#include "aligned_vector.hpp"
#include "block_elimination.hpp"

namespace mixed_order_game {

class EstimateBlocks {
 public:
  /// Symbolic analysis, or eigenvectors; needed again when the graph has changed.
  void analyse(const CommunicationGraph& graph, int dimension);

  /// Numeric factors for gamma k3 > 0.
  void factor(const CommunicationGraph& graph, Real gamma_k3);

  /// Solves for rows y_i of dimension * N entries, in place.
  void solve(Real* rows) const;

  /// gain[i * N + j] = d y_ij / d xbar_j when everything else is eliminated: column j is gamma k3 B_j^-1 a_.j.
  [[nodiscard]] const AlignedVector& shared_signal_gain() const { return gain_; }

 private:
  [[nodiscard]] bool by_modes() const { return players_ <= most_players_by_modes; }
  void find_pattern(const CommunicationGraph& graph);
  void find_modes(const CommunicationGraph& graph);
  [[nodiscard]] BlockPattern pattern() const {
    return {players_,
            elimination_.listed,
            elimination_.start.data(),
            elimination_.row.data(),
            elimination_.order.data(),
            player_.data(),
            target_.data()};
  }
  [[nodiscard]] BlockModes modes() const {
    return {players_, dimension_ * players_, vector_.data(), eigenvalue_.data(), shared_.data()};
  }

  int players_ = 0;
  int dimension_ = 0;
  Real factored_ = 0.0;  // gamma k3, or 0
  AlignedVector gain_;
  // by elimination
  BlockElimination elimination_;
  std::vector<int> player_;
  std::vector<int> target_;
  AlignedVector edge_;    // weight of each entry's edge; 0 where elimination fills in
  AlignedVector degree_;  // sum of each eliminated player's weights
  AlignedVector lower_;
  AlignedVector diagonal_;
  // by modes
  AlignedVector vector_;
  AlignedVector eigenvalue_;
  AlignedVector shared_;
  AlignedVector inverse_;
};

}  // namespace mixed_order_game
