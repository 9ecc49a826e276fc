// Scalar types and the shape of a game: every size in the closed loop follows from these numbers.
//
// Arrays indexed by players and coordinates are stored coordinate-major: entry (i, l) of a vector of
// actions lies at l * N + i, so that one estimate y_i, like x itself, is one contiguous row of N * D.
//
// A loop may host some of the players only, the others being elsewhere. What belongs to hosted players alone, such as
// weight columns, is stored in the same way for the H of them: own entry (h, l) lies at l * H + h.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace mixed_order_game {

using Real = double;

/// Sizes of a game; indices count from zero inside the program and from one in every public name.
struct Shape {
  int players = 0;                          ///< N
  int dimension = 0;                        ///< D, entries of one action
  int neurons = 0;                          ///< q
  std::vector<int> order;                   ///< 1 (velocity-driven) or 2 (acceleration-driven), one per player
  std::vector<int> hosted = {};             ///< the players that the loop hosts, ascending; empty: all
  std::vector<std::uint8_t> external = {};  ///< one per player, 1 where the plant is outside; empty: nowhere

  /// N * D: entries of the joint action x.
  [[nodiscard]] int actions() const { return players * dimension; }
  /// Position of coordinate l of player i in a joint action.
  [[nodiscard]] int entry(int i, int l) const { return l * players + i; }
  [[nodiscard]] int player_of(int entry) const { return entry % players; }
  [[nodiscard]] int coordinate_of(int entry) const { return entry / players; }
  [[nodiscard]] bool is_second_order(int i) const { return order[static_cast<std::size_t>(i)] == 2; }

  [[nodiscard]] bool hosts_all() const { return hosted.empty(); }
  /// H: number of hosted players.
  [[nodiscard]] int hosts() const { return hosted.empty() ? players : static_cast<int>(hosted.size()); }
  /// The player that is hosted as number h.
  [[nodiscard]] int host(int h) const { return hosted.empty() ? h : hosted[static_cast<std::size_t>(h)]; }
  /// The number of player i among the hosted ones, -1 when it is elsewhere.
  [[nodiscard]] int host_number(int i) const {
    if (hosted.empty()) return i;
    const auto found = std::lower_bound(hosted.begin(), hosted.end(), i);
    return found != hosted.end() && *found == i ? static_cast<int>(found - hosted.begin()) : -1;
  }
  /// H * D: entries of the hosted players' actions.
  [[nodiscard]] int own_entries() const { return hosts() * dimension; }
  [[nodiscard]] int own_entry(int h, int l) const { return l * hosts() + h; }
  /// Where an own entry lies in a joint action.
  [[nodiscard]] int entry_of_own(int p) const { return entry(player_of_own(p), p / hosts()); }
  [[nodiscard]] int player_of_own(int p) const { return host(p % hosts()); }
  /// The own entry of an entry of a joint action, -1 when its player is elsewhere.
  [[nodiscard]] int own_of_entry(int entry_of_joint) const {
    const int h = host_number(player_of(entry_of_joint));
    return h < 0 ? -1 : own_entry(h, coordinate_of(entry_of_joint));
  }
  /// Whether the loop holds the plant of player i.
  [[nodiscard]] bool has_plant(int i) const {
    return host_number(i) >= 0 && (external.empty() || external[static_cast<std::size_t>(i)] == 0);
  }

  friend bool operator==(const Shape&, const Shape&) = default;
};

/// Index conversion for the standard containers, which count unsigned.
template <typename Integer>
constexpr std::size_t at(Integer index) {
  return static_cast<std::size_t>(index);
}

}  // namespace mixed_order_game
