// Named parameters of a game: numbers, lists and matrices that expressions use.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "types.hpp"

namespace mixed_order_game {

struct NamedParameter {
  std::string name;
  std::string description = {};
  std::string unit = {};
  Real min = -std::numeric_limits<Real>::infinity();
  Real max = std::numeric_limits<Real>::infinity();
  bool fixed = false;          ///< part of the expressions, and no variable
  std::vector<int> size = {};  ///< none, one or two numbers: of a number, a list, a matrix
  int first = 0;               ///< where its values begin, rows of a matrix one after the other

  [[nodiscard]] int count() const {
    int product = 1;
    for (const int length : size) product *= length;
    return product;
  }
};

struct NamedParameters {
  std::vector<NamedParameter> declared;
  std::vector<Real> values;

  [[nodiscard]] const NamedParameter* find(std::string_view name) const {
    for (const NamedParameter& parameter : declared) {
      if (parameter.name == name) return &parameter;
    }
    return nullptr;
  }
};

}  // namespace mixed_order_game
