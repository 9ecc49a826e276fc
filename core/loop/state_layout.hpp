// Where each variable of the closed loop lies in the state vector: x | z or v | y | W, of the hosted players.
//
// x holds the actions of the plants that the loop has, and v their velocities; z is there for every hosted player of
// order 1. With all players and plants in the loop, every part is made of rows of N * D entries, so that the state is
// a matrix of 2 + N + q such rows.
#pragma once

#include "types.hpp"

namespace mixed_order_game {

/// Offsets into the state vector of length size().
class StateLayout {
 public:
  StateLayout() = default;
  explicit StateLayout(const Shape& shape)
      : actions_(shape.actions()), own_(shape.own_entries()), hosts_(shape.hosts()), neurons_(shape.neurons) {
    int next = 0;
    for (int p = 0; p < own_; ++p) x_.push_back(shape.has_plant(shape.player_of_own(p)) ? next++ : -1);
    reference_start_ = next;
    for (int p = 0; p < own_; ++p) {
      const int i = shape.player_of_own(p);
      reference_.push_back(shape.has_plant(i) || !shape.is_second_order(i) ? next++ : -1);
    }
    estimates_start_ = next;
  }

  /// The actions begin here.
  [[nodiscard]] int x() const { return 0; }
  /// x_il of the hosted player and coordinate of own entry p; -1 when it is an input.
  [[nodiscard]] int x_of(int p) const { return x_[at(p)]; }
  /// The references and velocities begin here.
  [[nodiscard]] int reference() const { return reference_start_; }
  /// z_il (order 1) or v_il (order 2) of own entry p; -1 when it is an input.
  [[nodiscard]] int reference_of(int p) const { return reference_[at(p)]; }
  /// y_ijl of hosted player h at estimates_of(h) + entry(j, l).
  [[nodiscard]] int estimates() const { return estimates_start_; }
  [[nodiscard]] int estimates_of(int h) const { return estimates() + h * actions_; }
  /// W_iml at weights_of(m) + own entry.
  [[nodiscard]] int weights() const { return estimates_of(hosts_); }
  [[nodiscard]] int weights_of(int m) const { return weights() + m * own_; }
  [[nodiscard]] int size() const { return weights_of(neurons_); }

 private:
  int actions_ = 0;
  int own_ = 0;
  int hosts_ = 0;
  int neurons_ = 0;
  int reference_start_ = 0;
  int estimates_start_ = 0;
  std::vector<int> x_;
  std::vector<int> reference_;
};

}  // namespace mixed_order_game
