#include "json_text.hpp"

namespace mixed_order_game {

std::string json_string(std::string_view text) {
  constexpr const char* digits = "0123456789abcdef";
  std::string shown = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 0x20U) {
      shown += std::string("\\u00") + digits[code >> 4U] + digits[code & 15U];
    } else {
      if (c == '"' || c == '\\') shown += '\\';
      shown += c;
    }
  }
  return shown + '"';
}

std::string json_actions(const std::vector<Real>& x, const Shape& shape) {
  std::vector<std::vector<Real>> rows(at(shape.players));
  for (int i = 0; i < shape.players; ++i) {
    for (int l = 0; l < shape.dimension; ++l) rows[at(i)].push_back(x[at(shape.entry(i, l))]);
  }
  return json_list(rows, [](const auto& row) { return json_list(row, json_number); });
}

}  // namespace mixed_order_game
