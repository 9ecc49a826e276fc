// The small sparse linear system that is left of a Newton matrix when weights, estimates and velocities are eliminated.
#pragma once

#include <vector>

#include "aligned_vector.hpp"

namespace mixed_order_game {

/// LU without pivoting, in a minimum-degree order found once. The matrix is the identity for a step of zero length, so
/// a pivot that is too small for comfort means that the step is too long: factor() then says so and the step is
/// shortened.
class ReducedSystem {
 public:
  /// For the pattern given by the columns of each row (in any order, repeats allowed).
  explicit ReducedSystem(const std::vector<std::vector<int>>& rows);

  /// Makes the matrix zero.
  void clear();
  /// Adds to an entry of the pattern, in the same sequence after each clear(), because where each entry lies is looked
  /// up once.
  void add(int row, int column, Real value) {
    if (next_ == sequence_.size()) sequence_.push_back(entry(row, column));
    *sequence_[next_++] += value;
  }
  /// False when the matrix is numerically singular.
  bool factor();

  /// Where an unknown and its equation lie in the vectors of solve().
  [[nodiscard]] int place(int unknown) const { return position_[at(unknown)]; }
  void solve(Real* b) const;

 private:
  Real* entry(int row, int column);

  int unknowns_;
  std::vector<int> position_;  // of an unknown in the order of elimination
  // the rows of L (unit diagonal) and U together, in the order of elimination, columns ascending
  std::vector<int> start_;
  std::vector<int> diagonal_;  // number of each row's diagonal entry
  std::vector<int> column_;
  AlignedVector value_;
  AlignedVector inverse_pivot_;
  AlignedVector row_;
  // the entries in the sequence of add()
  std::vector<Real*> sequence_;
  std::size_t next_ = 0;
};

}  // namespace mixed_order_game
