// The external disturbance d_ext(t) that comes from outside: for each entry a polynomial in time.
//
// Entry p holds  value + sum over k >= 1 of derivative_k (t - t_set)^k / k!, where t_set is the time at which its
// derivatives were set; setting the value anew removes them. Times count from the start of the run.
#pragma once

#include <span>
#include <vector>

#include "types.hpp"

namespace mixed_order_game {

class ExternalDisturbance {
 public:
  static constexpr int highest_derivative = 3;

  explicit ExternalDisturbance(int entries);

  [[nodiscard]] int entries() const { return static_cast<int>(numbers_.size()) / stride; }
  /// The value at the time it was set.
  [[nodiscard]] Real value(int entry) const { return polynomial(entry)[0]; }
  /// Sets a constant.
  void set_value(int entry, Real value);
  /// Sets derivative number order >= 1 [per s^order] of an entry, counted from time t on.
  void set_derivative(int entry, int order, Real derivative, Real t);

  /// d_ext(t) at entry(i, l).
  void values(Real t, Real* d_ext) const;
  /// d/dt d_ext(t) at entry(i, l).
  void rates(Real t, Real* rate) const;

  /// Every number that it consists of, to compare, save and restore: entries() * (highest_derivative + 2).
  [[nodiscard]] std::span<const Real> numbers() const { return numbers_; }
  void set_numbers(std::span<const Real> numbers);

 private:
  static constexpr int since = highest_derivative + 1;  // position of the time from which the derivatives count
  static constexpr int stride = since + 1;

  /// Value, derivatives, since.
  [[nodiscard]] const Real* polynomial(int entry) const { return numbers_.data() + at(entry) * stride; }
  [[nodiscard]] Real* polynomial(int entry) { return numbers_.data() + at(entry) * stride; }
  void find_derivatives();

  std::vector<Real> numbers_;  // polynomial by polynomial
  bool has_derivatives_ = false;
};

}  // namespace mixed_order_game
