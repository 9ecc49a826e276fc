// Bounds of norms and eigenvalues of all matrices whose entries lie in intervals.
#pragma once

#include <vector>

#include "expression/interval.hpp"

namespace mixed_order_game {

/// Of an interval with finite ends.
inline Real middle_of(const Interval& side) { return 0.5 * side.lower + 0.5 * side.upper; }

/// An upper bound of the 2-norms of all matrices of D rows, which lie one behind the other.
Real norm_bound(const std::vector<Interval>& rows, int D);

/// A lower bound of the eigenvalues of the symmetric parts of all n x n matrices; -infinite where entries are
/// unbounded.
Real least_eigenvalue(const std::vector<Interval>& entries, int n);

}  // namespace mixed_order_game
