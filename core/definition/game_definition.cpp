// Reads a game definition: every entry of the file is checked here, once, and trusted from here on.
#include <algorithm>
#include <limits>
#include <set>

#include "definition/expression_reader.hpp"
#include "definition/toml_reader.hpp"
#include "equilibrium/equilibrium.hpp"
#include "errors.hpp"
#include "families/expression_disturbance.hpp"
#include "families/expression_dynamics.hpp"
#include "families/polynomial_dynamics.hpp"
#include "families/quadratic_cost.hpp"
#include "families/sinusoidal_disturbance.hpp"
#include "game/game_expressions.hpp"
#include "newton/block_elimination.hpp"

namespace mixed_order_game {

namespace {

constexpr int most_players = 1000;
constexpr int most_coordinates = 100;
constexpr std::size_t most_neurons = 10'000;
constexpr std::int64_t most_states = 20'000'000;
constexpr std::int64_t most_exposed = 20'000;  // variables that are exposed without being asked for

Shape read_shape(const TomlEntry& game) {
  Shape shape;
  shape.dimension = game["dimension"].integer(1, most_coordinates);

  const TomlEntry players = game["player"];
  const std::string some_players = "2 to " + std::to_string(most_players) + " tables [[player]]";
  const std::size_t player_count = players.length(some_players);
  if (player_count < 2 || player_count > at(most_players)) players.fail(some_players);
  shape.players = static_cast<int>(player_count);

  const TomlEntry centers = game["rbf"]["centers"];
  const std::string some_centers = "a list of 1 to " + std::to_string(most_neurons) + " centers";
  const std::size_t neuron_count = centers.length(some_centers);
  if (neuron_count < 1 || neuron_count > most_neurons) centers.fail(some_centers);
  shape.neurons = static_cast<int>(neuron_count);

  const std::int64_t N = shape.players;
  const std::int64_t states = (2 + N + shape.neurons) * N * shape.dimension;
  if (states > most_states) {
    throw GameError("the game of " + std::to_string(N) + " players, dimension " + std::to_string(shape.dimension) +
                    " and " + std::to_string(shape.neurons) + " centers has " + std::to_string(states) +
                    " states, expected at most " + std::to_string(most_states));
  }
  return shape;
}

void accept_gains(const TomlEntry& gains) {
  std::vector<std::string_view> keys;
  for (const GainDeclaration& gain : declared_gains) keys.emplace_back(gain.name);
  gains.accept_keys(keys);
}

Real read_gain(const TomlEntry& entry, const GainDeclaration& gain) {
  return gain.may_be_zero ? entry.non_negative() : entry.positive();
}

// Those of the game, for all players.
Gains read_gains(const TomlEntry& table, int players) {
  accept_gains(table);
  Gains gains;
  for (std::size_t k = 0; k < declared_gains.size(); ++k) {
    (gains.*Gains::members()[k]).assign(at(players), read_gain(table[declared_gains[k].name], declared_gains[k]));
  }
  return gains;
}

Strategy read_strategy(const TomlEntry& strategy) {
  strategy.accept_keys({"robust", "perturbed"});
  Strategy read;
  if (strategy["robust"].present()) read.robust = strategy["robust"].boolean();
  if (strategy["perturbed"].present()) read.perturbed = strategy["perturbed"].boolean();
  return read;
}

std::string groups(const std::vector<std::vector<int>>& components) {
  constexpr std::size_t longest = 200;
  std::string text;
  for (const std::vector<int>& component : components) {
    text += text.empty() ? "{" : ", {";
    for (std::size_t k = 0; k < component.size(); ++k) text += (k == 0 ? "" : ", ") + std::to_string(component[k] + 1);
    text += '}';
    if (text.size() > longest) return text.substr(0, text.rfind(',', longest)) + ", ...";
  }
  return text;
}

CommunicationGraph read_graph(const TomlEntry& table, const Shape& shape) {
  table.accept_keys({"edges", "directed"});
  const bool directed = table["directed"].present() && table["directed"].boolean();
  const int players = shape.players;
  CommunicationGraph graph(shape, directed);
  const TomlEntry edges = table["edges"];
  const std::string expected = directed ? "[from, to] or [from, to, weight]" : "[i, j] or [i, j, weight]";
  const std::size_t count = edges.length("a list of edges " + expected);
  for (std::size_t k = 0; k < count; ++k) {
    const TomlEntry edge = edges.item(k);
    const std::size_t length = edge.length("an edge " + expected);
    if (length != 2 && length != 3) edge.fail("an edge " + expected);
    const int from = edge.item(0).integer(1, players) - 1;
    const int to = edge.item(1).integer(1, players) - 1;
    if (from == to) edge.fail("an edge between two different players");
    if (shape.host_number(to) < 0 && (directed || shape.host_number(from) < 0)) {
      edge.fail("an edge of a player that is not elsewhere");
    }
    if (graph.weight(to, from) != 0.0)
      edge.fail(directed ? "each edge once" : "each edge once, in one of its directions");
    graph.set_weight(to, from, length == 3 ? edge.item(2).positive() : 1.0);
  }
  graph.refresh();
  const auto apart = shape.hosts_all() ? graph.not_reached() : std::nullopt;
  if (apart && directed) {
    throw GameError(edges.path() + " lets nothing of player " + std::to_string(apart->first + 1) + " reach player " +
                        std::to_string(apart->second + 1) + ", expected a strongly connected graph",
                    edges.path());
  }
  if (apart) {
    const auto components = graph.components();
    throw GameError(
        edges.path() + " leaves the players in separate groups " + groups(components) + ", expected a connected graph",
        edges.path());
  }
  require_moderate_factors(graph);
  return graph;
}

// Pairs [j, value], each j once, as for cost coupling and dynamics; read(j, value) takes them.
template <typename Read>
void read_pairs(const TomlEntry& list, int players, std::string_view pair, Read read) {
  if (!list.present()) return;
  const std::size_t count = list.length("a list of pairs " + std::string(pair));
  std::vector<bool> seen(at(players), false);
  for (std::size_t k = 0; k < count; ++k) {
    const TomlEntry entry = list.item(k);
    const std::string expected = "a pair " + std::string(pair);
    if (entry.length(expected) != 2) entry.fail(expected);
    const int j = entry.item(0).integer(1, players) - 1;
    if (seen[at(j)]) entry.fail("each player once, and player " + std::to_string(j + 1) + " comes twice");
    seen[at(j)] = true;
    read(j, entry.item(1));
  }
}

// Sets every coefficient of a family that the player's table has a key for.
void read_coefficients(const TomlEntry& table, int i, const Shape& shape, Coefficients& coefficients) {
  std::vector<std::string_view> keys{"expression"};
  for (const Coefficient& declared : coefficients.declared()) {
    if (declared.key != nullptr) keys.emplace_back(declared.key);
  }
  table.accept_keys(keys);
  for (int number = 0; number < static_cast<int>(coefficients.declared().size()); ++number) {
    const Coefficient& declared = coefficients.declared()[at(number)];
    if (declared.key == nullptr) continue;
    const TomlEntry entry = table[declared.key];
    std::vector<Real> values(at(shape.dimension));
    const std::string pair = std::string("[j, ") + (declared.symbol == nullptr ? "" : declared.symbol) + "]";
    switch (declared.indices) {
      case Indices::player:
        coefficients.set(number, i, entry.number_or(0.0));
        break;
      case Indices::entry:
        entry.numbers_if_present(shape.dimension, 1, values.data());
        for (int l = 0; l < shape.dimension; ++l) coefficients.set(number, shape.entry(i, l), values[at(l)]);
        break;
      case Indices::pair:
        read_pairs(entry, shape.players, pair, [&](int j, const TomlEntry& value) {
          if (j == i)
            value.fail("no " + std::string(declared.key) + " of player " + std::to_string(i + 1) + " with itself");
          coefficients.set(number, i * shape.players + j, value.number());
        });
        break;
      case Indices::term:
        read_pairs(entry, shape.players, pair, [&](int j, const TomlEntry& value) {
          value.numbers(shape.dimension, 1, values.data());
          for (int l = 0; l < shape.dimension; ++l) {
            if (values[at(l)] != 0.0) coefficients.set(number, shape.entry(i, l) * shape.players + j, values[at(l)]);
          }
        });
        break;
    }
  }
}

constexpr std::string_view player_keys[] = {"name", "order", "gains", "rbf",  "x0",       "z0",          "v0",
                                            "y0",   "W0",    "plant", "cost", "dynamics", "disturbance", "u_max"};

bool is_elsewhere(const TomlEntry& player) { return player["elsewhere"].present() && player["elsewhere"].boolean(); }

/// A player's own table before the defaults, key by key.
class PlayerTable {
 public:
  PlayerTable(const TomlEntry& own, const TomlEntry& defaults) : own_(own), defaults_(defaults) {}

  TomlEntry operator[](std::string_view key) const {
    const TomlEntry own = own_[key];
    return own.present() || !defaults_[key].present() ? own : defaults_[key];
  }
  /// Whether the player itself has the key.
  bool has_own(std::string_view key) const { return own_[key].present(); }

 private:
  TomlEntry own_;
  TomlEntry defaults_;
};

/// The q centers of one network: numbers, or rows of N D entries in the order of a joint action.
struct Centers {
  bool diagonal = true;
  std::vector<Real> numbers;
};

Centers read_centers(const TomlEntry& centers, const Shape& shape) {
  Centers read;
  read.diagonal = !centers.item(0).is_list();
  const int n = shape.actions();
  read.numbers.resize(at(shape.neurons) * at(read.diagonal ? 1 : n));
  for (int m = 0; m < shape.neurons; ++m) {
    const TomlEntry center = centers.item(at(m));
    if (read.diagonal) {
      read.numbers[at(m)] = center.number();
      continue;
    }
    const std::string expected =
        "a list of " + std::to_string(n) + " numbers, player by player, as the first center is a list";
    if (center.length(expected) != at(n)) center.fail(expected);
    for (int j = 0; j < shape.players; ++j) {
      for (int l = 0; l < shape.dimension; ++l) {
        read.numbers[at(m * n + shape.entry(j, l))] = center.item(at(j * shape.dimension + l)).number();
      }
    }
  }
  return read;
}

// Each player's network: what its own table states, and otherwise what the game's does.
RbfNetwork read_networks(const TomlEntry& rbf, const std::vector<PlayerTable>& players, const Shape& shape) {
  const std::size_t q = at(shape.neurons);
  const std::size_t n = at(shape.actions());
  const Centers common = read_centers(rbf["centers"], shape);
  RbfNetwork network;
  network.width.assign(players.size(), rbf["width"].positive());
  network.W_max.assign(players.size(), rbf["W_max"].positive());
  std::vector<Centers> centers(players.size());  // those of their own
  for (std::size_t i = 0; i < players.size(); ++i) {
    const TomlEntry own = players[i]["rbf"];
    own.accept_keys({"centers", "width", "W_max"});
    if (own["width"].present()) network.width[i] = own["width"].positive();
    if (own["W_max"].present()) network.W_max[i] = own["W_max"].positive();
    if (own["centers"].present()) {
      const std::string expected = "a list of " + std::to_string(q) + " centers, as rbf.centers is";
      if (own["centers"].length(expected) != q) own["centers"].fail(expected);
      centers[i] = read_centers(own["centers"], shape);
    }
    network.per_player = network.per_player || !own.keys("a table").empty();
    network.diagonal = network.diagonal && centers[i].diagonal;
  }
  network.diagonal = network.diagonal && common.diagonal;
  if (!network.diagonal && !network.per_player) {
    network.centers = common.numbers;
    return network;
  }
  if (!network.diagonal && q * players.size() * n > at(most_states)) {
    rbf["centers"].fail("at most " + std::to_string(most_states) +
                        " numbers in the centers of all players, which are " + std::to_string(q) + " vectors of " +
                        std::to_string(n) + " numbers for each");
  }
  for (std::size_t m = 0; m < q; ++m) {
    for (const Centers& stated : centers) {
      const Centers& own = stated.numbers.empty() ? common : stated;
      if (network.diagonal) {
        network.centers.push_back(own.numbers[m]);
      } else {
        for (std::size_t k = 0; k < n; ++k) network.centers.push_back(own.numbers[own.diagonal ? m : m * n + k]);
      }
    }
  }
  return network;
}

// q numbers, each for every coordinate, or q rows of D numbers.
void read_weights(const TomlEntry& W0, int i, const Shape& shape, InitialState& initial) {
  if (!W0.present()) return;
  const std::string expected = "a list of " + std::to_string(shape.neurons) + " numbers or of as many lists of " +
                               std::to_string(shape.dimension) + " numbers";
  if (W0.length(expected) != at(shape.neurons)) W0.fail(expected);
  initial.W.resize(at(shape.neurons) * at(shape.actions()));
  for (int m = 0; m < shape.neurons; ++m) {
    W0.item(at(m)).numbers(shape.dimension, shape.players, &initial.W[at(m * shape.actions() + i)]);
  }
}

// One number or D, for the coordinates.
void read_bound(const TomlEntry& bound, int i, const Shape& shape, std::vector<Real>& u_max) {
  if (!bound.present()) return;
  u_max.resize(at(shape.actions()), std::numeric_limits<Real>::infinity());
  bound.numbers(shape.dimension, shape.players, &u_max[at(i)]);
  for (int l = 0; l < shape.dimension; ++l) {
    if (!(u_max[at(shape.entry(i, l))] > 0.0))
      bound.fail("positive numbers, or no u_max where the control is not bounded");
  }
}

bool is_x0(const TomlEntry& entry) {
  if (!entry.is_text()) return false;
  if (entry.text() != "x0") entry.fail("numbers, or \"x0\" for the initial actions");
  return true;
}

/// Which players are hosted, the order of each, and whose plants are outside.
void read_players(const TomlEntry& tables, const TomlEntry& defaults, Shape& shape) {
  std::vector<int> hosted;
  std::vector<std::uint8_t> external(at(shape.players));
  for (int i = 0; i < shape.players; ++i) {
    const TomlEntry own = tables.item(at(i));
    const PlayerTable player(own, defaults);
    if (is_elsewhere(own)) {
      own.accept_keys({"elsewhere", "order"});
    } else {
      std::vector<std::string_view> keys(std::begin(player_keys), std::end(player_keys));
      keys.emplace_back("elsewhere");
      own.accept_keys(keys);
      hosted.push_back(i);
      if (const TomlEntry plant = player["plant"]; plant.present()) {
        if (plant.text() != "external") plant.fail("\"external\", or no plant for one inside the loop");
        external[at(i)] = 1;
      }
    }
    shape.order.push_back(player["order"].integer(1, 2));
  }
  if (hosted.empty()) tables.fail("a player that is not elsewhere");
  if (hosted.size() != at(shape.players)) shape.hosted = std::move(hosted);
  if (std::find(external.begin(), external.end(), 1) != external.end()) shape.external = std::move(external);
}

/// What belongs to a plant, of a player whose plant is outside; keys that only the defaults have are for the others.
void refuse_plant(const PlayerTable& player, int i) {
  for (const std::string_view key : {"x0", "v0", "dynamics", "disturbance", "u_max"}) {
    if (player.has_own(key)) {
      player[key].fail("no " + std::string(key) + " of player " + std::to_string(i + 1) + ", whose plant is external");
    }
  }
}

void read_actions(const PlayerTable& player, int i, const Shape& shape, InitialState& initial) {
  const bool second = shape.is_second_order(i);
  if (!shape.has_plant(i)) {
    if (second && player.has_own("z0")) player["z0"].fail("no z0 for a player of order 2");
    if (second) return;
    if (player["z0"].is_text()) player["z0"].fail("numbers, as the plant is external");
    player["z0"].numbers_if_present(shape.dimension, shape.players, &initial.reference[at(i)]);
    return;
  }
  player["x0"].numbers(shape.dimension, shape.players, &initial.x[at(i)]);
  // a default for players of the other order is none for this one
  if (second && player.has_own("z0")) player["z0"].fail("no z0 for a player of order 2, which has v0");
  if (!second && player.has_own("v0")) player["v0"].fail("no v0 for a player of order 1, which has z0");
  const TomlEntry reference = player[second ? "v0" : "z0"];
  if (!second && is_x0(reference)) {
    for (int l = 0; l < shape.dimension; ++l) {
      initial.reference[at(shape.entry(i, l))] = initial.x[at(shape.entry(i, l))];
    }
  } else {
    reference.numbers_if_present(shape.dimension, shape.players, &initial.reference[at(i)]);
  }
}

// After the actions of all players: estimates may begin there.
void read_estimates(const TomlEntry& y0, int h, const Shape& shape, InitialState& initial) {
  Real* estimates = &initial.y[at(h) * at(shape.actions())];
  if (is_x0(y0)) {
    for (int j = 0; j < shape.players; ++j) {
      if (!shape.has_plant(j)) y0.fail("numbers, as x0 of player " + std::to_string(j + 1) + " is not known here");
    }
    std::copy(initial.x.begin(), initial.x.end(), estimates);
    return;
  }
  if (!y0.is_list()) {
    std::fill_n(estimates, shape.actions(), y0.number_or(0.0));
    return;
  }
  const std::string expected = "\"x0\", a list of " + std::to_string(shape.players) +
                               " estimates, one for each player, a list of " + std::to_string(shape.dimension) +
                               " numbers, or one number";
  const std::size_t length = y0.length(expected);
  if (length == at(shape.dimension) && shape.dimension > 1 && !y0.item(0).is_list()) {
    for (int j = 0; j < shape.players; ++j) y0.numbers(shape.dimension, shape.players, estimates + j);
    return;
  }
  if (length != at(shape.players)) y0.fail(expected);
  for (int j = 0; j < shape.players; ++j) y0.item(at(j)).numbers(shape.dimension, shape.players, estimates + j);
}

// Those that the player states of its own.
void read_own_gains(const PlayerTable& player, int i, const Shape& shape, Gains& gains) {
  const TomlEntry table = player["gains"];
  accept_gains(table);
  for (std::size_t k = 0; k < declared_gains.size(); ++k) {
    const GainDeclaration& gain = declared_gains[k];
    const TomlEntry entry = table[gain.name];
    if (!entry.present()) continue;
    if (gain.order != 0 && gain.order != shape.order[at(i)]) {
      // a default for players of the other order is none for this one
      if (!player.has_own("gains")) continue;
      entry.fail("no " + std::string(gain.name) + " of a player of order " + std::to_string(shape.order[at(i)]) +
                 ", which has " + (gain.order == 1 ? "k4" : "k1"));
    }
    (gains.*Gains::members()[k])[at(i)] = read_gain(entry, gain);
    gains.per_player = true;
  }
}

// Where the search for the equilibrium begins.
std::vector<Real> read_guess(const TomlEntry& table, const Shape& shape, const InitialState& initial) {
  table.accept_keys({"guess"});
  std::vector<Real> guess = initial.x;
  const TomlEntry list = table["guess"];
  if (!list.present()) return guess;
  if (!shape.hosts_all()) list.fail("no guess of an equilibrium where players are elsewhere");
  const std::string expected = "a list of " + std::to_string(shape.players) + " actions, one for each player";
  if (list.length(expected) != at(shape.players)) list.fail(expected);
  for (int i = 0; i < shape.players; ++i) list.item(at(i)).numbers(shape.dimension, shape.players, &guess[at(i)]);
  return guess;
}

// Number of variables when everything is exposed.
std::int64_t variable_count(const Parameters& parameters) {
  const Shape& shape = parameters.shape;
  const std::int64_t N = shape.players;
  const std::int64_t H = shape.hosts();
  const std::int64_t D = shape.dimension;
  const std::int64_t q = shape.neurons;
  const std::int64_t gains = parameters.gains.per_player ? 6 * H : 7;  // k1 or k4, k2, k3, beta, delta, epsilon
  const std::int64_t networks = parameters.rbf.per_player ? H : 1;
  const std::int64_t network = networks * (2 + (parameters.rbf.diagonal ? q : 0));  // W_max, rho, center
  const std::int64_t edges = H * (N - 1) / (parameters.graph.directed() ? 1 : 2);
  const std::int64_t graph_and_cost = edges + H + H * D + H * (N - 1);
  const std::int64_t dynamics_and_disturbance = H + 4 * H * D;
  const std::int64_t switches = 3;  // robust, perturbed, allow_disconnected
  const std::int64_t W0 = static_cast<std::int64_t>(parameters.initial.W.size());
  const std::int64_t initial_state = 2 * H * D + H * N * D + W0;  // x0, z0 or v0, y0
  const std::int64_t tolerances = 2;
  const std::int64_t bounds = static_cast<std::int64_t>(parameters.bounded().size());
  const std::int64_t states = (2 + N + q) * H * D;         // x, z or v, y, W
  const std::int64_t signals = 6 * H * D + H;              // d_ext, u, x_star, W_norm2, phi, nn, cost
  const std::int64_t measures = 3 + 3 + H;                 // errors and gradient, solver work, order
  const std::int64_t from_others = (N - H) * (N + 3) * D;  // y, xbar, x and v
  return gains + network + graph_and_cost + dynamics_and_disturbance + switches + initial_state + tolerances + bounds +
         states + signals + measures + from_others;
}

Expose read_expose(const TomlEntry& expose, const Parameters& parameters) {
  if (!expose.present()) return variable_count(parameters) <= most_exposed ? Expose::all : Expose::outputs;
  const std::string text = expose.text();
  if (text != "all" && text != "outputs") expose.fail("\"all\" or \"outputs\"");
  return text == "all" ? Expose::all : Expose::outputs;
}

std::vector<std::string> read_names(const TomlEntry& players, const Shape& shape) {
  std::vector<std::string> names;
  std::set<std::string> seen;
  for (int i = 0; i < shape.players; ++i) {
    if (shape.host_number(i) < 0) {
      names.emplace_back();
      continue;
    }
    const TomlEntry name = players.item(at(i))["name"];
    names.push_back(name.text());
    if (names.back().empty()) name.fail("a name that is not empty");
    if (!seen.insert(names.back()).second) name.fail("a name that no other player has");
  }
  return names;
}

bool has_any(const std::vector<ExpressionCost::Text>& texts) {
  return std::any_of(texts.begin(), texts.end(), [](const auto& text) { return text.graph != nullptr; });
}

/// The family of the coefficients alone, or the one with expressions, where there are any.
template <typename Interface, typename WithExpressions, typename Coefficients, typename... Expressions>
Cloned<Interface> family_of(Coefficients coefficients, bool has_expressions, const Expressions&... expressions) {
  if (has_expressions) {
    return Cloned<Interface>(std::make_unique<WithExpressions>(std::move(coefficients), expressions...));
  }
  return Cloned<Interface>(std::make_unique<Coefficients>(std::move(coefficients)));
}

}  // namespace

Game parse_game(std::string_view toml) {
  GameExpressions expressions;
  return parse_game(toml, expressions);
}

Game parse_game(std::string_view toml, GameExpressions& texts) {
  const toml::table document = parse_toml(toml);
  const TomlEntry game(document);
  game.accept_keys({"title", "dimension", "expose", "strategy", "gains", "rbf", "graph", "parameters", "defaults",
                    "equilibrium", "player"});
  const std::string title = game["title"].text();
  const TomlEntry rbf = game["rbf"];
  rbf.accept_keys({"centers", "width", "W_max"});
  Shape shape = read_shape(game);
  const int n = shape.actions();

  const TomlEntry tables = game["player"];
  const TomlEntry defaults = game["defaults"];
  defaults.accept_keys(std::span(player_keys).subspan(1));  // a name is a player's own
  read_players(tables, defaults, shape);
  std::vector<PlayerTable> players;
  for (int i = 0; i < shape.players; ++i) players.emplace_back(tables.item(at(i)), defaults);
  const std::vector<std::string> names = read_names(tables, shape);

  NamedParameters named = read_named_parameters(game["parameters"]);
  const ExpressionReader expressions(toml, shape, named);
  QuadraticCost cost(shape);
  PolynomialDynamics dynamics(shape);
  SinusoidalDisturbance disturbance(shape);
  std::vector<ExpressionCost::Text>& costs = texts.costs;
  costs.clear();
  texts.dynamics.assign(at(shape.own_entries()), {});
  texts.disturbances = texts.dynamics;
  const PlayerExpressions none(shape.own_entries(), shape.hosts(), n, static_cast<int>(named.values.size()));
  PlayerExpressions dynamics_values = none;
  PlayerExpressions disturbance_values = none;
  Gains gains = read_gains(game["gains"], shape.players);
  std::vector<Real> u_max;
  std::vector<Switching::OfPlayer> dynamics_graphs;
  std::vector<Switching::OfPlayer> disturbance_graphs;
  InitialState initial{.x = std::vector<Real>(at(n)),
                       .reference = std::vector<Real>(at(n)),
                       .y = std::vector<Real>(at(shape.hosts()) * at(n))};
  for (int h = 0; h < shape.hosts(); ++h) {
    const int i = shape.host(h);
    const PlayerTable& player = players[at(i)];
    read_own_gains(player, i, shape, gains);
    read_actions(player, i, shape, initial);
    read_coefficients(player["cost"], i, shape, cost.coefficients);
    costs.push_back(expressions.cost(player["cost"]["expression"], i));
    if (!shape.has_plant(i)) {
      refuse_plant(player, i);
      continue;
    }
    read_bound(player["u_max"], i, shape, u_max);
    read_coefficients(player["dynamics"], i, shape, dynamics.coefficients);
    read_coefficients(player["disturbance"], i, shape, disturbance.coefficients);
    expressions.add_coordinates(player["dynamics"]["expression"], Purpose::dynamics, i, dynamics_values,
                                dynamics_graphs, texts.dynamics);
    expressions.add_coordinates(player["disturbance"]["expression"], Purpose::disturbance, i, disturbance_values,
                                disturbance_graphs, texts.disturbances);
  }
  for (int h = 0; h < shape.hosts(); ++h) {
    const PlayerTable& player = players[at(shape.host(h))];
    read_estimates(player["y0"], h, shape, initial);
    read_weights(player["W0"], shape.host(h), shape, initial);
  }
  const auto switching = [&](const std::vector<Switching::OfPlayer>& graphs, const char* of) {
    return Switching(graphs, of, shape.hosts(), n, static_cast<int>(named.values.size()));
  };
  Switching dynamics_switching = switching(dynamics_graphs, "dynamics");
  Switching disturbance_switching = switching(disturbance_graphs, "disturbance");
  dynamics_values.compile();
  disturbance_values.compile();
  cost.coefficients.named = dynamics.coefficients.named = disturbance.coefficients.named = named.values;
  dynamics.refresh();

  Game read{.title = title,
            .expose = Expose::all,
            .player_names = names,
            .parameters = {
                .shape = shape,
                .gains = std::move(gains),
                .strategy = read_strategy(game["strategy"]),
                .rbf = read_networks(rbf, players, shape),
                .graph = read_graph(game["graph"], shape),
                .cost = family_of<Cost, ExpressionCost>(std::move(cost), has_any(costs), shape, costs),
                .dynamics = family_of<UnknownDynamics, ExpressionDynamics>(
                    std::move(dynamics), !dynamics_values.empty(), dynamics_values, dynamics_switching),
                .disturbance = family_of<Disturbance, ExpressionDisturbance>(
                    std::move(disturbance), !disturbance_values.empty(), disturbance_values, disturbance_switching),
                .initial = std::move(initial),
                .named = std::move(named),
                .u_max = std::move(u_max)}};
  read.parameters.guess = read_guess(game["equilibrium"], shape, read.parameters.initial);
  read.expose = read_expose(game["expose"], read.parameters);
  read.parameters.refresh();
  require_bounded_weights(read.parameters);
  read.parameters.judge_switching();
  if (shape.hosts_all()) {
    nash_equilibrium(*read.parameters.cost, shape, read.parameters.guess);  // throws when it is not unique
  }
  return read;
}

}  // namespace mixed_order_game
