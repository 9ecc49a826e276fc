#include "newton/reduced_system.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <set>

namespace mixed_order_game {

ReducedSystem::ReducedSystem(const std::vector<std::vector<int>>& rows)
    : unknowns_(static_cast<int>(rows.size())), position_(rows.size()), inverse_pivot_(rows.size()), row_(rows.size()) {
  std::vector<Eigen::Triplet<Real, int>> entries;
  for (int row = 0; row < unknowns_; ++row) {
    entries.emplace_back(row, row, 1.0);
    for (const int column : rows[at(row)]) {
      entries.emplace_back(row, column, 1.0);
      entries.emplace_back(column, row, 1.0);
    }
  }
  Eigen::SparseMatrix<Real> pattern(unknowns_, unknowns_);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(pattern, order);
  for (int k = 0; k < unknowns_; ++k) position_[at(order.indices()(k))] = k;

  // fill: row i of L and U has the columns of its own entries and of every row k < i that it eliminates with
  std::vector<std::set<int>> filled(rows.size());
  for (int row = 0; row < unknowns_; ++row) {
    std::set<int>& columns = filled[at(position_[at(row)])];
    columns.insert(position_[at(row)]);
    for (const int column : rows[at(row)]) columns.insert(position_[at(column)]);
  }
  start_.push_back(0);
  for (int i = 0; i < unknowns_; ++i) {
    std::set<int>& columns = filled[at(i)];
    for (auto k = columns.begin(); *k < i; ++k) columns.insert(filled[at(*k)].upper_bound(*k), filled[at(*k)].end());
    for (const int column : columns) {
      if (column == i) diagonal_.push_back(static_cast<int>(column_.size()));
      column_.push_back(column);
    }
    start_.push_back(static_cast<int>(column_.size()));
  }
  value_.resize(column_.size());
}

void ReducedSystem::clear() {
  std::fill(value_.begin(), value_.end(), 0.0);
  next_ = 0;
}

Real* ReducedSystem::entry(int row, int column) {
  const int i = position_[at(row)];
  const auto first = column_.begin() + start_[at(i)];
  const auto last = column_.begin() + start_[at(i + 1)];
  return &value_[at(std::lower_bound(first, last, position_[at(column)]) - column_.begin())];
}

bool ReducedSystem::factor() {
  constexpr Real smallest_pivot = 1e-6;  // relative to the largest entry of its row
  for (int i = 0; i < unknowns_; ++i) {
    const int first = start_[at(i)];
    const int last = start_[at(i + 1)];
    for (int e = first; e < last; ++e) row_[at(column_[at(e)])] = value_[at(e)];
    for (int e = first; e < diagonal_[at(i)]; ++e) {
      const int k = column_[at(e)];
      const Real factor = row_[at(k)] * inverse_pivot_[at(k)];
      row_[at(k)] = factor;
      for (int u = diagonal_[at(k)] + 1; u < start_[at(k + 1)]; ++u) row_[at(column_[at(u)])] -= factor * value_[at(u)];
    }
    Real largest = 0.0;
    for (int e = first; e < last; ++e) {
      value_[at(e)] = row_[at(column_[at(e)])];
      if (e >= diagonal_[at(i)]) largest = std::max(largest, std::fabs(value_[at(e)]));
    }
    const Real pivot = value_[at(diagonal_[at(i)])];
    if (!(std::fabs(pivot) > smallest_pivot * largest)) return false;
    inverse_pivot_[at(i)] = 1.0 / pivot;
  }
  return true;
}

void ReducedSystem::solve(Real* b) const {
  for (int i = 0; i < unknowns_; ++i) {
    Real sum = b[i];
    for (int e = start_[at(i)]; e < diagonal_[at(i)]; ++e) sum -= value_[at(e)] * b[column_[at(e)]];
    b[i] = sum;
  }
  for (int i = unknowns_ - 1; i >= 0; --i) {
    Real sum = b[i];
    for (int e = diagonal_[at(i)] + 1; e < start_[at(i + 1)]; ++e) sum -= value_[at(e)] * b[column_[at(e)]];
    b[i] = sum * inverse_pivot_[at(i)];
  }
}

}  // namespace mixed_order_game
