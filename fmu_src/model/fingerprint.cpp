#include "fingerprint.hpp"

namespace mixed_order_game {

void Fingerprint::add(std::string_view bytes) {
  for (const char byte : bytes) {
    part_[0] ^= static_cast<unsigned char>(byte);
    // times the prime 2^88 + 315
    std::array<std::uint32_t, 4> product{};
    std::uint64_t carry = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      carry += std::uint64_t{part_[k]} * 315;
      product[k] = static_cast<std::uint32_t>(carry);
      carry >>= 32;
    }
    const std::uint64_t shifted = (std::uint64_t{part_[1]} << 32 | part_[0]) << 24;
    const std::uint64_t high = (std::uint64_t{product[3]} << 32 | product[2]) + shifted;
    part_ = {product[0], product[1], static_cast<std::uint32_t>(high), static_cast<std::uint32_t>(high >> 32)};
  }
}

void Fingerprint::add_text(std::string_view text) {
  add_number(text.size());
  add(text);
}

void Fingerprint::add_number(std::uint64_t number) {
  std::array<char, 8> bytes{};
  for (std::size_t k = 0; k < bytes.size(); ++k) bytes[k] = static_cast<char>(number >> (8 * k) & 0xFF);
  add({bytes.data(), bytes.size()});
}

std::string Fingerprint::as_guid() const {
  constexpr std::string_view digits = "0123456789abcdef";
  std::string text = "{";
  int nibble = 0;
  for (const std::uint32_t part : value()) {
    for (int shift = 28; shift >= 0; shift -= 4, ++nibble) {
      if (nibble == 8 || nibble == 12 || nibble == 16 || nibble == 20) text += '-';
      text += digits[part >> shift & 0xF];
    }
  }
  return text + "}";
}

}  // namespace mixed_order_game
