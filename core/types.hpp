// Scalar types and the shape of a game: every size in the closed loop follows from these numbers.
//
// Arrays indexed by players and coordinates are stored coordinate-major: entry (i, l) of a vector of
// actions lies at l * N + i, so that one estimate y_i, like x itself, is one contiguous row of N * D.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace mixed_order_game {

using Real = double;

/// Sizes of a game; indices count from zero inside the program and from one in every public name.
struct Shape {
  int players = 0;         ///< N
  int dimension = 0;       ///< D, entries of one action
  int neurons = 0;         ///< q
  std::vector<int> order;  ///< 1 (velocity-driven) or 2 (acceleration-driven), one per player

  /// N * D: entries of the joint action x.
  [[nodiscard]] int actions() const { return players * dimension; }
  /// Position of coordinate l of player i in a joint action.
  [[nodiscard]] int entry(int i, int l) const { return l * players + i; }
  [[nodiscard]] int player_of(int entry) const { return entry % players; }
  [[nodiscard]] int coordinate_of(int entry) const { return entry / players; }
  [[nodiscard]] bool is_second_order(int i) const { return order[static_cast<std::size_t>(i)] == 2; }

  friend bool operator==(const Shape&, const Shape&) = default;
};

/// Index conversion for the standard containers, which count unsigned.
template <typename Integer>
constexpr std::size_t at(Integer index) {
  return static_cast<std::size_t>(index);
}

}  // namespace mixed_order_game
