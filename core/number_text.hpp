// Numbers in messages and files, the same in every locale.
#pragma once

#include <charconv>
#include <string>

#include "types.hpp"

namespace mixed_order_game {

/// The shortest text that reads back as the same number.
inline std::string text_of(Real value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

}  // namespace mixed_order_game
