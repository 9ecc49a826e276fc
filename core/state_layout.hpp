// Where each variable of the closed loop lies in the state vector: x | z or v | y | W.
//
// Every part is made of rows of N * D entries, so that the state is a matrix of 2 + N + q such rows.
#pragma once

#include "types.hpp"

namespace mixed_order_game {

/// Offsets into the state vector of length size().
class StateLayout {
 public:
  StateLayout() = default;
  explicit StateLayout(const Shape& shape)
      : actions_(shape.actions()), players_(shape.players), neurons_(shape.neurons) {}

  /// x_il at x() + entry(i, l).
  [[nodiscard]] int x() const { return 0; }
  /// z_il (order 1) or v_il (order 2) at reference() + entry(i, l).
  [[nodiscard]] int reference() const { return actions_; }
  /// y_ijl at estimates() + i * actions + entry(j, l).
  [[nodiscard]] int estimates() const { return 2 * actions_; }
  [[nodiscard]] int estimates_of(int i) const { return estimates() + i * actions_; }
  /// W_iml at weights() + m * actions + entry(i, l).
  [[nodiscard]] int weights() const { return (2 + players_) * actions_; }
  [[nodiscard]] int weights_of(int m) const { return weights() + m * actions_; }
  [[nodiscard]] int size() const { return (2 + players_ + neurons_) * actions_; }

 private:
  int actions_ = 0;
  int players_ = 0;
  int neurons_ = 0;
};

}  // namespace mixed_order_game
