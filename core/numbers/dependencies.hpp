// What a value depends on, as a kind of number: the equations of the loop, evaluated with it, give the dependencies
// that modelDescription.xml states.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "types.hpp"

namespace mixed_order_game {

/// How a known variable enters: by a constant factor, by a factor made of tunable parameters, or in any way.
enum class DependencyKind : std::uint8_t { constant, tunable, dependent };

class Dependencies {
 public:
  Dependencies() : Dependencies(0.0) {}
  /// A number that never changes.
  Dependencies(Real number) : number_(number) {}  // NOLINT(google-explicit-constructor): numbers are constants
  /// A value that changes, but with nothing that counts as known.
  static Dependencies unknown();
  /// A known variable itself.
  static Dependencies known(int reference);

  /// The number, when it never changes.
  [[nodiscard]] const std::optional<Real>& number() const { return number_; }
  /// References of known variables, ascending.
  [[nodiscard]] const std::vector<std::pair<int, DependencyKind>>& on() const { return on_; }
  /// The same, all of them in any way.
  [[nodiscard]] Dependencies nonlinear() const;

  Dependencies& operator+=(const Dependencies& other);
  friend Dependencies operator+(Dependencies a, const Dependencies& b) { return a += b; }
  friend Dependencies operator-(const Dependencies& a);
  friend Dependencies operator-(const Dependencies& a, const Dependencies& b) { return a + -b; }
  friend Dependencies operator*(const Dependencies& a, const Dependencies& b);
  friend Dependencies operator/(const Dependencies& a, const Dependencies& b);
  friend Dependencies exp(const Dependencies& a);
  friend Dependencies tanh(const Dependencies& a);
  friend Dependencies sin(const Dependencies& a);

 private:
  [[nodiscard]] Dependencies scaled() const;  // by a factor that parameters can change

  std::optional<Real> number_;
  std::vector<std::pair<int, DependencyKind>> on_;
};

}  // namespace mixed_order_game
