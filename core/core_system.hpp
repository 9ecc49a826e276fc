// The small linear system that is left of a Newton matrix when weights, estimates and velocities are eliminated.
#pragma once

#include <memory>
#include <vector>

#include "types.hpp"

namespace mixed_order_game {

class CoreSystem {
 public:
  virtual ~CoreSystem() = default;

  /// Makes the matrix zero.
  virtual void clear() = 0;
  /// Adds to an entry; with a sparse core only where its pattern has one, and in the same sequence after each clear(),
  /// because where each entry lies is looked up once.
  void add(int row, int column, Real value) {
    if (next_ == sequence_.size()) sequence_.push_back(entry(row, column));
    *sequence_[next_++] += value;
  }
  /// False when the matrix is numerically singular.
  virtual bool factor() = 0;

  /// Where an unknown and its equation lie in the vectors of solve().
  [[nodiscard]] virtual int place(int unknown) const = 0;
  virtual void solve(Real* b) = 0;

 protected:
  virtual Real* entry(int row, int column) = 0;
  void begin_sequence() { next_ = 0; }

 private:
  std::vector<Real*> sequence_;
  std::size_t next_ = 0;
};

/// LU with partial pivoting of all entries.
std::unique_ptr<CoreSystem> make_dense_core(int unknowns);

/// Sparse LU for the pattern given by the columns of each row (in any order, repeats allowed).
std::unique_ptr<CoreSystem> make_sparse_core(const std::vector<std::vector<int>>& rows);

}  // namespace mixed_order_game
