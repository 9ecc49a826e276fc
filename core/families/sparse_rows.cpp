#include "families/sparse_rows.hpp"

#include <algorithm>
#include <iterator>

namespace mixed_order_game {

void unite(const SparseRows& a, const SparseRows& b, SparseRows& both, std::vector<int>& place_of_a,
           std::vector<int>& place_of_b) {
  both = {};
  place_of_a.clear();
  place_of_b.clear();
  for (int row = 0; row < a.rows(); ++row) {
    const auto in_row = [&](const SparseRows& rows) {
      return std::pair(rows.column.begin() + rows.start[at(row)], rows.column.begin() + rows.start[at(row + 1)]);
    };
    const auto [a_first, a_last] = in_row(a);
    const auto [b_first, b_last] = in_row(b);
    const int first = both.entries();
    std::set_union(a_first, a_last, b_first, b_last, std::back_inserter(both.column));
    const auto place = [&](int column) {
      return static_cast<int>(std::lower_bound(both.column.begin() + first, both.column.end(), column) -
                              both.column.begin());
    };
    std::transform(a_first, a_last, std::back_inserter(place_of_a), place);
    std::transform(b_first, b_last, std::back_inserter(place_of_b), place);
    both.start.push_back(both.entries());
  }
}

}  // namespace mixed_order_game
