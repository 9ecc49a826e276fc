#include "definition/toml_reader.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>

#include "errors.hpp"

namespace mixed_order_game {

namespace {

constexpr std::size_t most_text = std::size_t{32} << 20;  // bytes; parsing needs about forty times as much memory
constexpr int most_dots = 16;                             // in one dotted key

// Refuses dotted keys without end: they nest as deeply as values do, but toml++ does not count them.
void refuse_endless_keys(std::string_view text) {
  const auto quotes = [&](std::size_t k, std::size_t most) {  // equal quotation marks from k on
    std::size_t count = 0;
    while (count < most && k + count < text.size() && text[k + count] == text[k]) ++count;
    return count;
  };
  int dots = 0;
  std::size_t line = 1;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const char c = text[k];
    if (c == '#') {
      while (k + 1 < text.size() && text[k + 1] != '\n') ++k;
    } else if (c == '"' || c == '\'') {
      const bool multi_line = quotes(k, 3) == 3;
      if (!multi_line && quotes(k, 2) == 2) {
        ++k;  // an empty string
        continue;
      }
      for (k += multi_line ? 3 : 1; k < text.size(); ++k) {
        if (text[k] == '\n') {
          ++line;
          if (!multi_line) break;
        } else if (c == '"' && text[k] == '\\') {
          ++k;
        } else if (text[k] == c && !multi_line) {
          break;
        } else if (text[k] == c && quotes(k, 3) == 3) {
          k += quotes(k, 5) - 1;  // the string may end with two marks of its own
          break;
        }
      }
    } else if (c == '.') {
      if (++dots > most_dots) {
        const std::string told = "the game definition has a key of more than " + std::to_string(most_dots) +
                                 " dots, expected the keys of a game";
        throw GameError("line " + std::to_string(line) + " of " + told, told, {}, line, 1);
      }
    } else if (c == '\n' || c == '=' || c == ',' || c == '[' || c == ']' || c == '{' || c == '}') {
      dots = 0;
      if (c == '\n') ++line;
    }
  }
}

// Short enough for a message, and in one line.
std::string readable(std::string_view text) {
  constexpr std::size_t longest = 40;
  std::string shown(text.substr(0, longest));
  if (text.size() > longest) {
    while (!shown.empty() && (static_cast<unsigned char>(shown.back()) & 0xC0U) == 0x80U) shown.pop_back();
    if (!shown.empty() && static_cast<unsigned char>(shown.back()) >= 0xC0U) shown.pop_back();
    shown += "...";
  }
  for (char& c : shown) {
    if (static_cast<unsigned char>(c) < 0x20U || c == 0x7F) c = ' ';
  }
  return shown;
}

template <typename Number>
std::string in_digits(Number value) {
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

std::string value_of(const toml::node& node) {
  constexpr std::size_t longest_list = 4;
  if (const auto* text = node.as_string()) return '"' + readable(text->get()) + '"';
  if (const auto* integer = node.as_integer()) return in_digits(integer->get());
  if (const auto* real = node.as_floating_point()) return in_digits(real->get());
  if (const auto* boolean = node.as_boolean()) return boolean->get() ? "true" : "false";
  if (node.is_table()) return "a table";
  if (const auto* list = node.as_array()) {
    const bool shown = list->size() <= longest_list &&
                       std::all_of(list->begin(), list->end(), [](const auto& item) { return item.is_number(); });
    if (!shown) return "a list of " + in_digits(list->size());
    std::string items;
    for (const auto& item : *list) items += (items.empty() ? "" : ", ") + value_of(item);
    return '[' + items + ']';
  }
  return "a date or time";
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

toml::table parse_toml(std::string_view text) {
  if (text.size() > most_text) {
    throw GameError("the game definition has " + in_digits(text.size()) + " bytes, expected at most " +
                    in_digits(most_text));
  }
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    throw GameError("the game definition is UTF-16 text, expected UTF-8");
  }
  refuse_endless_keys(text);
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& error) {
    const toml::source_position where = error.source().begin;
    const std::string told = "the game definition is not TOML: " + std::string(error.description());
    throw GameError("line " + in_digits(where.line) + ", column " + in_digits(where.column) + " of " + told, told, {},
                    where.line, where.column);
  }
}

void TomlEntry::accept_keys(std::span<const std::string_view> known) const {
  if (!present()) return;
  if (!node_->is_table()) fail("a table");
  for (const auto& [key, value] : *node_->as_table()) {
    const std::string_view name = key.str();
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    const std::string shown = readable(name);
    const auto distance = [&](std::string_view other) { return edit_distance(shown, other); };
    const auto closest = std::min_element(
        known.begin(), known.end(), [&](std::string_view a, std::string_view b) { return distance(a) < distance(b); });
    std::string expected;
    if (distance(*closest) <= std::max<std::size_t>(shown.size() / 3, shown.size() < 4 ? 0 : 2)) {
      expected = "the closest known key is " + std::string(*closest);
    } else {
      for (const std::string_view other : known)
        expected += (expected.empty() ? "expected one of " : ", ") + std::string(other);
    }
    throw GameError(
        "\"" + shown + "\" is an unknown key of " + (path_.empty() ? "the game definition" : path_) + ", " + expected,
        path_.empty() ? std::string(name) : path_ + '.' + std::string(name));
  }
}

TomlEntry TomlEntry::operator[](std::string_view key) const {
  const toml::node* node = present() && node_->is_table() ? node_->as_table()->get(key) : nullptr;
  return {node, path_.empty() ? std::string(key) : path_ + '.' + std::string(key)};
}

std::size_t TomlEntry::length(std::string_view expected) const {
  if (!is_list()) fail(expected);
  return node_->as_array()->size();
}

TomlEntry TomlEntry::item(std::size_t k) const {
  return {node_->as_array()->get(k), path_ + '[' + in_digits(k + 1) + ']'};
}

bool TomlEntry::boolean() const {
  const auto* value = present() ? node_->as_boolean() : nullptr;
  if (value == nullptr) fail("true or false");
  return value->get();
}

int TomlEntry::integer(int lowest, int highest) const {
  const auto* value = present() ? node_->as_integer() : nullptr;
  if (value == nullptr || value->get() < lowest || value->get() > highest) {
    fail("an integer from " + in_digits(lowest) + " to " + in_digits(highest));
  }
  return static_cast<int>(value->get());
}

std::string TomlEntry::text() const {
  const auto* value = present() ? node_->as_string() : nullptr;
  if (value == nullptr) fail("text");
  const auto control = [](char c) { return static_cast<unsigned char>(c) < 0x20U || c == 0x7F; };
  if (std::any_of(value->get().begin(), value->get().end(), control)) fail("text without control characters");
  return value->get();
}

std::vector<std::string> TomlEntry::keys(std::string_view expected) const {
  std::vector<std::string> names;
  if (!present()) return names;
  if (!node_->is_table()) fail(expected);
  for (const auto& [key, value] : *node_->as_table()) names.emplace_back(key.str());
  // as the file has them, so that variables come in that order
  std::sort(names.begin(), names.end(), [&](const std::string& a, const std::string& b) {
    const toml::table& table = *node_->as_table();
    const auto place = [&](const std::string& name) {
      const toml::source_position& at_key = table.find(name)->first.source().begin;
      return std::pair(at_key.line, at_key.column);
    };
    return place(a) < place(b);
  });
  return names;
}

std::string TomlEntry::multi_line_text() const {
  if (!is_text()) fail("text");
  return node_->as_string()->get();
}

std::pair<std::size_t, std::size_t> TomlEntry::place_of(std::string_view document, std::size_t position) const {
  const toml::source_position begin = node_->source().begin;
  std::size_t line = begin.line;
  std::size_t column = begin.column;
  std::size_t start = 0;  // of the line in the document
  for (std::size_t k = 1; k < line; ++k) start = document.find('\n', start) + 1;
  const std::string_view quote = document.substr(std::min(start + column - 1, document.size()), 3);
  column += quote == "\"\"\"" || quote == "'''" ? 3 : 1;
  const std::string text = multi_line_text();
  if (column - begin.column == 3) {  // a line break right after the quotation marks is not part of the text
    const char next = document[std::min(start + column - 1, document.size() - 1)];
    if (next == '\n' || next == '\r') {
      ++line;
      column = 1;
    }
  }
  for (std::size_t k = 0; k < position && k < text.size(); ++k) {
    column = text[k] == '\n' ? 1 : column + 1;
    if (text[k] == '\n') ++line;
  }
  return {line, column};
}

Real TomlEntry::finite(std::string_view expected) const {
  if (!present() || !node_->is_number()) fail(expected);
  const auto* integer = node_->as_integer();
  const Real value = integer != nullptr ? static_cast<Real>(integer->get()) : node_->as_floating_point()->get();
  if (!std::isfinite(value)) fail(expected);
  return value;
}

Real TomlEntry::positive() const {
  constexpr std::string_view expected = "a positive number";
  const Real value = finite(expected);
  if (value <= 0.0) fail(expected);
  return value;
}

Real TomlEntry::non_negative() const {
  constexpr std::string_view expected = "a number that is not negative";
  const Real value = finite(expected);
  if (value < 0.0) fail(expected);
  return value;
}

void TomlEntry::numbers(int count, int stride, Real* to) const {
  const std::string expected = "a list of " + in_digits(count) + (count == 1 ? " number" : " numbers") +
                               " or one number that stands for all of them";
  if (is_list()) {
    if (length(expected) != at(count)) fail(expected);
    for (int k = 0; k < count; ++k) to[k * stride] = item(at(k)).number();
  } else {
    const Real value = finite(expected);
    for (int k = 0; k < count; ++k) to[k * stride] = value;
  }
}

void TomlEntry::fail(std::string_view expected) const {
  throw GameError(path_ + " is " + (present() ? value_of(*node_) : "missing") + ", expected " + std::string(expected),
                  path_);
}

}  // namespace mixed_order_game
