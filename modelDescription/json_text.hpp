// JSON text of what the host tool answers.
#pragma once

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "number_text.hpp"
#include "types.hpp"

namespace mixed_order_game {

std::string json_string(std::string_view text);

/// null for what is not finite.
inline std::string json_number(Real value) { return std::isfinite(value) ? text_of(value) : "null"; }

template <typename Range, typename Text>
std::string json_list(const Range& range, Text text) {
  std::string list;
  for (const auto& one : range) {
    list += list.empty() ? "[" : ", ";
    list += text(one);
  }
  return list.empty() ? "[]" : list + "]";
}

/// One list for each player, of its coordinates; x is at entry(i, l).
std::string json_actions(const std::vector<Real>& x, const Shape& shape);

}  // namespace mixed_order_game
