// Coefficients of costs, unknown dynamics and disturbances, as their families declare them.
//
// A family states each coefficient once. The reader of game files, the FMU's table of variables, saved states,
// directional derivatives and the model structure go by these declarations.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "numbers/dual.hpp"
#include "types.hpp"

namespace mixed_order_game {

/// The indices of a coefficient, and the slots that follow from them.
enum class Indices : std::uint8_t {
  player,  ///< [i] at i
  entry,   ///< [i,l] at entry(i, l)
  pair,    ///< [i,j], i != j, at i N + j
  term,    ///< [i,j,l] at entry(i, l) N + j; few of them differ from zero
};

struct Coefficient {
  const char* key = nullptr;       ///< in the player's table of a game file; null: it is not there
  const char* variable = nullptr;  ///< name of the tunable parameter; null: fixed by the game file
  const char* description = nullptr;
  const char* symbol = nullptr;  ///< what stands for one value of a pair or term in messages
  Indices indices = Indices::player;
  const char* declared_type = nullptr;
  std::array<const char*, 2> unit{};  ///< for players of order 1 and of order 2; null: none
  bool moves_equilibrium = false;
  Real start = 0.0;
};

/// The values of declared coefficients.
class Coefficients {
 public:
  Coefficients(std::span<const Coefficient> declared, int players, int dimension);

  /// The game's named parameters, which expressions use; equal for all families.
  std::vector<Real> named;

  [[nodiscard]] std::span<const Coefficient> declared() const { return declared_; }
  /// Number of slots of a coefficient.
  [[nodiscard]] int slots(Indices indices) const;

  /// All values of a coefficient, by slot; of a term none.
  [[nodiscard]] std::vector<Real>& operator[](int number) { return values_[at(number)]; }
  [[nodiscard]] const std::vector<Real>& operator[](int number) const { return values_[at(number)]; }
  /// The values of a term that were set, by slot.
  [[nodiscard]] const std::map<int, Real>& terms(int number) const { return terms_[at(number)]; }

  [[nodiscard]] Real value(int number, int slot) const;
  void set(int number, int slot, Real value);
  void set_all_to_zero();

 private:
  std::span<const Coefficient> declared_;
  int players_;
  int dimension_;
  std::vector<std::vector<Real>> values_;
  std::vector<std::map<int, Real>> terms_;
};

/// The same coefficients as numbers of another kind: with derivatives, or as what they depend on.
template <typename Scalar>
class CoefficientsAs {
 public:
  virtual ~CoefficientsAs() = default;
  [[nodiscard]] virtual Scalar value(int number, int slot) const = 0;
  /// Whether it is zero whatever happens, so that its term can be left out.
  [[nodiscard]] virtual bool vanishes(int number, int slot) const = 0;
  /// The named parameter at a slot.
  [[nodiscard]] virtual Scalar named(int slot) const = 0;
};

/// Coefficients with those of a direction as derivatives.
class CoefficientsAlong final : public CoefficientsAs<Dual> {
 public:
  /// Without a direction nothing changes.
  CoefficientsAlong(const Coefficients& values, const Coefficients* direction)
      : values_(values), direction_(direction) {}

  [[nodiscard]] Dual value(int number, int slot) const override {
    return {values_.value(number, slot), direction_ == nullptr ? 0.0 : direction_->value(number, slot)};
  }
  [[nodiscard]] bool vanishes(int number, int slot) const override {
    const Dual both = value(number, slot);
    return both.value == 0.0 && both.along == 0.0;
  }
  [[nodiscard]] Dual named(int slot) const override {
    return {values_.named[at(slot)], direction_ == nullptr ? 0.0 : direction_->named[at(slot)]};
  }

 private:
  const Coefficients& values_;
  const Coefficients* direction_;
};

}  // namespace mixed_order_game
