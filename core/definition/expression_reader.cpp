#include "definition/expression_reader.hpp"

#include <algorithm>
#include <cmath>

#include "errors.hpp"
#include "number_text.hpp"

namespace mixed_order_game {

namespace {

constexpr std::size_t most_nodes = 2'000'000;  // of one player
constexpr std::size_t most_values = 100'000;   // of all named parameters
constexpr std::size_t longest_name = 64;

void read_name(const TomlEntry& entry, const std::string& name) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
  const auto is_other = [&](char c) { return is_letter(c) || (c >= '0' && c <= '9'); };
  if (name.empty() || name.size() > longest_name || !is_letter(name[0]) ||
      !std::all_of(name.begin(), name.end(), is_other)) {
    entry.fail("a name of letters, digits and _ that begins with a letter, at most " + std::to_string(longest_name) +
               " characters long");
  }
  if (is_reserved_name(name)) entry.fail("a name that expressions do not use themselves");
}

void read_values(const TomlEntry& entry, NamedParameter& parameter, std::vector<Real>& values) {
  constexpr std::string_view expected = "a number, a list of numbers or a matrix as a list of rows of equal length";
  if (!entry.is_list()) {
    values.push_back(entry.number());
    return;
  }
  const std::size_t rows = entry.length(expected);
  if (rows == 0) entry.fail(expected);
  const bool is_matrix = entry.item(0).is_list();
  const std::size_t columns = is_matrix ? entry.item(0).length(expected) : 1;
  if (columns == 0 || rows > most_values || columns > most_values || values.size() + rows * columns > most_values) {
    entry.fail(columns == 0 ? std::string(expected)
                            : "at most " + std::to_string(most_values) + " values of all parameters together");
  }
  for (std::size_t row = 0; row < rows; ++row) {
    const TomlEntry item = entry.item(row);
    if (item.is_list() != is_matrix || (is_matrix && item.length(expected) != columns)) item.fail(expected);
    for (std::size_t column = 0; column < columns; ++column) {
      values.push_back(is_matrix ? item.item(column).number() : item.number());
    }
  }
  parameter.size.push_back(static_cast<int>(rows));
  if (is_matrix) parameter.size.push_back(static_cast<int>(columns));
}

}  // namespace

NamedParameters read_named_parameters(const TomlEntry& table) {
  NamedParameters named;
  for (const std::string& name : table.keys("a table of named parameters")) {
    const TomlEntry entry = table[name];
    read_name(entry, name);
    NamedParameter parameter{.name = name, .first = static_cast<int>(named.values.size())};
    if (entry.is_table()) {
      entry.accept_keys({"value", "min", "max", "unit", "description", "fixed"});
      read_values(entry["value"], parameter, named.values);
      if (entry["min"].present()) parameter.min = entry["min"].number();
      if (entry["max"].present()) parameter.max = entry["max"].number();
      if (parameter.min > parameter.max) entry["max"].fail("at least min");
      if (entry["unit"].present()) parameter.unit = entry["unit"].text();
      if (entry["description"].present()) parameter.description = entry["description"].text();
      if (entry["fixed"].present()) parameter.fixed = entry["fixed"].boolean();
    } else {
      read_values(entry, parameter, named.values);
    }
    for (std::size_t k = at(parameter.first); k < named.values.size(); ++k) {
      if (named.values[k] < parameter.min || named.values[k] > parameter.max) {
        entry["value"].fail("values from " + text_of(parameter.min) + " to " + text_of(parameter.max));
      }
    }
    named.declared.push_back(std::move(parameter));
  }
  return named;
}

void ExpressionReader::unroll_into(const TomlEntry& entry, const Place& place, ExpressionGraph& graph,
                                   int& node) const {
  const std::string text = entry.multi_line_text();
  try {
    node = unroll(parse_expression(text), place, graph);
  } catch (const ExpressionError& error) {
    const auto [line, column] = entry.place_of(document_, error.position);
    throw GameError(
        entry.path() + ", line " + std::to_string(line) + ", column " + std::to_string(column) + ": " + error.what(),
        entry.path() + ": " + error.what(), entry.path(), line, column);
  }
}

ExpressionCost::Text ExpressionReader::cost(const TomlEntry& entry, int i) const {
  if (!entry.present()) return {};
  ExpressionCost::Text text{std::make_shared<ExpressionGraph>(most_nodes, cost_switches_), 0};
  const Place place{
      .shape = &shape_, .parameters = &parameters_, .purpose = Purpose::cost, .player = i, .coordinate = -1};
  unroll_into(entry, place, *text.graph, text.node);
  cost_switches_ += static_cast<int>(text.graph->switches().size());
  return text;
}

void ExpressionReader::add_coordinates(const TomlEntry& entry, Purpose purpose, int i, PlayerExpressions& values,
                                       std::vector<Switching::OfPlayer>& graphs,
                                       std::vector<ExpressionCost::Text>& texts) const {
  if (!entry.present()) return;
  const std::string expected = "a text, or a list of " + std::to_string(shape_.dimension) + " texts";
  const bool is_list = entry.is_list();
  if (is_list && entry.length(expected) != at(shape_.dimension)) entry.fail(expected);
  int switches = 0;
  for (const Switching::OfPlayer& other : graphs) switches += static_cast<int>(other.graph->switches().size());
  const auto graph = std::make_shared<ExpressionGraph>(most_nodes, switches);
  for (int l = 0; l < shape_.dimension; ++l) {
    const Place place{.shape = &shape_, .parameters = &parameters_, .purpose = purpose, .player = i, .coordinate = l};
    int node = 0;
    unroll_into(is_list ? entry.item(at(l)) : entry, place, *graph, node);
    const int slot = shape_.own_entry(shape_.host_number(i), l);
    values.add(slot, shape_.host_number(i), graph, node);
    texts[at(slot)] = {graph, node};
  }
  graphs.push_back({shape_.host_number(i), i, graph});
}

}  // namespace mixed_order_game
