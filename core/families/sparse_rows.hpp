// The pattern of a sparse matrix by rows, shared by the cost's Hessian rows and the dynamics' Jacobian.
#pragma once

#include <vector>

#include "types.hpp"

namespace mixed_order_game {

/// Compressed rows: the columns of row r are column[start[r]] .. column[start[r + 1] - 1], ascending.
struct SparseRows {
  std::vector<int> start{0};
  std::vector<int> column;

  [[nodiscard]] int rows() const { return static_cast<int>(start.size()) - 1; }
  [[nodiscard]] int entries() const { return static_cast<int>(column.size()); }
};

/// The pattern that holds two others of as many rows, and where their entries lie in it.
void unite(const SparseRows& a, const SparseRows& b, SparseRows& both, std::vector<int>& place_of_a,
           std::vector<int>& place_of_b);

}  // namespace mixed_order_game
