#include "game_check.hpp"

#include <map>
#include <utility>

#include "definition/toml_reader.hpp"
#include "json_text.hpp"

namespace mixed_order_game {

namespace {

using Position = std::pair<std::size_t, std::size_t>;  // line, column
using Places = std::map<std::string, Position>;

Position begin_of(const toml::source_region& source) { return {source.begin.line, source.begin.column}; }

void note_entries(const toml::node& node, const std::string& path, Places& places) {
  if (const auto* table = node.as_table()) {
    for (const auto& [key, value] : *table) {
      const std::string entry = path.empty() ? std::string(key.str()) : path + '.' + std::string(key.str());
      places[entry] = begin_of(key.source());
      note_entries(value, entry, places);
    }
  } else if (const auto* list = node.as_array()) {
    for (std::size_t k = 0; k < list->size(); ++k) {
      const std::string entry = path + '[' + std::to_string(k + 1) + ']';
      places[entry] = begin_of(list->get(k)->source());
      note_entries(*list->get(k), entry, places);
    }
  }
}

Places places_of(std::string_view text) {
  Places places;
  try {
    note_entries(parse_toml(text), "", places);
  } catch (const GameError&) {  // that is the problem, then
  }
  return places;
}

Position place_of(const GameError& error, const Places& places) {
  if (error.line() != 0) return {error.line(), error.column()};
  std::string entry = error.entry();
  while (!entry.empty()) {
    if (const auto found = places.find(entry); found != places.end()) return found->second;
    const std::size_t end = entry.find_last_of(".[");
    entry.resize(end == std::string::npos ? 0 : end);
  }
  return {1, 1};
}

std::string pair_of(const Position& position) {
  return '[' + std::to_string(position.first) + ", " + std::to_string(position.second) + ']';
}

}  // namespace

std::string checked_game(std::string_view text, const GameError* error) {
  if (error == nullptr) return "{\"problem\": null}\n";
  const Places places = places_of(text);
  const auto [line, column] = place_of(*error, places);
  std::string answer = "{\"problem\": {\"message\": " + json_string(error->sentence()) +
                       ", \"entry\": " + json_string(error->entry()) + ", \"line\": " + std::to_string(line) +
                       ", \"column\": " + std::to_string(column) + "},\n\"places\": {";
  const char* separator = "\n";
  for (const auto& [entry, position] : places) {
    answer += separator + json_string(entry) + ": " + pair_of(position);
    separator = ",\n";
  }
  return answer + "}}\n";
}

}  // namespace mixed_order_game
