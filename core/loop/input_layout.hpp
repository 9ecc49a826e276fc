// Where each input of the closed loop lies: d_ext | x | v | y | xbar.
//
// The external disturbances are there for every own entry (those of external plants are never set). Actions and
// velocities are inputs where a plant is outside: of hosted players with external plants, and of players elsewhere on
// which unknown dynamics of hosted ones depend. Estimates and shared signals come from the players elsewhere that
// hosted players hear.
#pragma once

#include <vector>

#include "game/parameters.hpp"

namespace mixed_order_game {

class InputLayout {
 public:
  InputLayout() = default;
  explicit InputLayout(const Parameters& parameters);

  /// Of own entry p at d_ext() + p.
  [[nodiscard]] int d_ext() const { return 0; }
  /// Entries of the joint action that are inputs, ascending; the k-th at x() + k.
  [[nodiscard]] const std::vector<int>& actions() const { return actions_; }
  [[nodiscard]] int x() const { return own_; }
  /// The same of the velocities.
  [[nodiscard]] const std::vector<int>& velocities() const { return velocities_; }
  [[nodiscard]] int v() const { return x() + static_cast<int>(actions_.size()); }
  /// Players elsewhere that are heard, ascending: y_kjl of the k-th of them at y_of(k) + entry(j, l), its xbar_l at
  /// xbar_of(k) + l.
  [[nodiscard]] const std::vector<int>& heard() const { return heard_; }
  [[nodiscard]] int y_of(int k) const { return v() + static_cast<int>(velocities_.size()) + k * n_; }
  [[nodiscard]] int xbar_of(int k) const { return y_of(static_cast<int>(heard_.size())) + k * dimension_; }
  [[nodiscard]] int size() const { return xbar_of(static_cast<int>(heard_.size())); }

 private:
  int n_ = 0;
  int own_ = 0;
  int dimension_ = 0;
  std::vector<int> actions_;
  std::vector<int> velocities_;
  std::vector<int> heard_;
};

}  // namespace mixed_order_game
