// What comes into the loop from outside: external disturbances, actions and velocities of plants that are elsewhere,
// estimates and shared signals of other players. Each is a polynomial in time.
//
// Input k holds  value + sum over k >= 1 of derivative_k (t - t_set)^k / k!, where t_set is the time at which its
// derivatives were set; setting the value anew removes them. Times count from the start of the run.
#pragma once

#include <span>
#include <vector>

#include "types.hpp"

namespace mixed_order_game {

class Inputs {
 public:
  static constexpr int highest_derivative = 3;

  explicit Inputs(int count);

  [[nodiscard]] int count() const { return static_cast<int>(numbers_.size()) / stride; }
  /// The value at the time it was set.
  [[nodiscard]] Real value(int input) const { return polynomial(input)[0]; }
  /// Whether all its derivatives are zero.
  [[nodiscard]] bool is_constant(int input) const;
  [[nodiscard]] bool are_constant() const { return varying_ == 0; }
  /// Sets a constant.
  void set_value(int input, Real value);
  /// Sets derivative number order >= 1 [per s^order], counted from time t on.
  void set_derivative(int input, int order, Real derivative, Real t);

  /// All values at time t.
  void values(Real t, Real* value) const;
  /// Their derivatives by time.
  void rates(Real t, Real* rate) const;

  /// Every number that it consists of, to compare, save and restore: count() * (highest_derivative + 2).
  [[nodiscard]] std::span<const Real> numbers() const { return numbers_; }
  void set_numbers(std::span<const Real> numbers);

 private:
  static constexpr int since = highest_derivative + 1;  // position of the time from which the derivatives count
  static constexpr int stride = since + 1;

  /// Value, derivatives, since.
  [[nodiscard]] const Real* polynomial(int input) const { return numbers_.data() + at(input) * stride; }
  [[nodiscard]] Real* polynomial(int input) { return numbers_.data() + at(input) * stride; }

  std::vector<Real> numbers_;  // polynomial by polynomial
  std::vector<Real> values_;   // value by value
  int varying_ = 0;            // how many have derivatives
};

}  // namespace mixed_order_game
