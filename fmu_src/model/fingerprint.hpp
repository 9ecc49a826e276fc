// A 128-bit FNV-1a fingerprint: identifies an interface and detects damaged bytes. Not meant against forgery.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace mixed_order_game {

class Fingerprint {
 public:
  void add(std::string_view bytes);
  /// A text with its length, so that neighbouring texts cannot run together.
  void add_text(std::string_view text);
  void add_number(std::uint64_t number);

  /// Most significant part first.
  [[nodiscard]] std::array<std::uint32_t, 4> value() const { return {part_[3], part_[2], part_[1], part_[0]}; }
  /// As {xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx}.
  [[nodiscard]] std::string as_guid() const;

 private:
  std::array<std::uint32_t, 4> part_{0x6295C58D, 0x62B82175, 0x07BB0142, 0x6C62272E};  // least significant first
};

}  // namespace mixed_order_game
