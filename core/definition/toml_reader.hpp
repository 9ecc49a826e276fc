// Entries of a TOML document together with their paths, so that every error names the entry, its value and what was
// expected. Numbers in paths count from one.
#pragma once

#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

// nesting beyond that of any game is refused, so that a hostile document cannot exhaust the stack
#define TOML_MAX_NESTED_VALUES 32
#define TOML_ENABLE_FORMATTERS 0
#include <toml++/toml.h>

#include "types.hpp"

namespace mixed_order_game {

/// Parses a document in UTF-8; a byte order mark at its beginning means nothing. Throws GameError with line and column
/// when it is not TOML, and when it is too large.
toml::table parse_toml(std::string_view text);

/// One entry, present or not; every reading function throws GameError when the entry is not what it reads.
class TomlEntry {
 public:
  explicit TomlEntry(const toml::table& document) : node_(&document) {}

  [[nodiscard]] bool present() const { return node_ != nullptr; }
  [[nodiscard]] const std::string& path() const { return path_; }

  /// Refuses every key of this table that is not known; an absent table has none.
  void accept_keys(std::span<const std::string_view> known) const;
  void accept_keys(std::initializer_list<std::string_view> known) const { accept_keys(std::span(known)); }
  /// An entry of this table, which may be absent; an absent table has only absent entries.
  [[nodiscard]] TomlEntry operator[](std::string_view key) const;

  /// Number of entries in this list.
  [[nodiscard]] std::size_t length(std::string_view expected) const;
  /// Entry k, counted from zero, of this list.
  [[nodiscard]] TomlEntry item(std::size_t k) const;
  [[nodiscard]] bool is_list() const { return present() && node_->is_array(); }
  [[nodiscard]] bool is_table() const { return present() && node_->is_table(); }
  [[nodiscard]] bool is_text() const { return present() && node_->is_string(); }
  /// The keys of this table; an absent table has none.
  [[nodiscard]] std::vector<std::string> keys(std::string_view expected) const;

  [[nodiscard]] bool boolean() const;
  [[nodiscard]] int integer(int lowest, int highest) const;
  /// Text in one line.
  [[nodiscard]] std::string text() const;
  /// Text in any number of lines.
  [[nodiscard]] std::string multi_line_text() const;
  /// Line and column in the document, from one, of a position in this entry's text.
  [[nodiscard]] std::pair<std::size_t, std::size_t> place_of(std::string_view document, std::size_t position) const;
  /// A finite number; an integer will do.
  [[nodiscard]] Real number() const { return finite("a finite number"); }
  [[nodiscard]] Real number_or(Real absent) const { return present() ? number() : absent; }
  [[nodiscard]] Real positive() const;
  [[nodiscard]] Real non_negative() const;
  /// count numbers, to to[0], to[stride], ...; one number stands for count equal ones.
  void numbers(int count, int stride, Real* to) const;
  /// The same; an absent entry leaves `to` as it is.
  void numbers_if_present(int count, int stride, Real* to) const {
    if (present()) numbers(count, stride, to);
  }

  /// Throws GameError: "path is value, expected ..."
  [[noreturn]] void fail(std::string_view expected) const;

 private:
  TomlEntry(const toml::node* node, std::string path) : node_(node), path_(std::move(path)) {}
  [[nodiscard]] Real finite(std::string_view expected) const;

  const toml::node* node_;
  std::string path_;
};

}  // namespace mixed_order_game
