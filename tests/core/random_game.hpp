// Games for tests: their numbers in plain nested lists with the paper's indices, random ones from fixed seeds, and
// their definition as TOML text. Nothing here uses the core's own order of entries.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace mixed_order_game::testing {

using Numbers = std::vector<double>;
using Rows = std::vector<Numbers>;
using Blocks = std::vector<Rows>;

inline Rows rows_of(std::size_t count, std::size_t length) { return Rows(count, Numbers(length, 0.0)); }
inline Blocks blocks_of(std::size_t count, std::size_t rows, std::size_t length) {
  return Blocks(count, rows_of(rows, length));
}

/// The same numbers on every machine, unlike the standard library's distributions.
class RandomNumbers {
 public:
  explicit RandomNumbers(std::uint64_t seed) : engine_(seed) {}

  double between(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11U) * 0x1p-53);
  }
  /// 0 .. count - 1
  std::size_t below(std::size_t count) { return static_cast<std::size_t>(engine_() % count); }
  bool chance(double probability) { return between(0.0, 1.0) < probability; }
  void fill(Numbers& numbers, double low, double high) {
    for (double& number : numbers) number = between(low, high);
  }
  void fill(Rows& rows, double low, double high) {
    for (Numbers& row : rows) fill(row, low, high);
  }
  void fill(Blocks& blocks, double low, double high) {
    for (Rows& rows : blocks) fill(rows, low, high);
  }

 private:
  std::mt19937_64 engine_;
};

/// Every number of a game; i, j count players, l coordinates, m neurons, all from zero.
struct PlainGame {
  std::size_t players = 0;
  std::size_t dimension = 0;
  std::size_t neurons = 0;
  std::vector<int> order;
  bool robust = true;
  bool perturbed = true;
  Numbers k1, k2, k3, k4, beta, delta, epsilon;  ///< [i]
  bool own_gains = false;                        ///< stated by each player for itself
  bool diagonal = true;                          ///< centers are numbers
  Blocks centers;                                ///< [i][m][0], or [i][m][j D + l]
  Numbers width, W_max;                          ///< [i]
  bool own_rbf = false;                          ///< stated by each player for itself
  Blocks W0;                                     ///< [i][m][l]; empty: zero
  bool directed = false;
  Rows adjacency;  ///< [i][j]
  Numbers quadratic, constant;
  Rows linear;    ///< [i][l]
  Rows coupling;  ///< [i][j]
  Blocks G, H;    ///< [i][j][l]
  Rows amplitude, frequency, phase, bias;
  Rows x0, reference0;  ///< [i][l]; reference0 is z0 or v0
  Blocks y0;            ///< [i][j][l]

  [[nodiscard]] double center(std::size_t i, std::size_t m, std::size_t j, std::size_t l) const {
    return diagonal ? centers[i][m][0] : centers[i][m][j * dimension + l];
  }
};

/// The same number for every player.
inline Numbers everyone(const PlainGame& game, double number) { return Numbers(game.players, number); }

struct Recipe {
  std::uint64_t seed = 1;
  std::size_t players = 3;
  std::size_t dimension = 2;
  std::size_t neurons = 5;
  bool diagonal = true;
  bool robust = true;
  bool perturbed = true;
  std::vector<int> order = {};  ///< drawn when empty
  bool own_gains = false;
  bool own_rbf = false;
  bool directed = false;
  bool initial_weights = false;
};

/// A connected random graph, strongly monotone costs, and nonlinearities of moderate slope.
inline PlainGame random_game(const Recipe& recipe) {
  RandomNumbers random(recipe.seed);
  const std::size_t N = recipe.players;
  const std::size_t D = recipe.dimension;
  PlainGame game;
  game.players = N;
  game.dimension = D;
  game.neurons = recipe.neurons;
  game.order = recipe.order;
  if (game.order.empty()) {
    for (std::size_t i = 0; i < N; ++i) game.order.push_back(random.chance(0.5) ? 1 : 2);
  }
  game.robust = recipe.robust;
  game.perturbed = recipe.perturbed;
  game.own_gains = recipe.own_gains;
  const auto draw = [&](double low, double high) {
    Numbers gains = everyone(game, random.between(low, high));
    if (game.own_gains) random.fill(gains, low, high);
    return gains;
  };
  game.k1 = draw(5.0, 12.0);
  game.k2 = draw(0.5, 1.5);
  game.k3 = draw(20.0, 60.0);
  game.k4 = draw(15.0, 40.0);
  game.beta = draw(20.0, 90.0);
  game.delta = draw(2.0, 8.0);
  game.epsilon = draw(0.5, 2.0);
  game.diagonal = recipe.diagonal;
  Rows centers = rows_of(recipe.neurons, recipe.diagonal ? 1 : N * D);
  random.fill(centers, -2.0, 2.0);
  game.centers = Blocks(N, centers);
  game.own_rbf = recipe.own_rbf;
  if (game.own_rbf) random.fill(game.centers, -2.0, 2.0);
  const auto draw_for_networks = [&](double low, double high) {
    Numbers numbers = everyone(game, random.between(low, high));
    if (game.own_rbf) random.fill(numbers, low, high);
    return numbers;
  };
  game.width = draw_for_networks(2.0, 6.0);
  game.W_max = draw_for_networks(10.0, 400.0);
  if (recipe.initial_weights) {
    game.W0 = blocks_of(N, recipe.neurons, D);
    random.fill(game.W0, -0.5, 0.5);
  }
  game.directed = recipe.directed;

  game.adjacency = rows_of(N, N);
  for (std::size_t i = 1; i < N; ++i) {
    const std::size_t j = random.below(i);
    game.adjacency[i][j] = game.adjacency[j][i] = random.between(0.3, 2.0);
  }
  if (game.directed) {  // a circle, so that everybody is reached, and further edges one way
    game.adjacency = rows_of(N, N);
    for (std::size_t i = 0; i < N; ++i) {
      game.adjacency[i][(i + 1) % N] = random.between(0.3, 2.0);
      if (random.chance(0.5) && N > 2) game.adjacency[i][(i + 2) % N] = random.between(0.3, 2.0);
    }
  }
  game.coupling = rows_of(N, N);
  game.G = blocks_of(N, N, D);
  game.H = blocks_of(N, N, D);
  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t j = 0; j < N; ++j) {
      if (!game.directed && j < i && game.adjacency[i][j] == 0.0 && random.chance(0.3)) {
        game.adjacency[i][j] = game.adjacency[j][i] = random.between(0.3, 2.0);
      }
      if (j != i && random.chance(0.5)) game.coupling[i][j] = random.between(0.1, 1.5);
      if (random.chance(0.5)) random.fill(game.G[i][j], -3.0, 3.0);
      if (random.chance(0.4)) random.fill(game.H[i][j], -0.5, 0.5);
    }
  }
  game.quadratic = Numbers(N);
  game.constant = Numbers(N);
  random.fill(game.quadratic, 1.0, 4.0);
  random.fill(game.constant, -5.0, 5.0);
  game.linear = game.amplitude = game.frequency = game.phase = game.bias = game.x0 = game.reference0 = rows_of(N, D);
  random.fill(game.linear, -3.0, 3.0);
  random.fill(game.amplitude, -4.0, 4.0);
  random.fill(game.frequency, 0.2, 5.0);
  random.fill(game.phase, -3.0, 3.0);
  random.fill(game.bias, -1.0, 1.0);
  random.fill(game.x0, -5.0, 5.0);
  random.fill(game.reference0, -2.0, 2.0);
  game.y0 = blocks_of(N, N, D);
  random.fill(game.y0, -3.0, 3.0);
  return game;
}

inline std::string toml_of(double number) {
  char digits[40];
  std::string text(digits, std::to_chars(digits, digits + sizeof digits, number).ptr);
  return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}
inline std::string toml_of(const Numbers& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : ", ") + toml_of(number);
  return '[' + text + ']';
}
inline std::string toml_of(const Rows& rows) {
  std::string text;
  for (const Numbers& row : rows) text += (text.empty() ? "" : ", ") + toml_of(row);
  return '[' + text + ']';
}

/// Which players of a game are elsewhere, and which of the others have plants outside.
struct Part {
  std::vector<std::size_t> elsewhere = {};
  std::vector<std::size_t> external = {};

  [[nodiscard]] bool is_elsewhere(std::size_t i) const { return std::ranges::count(elsewhere, i) != 0; }
  [[nodiscard]] bool is_external(std::size_t i) const { return std::ranges::count(external, i) != 0; }
};

/// The game definition; parse_game must read back exactly these numbers.
inline std::string toml_of(const PlainGame& game, const Part& part = {}) {
  const auto pairs_of = [](const Rows& rows) {  // [[j, row j], ...] of the rows that are not zero
    std::string text;
    for (std::size_t j = 0; j < rows.size(); ++j) {
      if (rows[j] == Numbers(rows[j].size(), 0.0)) continue;
      text += (text.empty() ? "[" : ", [") + std::to_string(j + 1) + ", " + toml_of(rows[j]) + ']';
    }
    return '[' + text + ']';
  };
  std::string text = "title = \"random game\"\ndimension = " + std::to_string(game.dimension) + '\n';
  text += std::string("[strategy]\nrobust = ") + (game.robust ? "true" : "false") +
          "\nperturbed = " + (game.perturbed ? "true" : "false") + '\n';
  const std::pair<const char*, const Numbers&> gains[] = {
      {"k1", game.k1},     {"k2", game.k2},       {"k3", game.k3},          {"k4", game.k4},
      {"beta", game.beta}, {"delta", game.delta}, {"epsilon", game.epsilon}};
  text += "[gains]\n";
  for (const auto& [name, values] : gains) text += name + (" = " + toml_of(values[0])) + '\n';
  const auto centers_of = [&](std::size_t i) {
    Numbers numbers;
    for (const Numbers& center : game.centers[i]) numbers.push_back(center[0]);
    return game.diagonal ? toml_of(numbers) : toml_of(game.centers[i]);
  };
  text += "[rbf]\ncenters = " + centers_of(0) + "\nwidth = " + toml_of(game.width[0]) +
          "\nW_max = " + toml_of(game.W_max[0]) + '\n';
  std::string edges;
  for (std::size_t i = 0; i < game.players; ++i) {
    for (std::size_t j = game.directed ? 0 : i + 1; j < game.players; ++j) {
      if (game.adjacency[j][i] == 0.0 || (part.is_elsewhere(j) && (game.directed || part.is_elsewhere(i)))) continue;
      edges += (edges.empty() ? "[" : ", [") + std::to_string(i + 1) + ", " + std::to_string(j + 1) + ", " +
               toml_of(game.adjacency[j][i]) + ']';
    }
  }
  text += std::string("[graph]\n") + (game.directed ? "directed = true\n" : "") + "edges = [" + edges + "]\n";
  for (std::size_t i = 0; i < game.players; ++i) {
    if (part.is_elsewhere(i)) {
      text += "[[player]]\nelsewhere = true\norder = " + std::to_string(game.order[i]) + '\n';
      continue;
    }
    const bool external = part.is_external(i);
    std::string coupling;
    for (std::size_t j = 0; j < game.players; ++j) {
      if (game.coupling[i][j] == 0.0) continue;
      coupling += (coupling.empty() ? "[" : ", [") + std::to_string(j + 1) + ", " + toml_of(game.coupling[i][j]) + ']';
    }
    std::string own_gains;
    for (const auto& [name, values] : gains) {
      if (!game.own_gains || name == std::string_view(game.order[i] == 1 ? "k4" : "k1")) continue;
      own_gains += (own_gains.empty() ? "\ngains = { " : ", ") + std::string(name) + " = " + toml_of(values[i]);
    }
    text += "[[player]]\nname = \"player " + std::to_string(i + 1) + "\"\norder = " + std::to_string(game.order[i]) +
            own_gains + (own_gains.empty() ? "" : " }") +
            (game.own_rbf ? "\nrbf = { centers = " + centers_of(i) + ", width = " + toml_of(game.width[i]) +
                                ", W_max = " + toml_of(game.W_max[i]) + " }"
                          : "") +
            (game.W0.empty() ? "" : "\nW0 = " + toml_of(game.W0[i])) + "\ny0 = " + toml_of(game.y0[i]) +
            "\ncost = { quadratic = " + toml_of(game.quadratic[i]) + ", linear = " + toml_of(game.linear[i]) +
            ", constant = " + toml_of(game.constant[i]) + ", coupling = [" + coupling + "] }\n";
    if (game.order[i] == 1) text += "z0 = " + toml_of(game.reference0[i]) + '\n';
    if (external) {
      text += "plant = \"external\"\n";
      continue;
    }
    if (game.order[i] == 2) text += "v0 = " + toml_of(game.reference0[i]) + '\n';
    text += "x0 = " + toml_of(game.x0[i]) + "\ndynamics = { linear = " + pairs_of(game.G[i]) +
            ", square = " + pairs_of(game.H[i]) + " }\ndisturbance = { amplitude = " + toml_of(game.amplitude[i]) +
            ", frequency = " + toml_of(game.frequency[i]) + ", phase = " + toml_of(game.phase[i]) +
            ", bias = " + toml_of(game.bias[i]) + " }\n";
  }
  return text;
}

/// Games of pairwise different sizes, with diagonal and general centres, all orders, and each part switched off.
inline std::vector<Recipe> assorted_recipes() {
  return {
      {.seed = 1, .players = 3, .dimension = 2, .neurons = 5},
      {.seed = 2, .players = 3, .dimension = 2, .neurons = 5, .diagonal = false},
      {.seed = 3, .players = 4, .dimension = 1, .neurons = 7, .order = {2, 1, 1, 2}},
      {.seed = 4, .players = 2, .dimension = 3, .neurons = 1, .order = {2, 1}},
      {.seed = 5, .players = 5, .dimension = 2, .neurons = 11, .diagonal = false, .order = {1, 1, 1, 2, 2}},
      {.seed = 6, .players = 6, .dimension = 3, .neurons = 4, .order = {1, 1, 1, 1, 1, 1}},
      {.seed = 7, .players = 7, .dimension = 2, .neurons = 3, .order = {2, 2, 2, 2, 2, 2, 2}},
      {.seed = 8, .players = 4, .dimension = 3, .neurons = 6, .robust = false},
      {.seed = 9, .players = 4, .dimension = 2, .neurons = 9, .perturbed = false},
      {.seed = 10, .players = 3, .dimension = 4, .neurons = 2, .diagonal = false, .robust = false, .perturbed = false},
      {.seed = 12, .players = 5, .dimension = 2, .neurons = 3, .order = {2, 1, 1, 2, 1}, .own_gains = true},
      {.seed = 13, .players = 10, .dimension = 1, .neurons = 4, .own_gains = true, .own_rbf = true},
      {.seed = 14, .players = 4, .dimension = 2, .neurons = 3, .own_gains = true, .directed = true},
      {.seed = 15,
       .players = 9,
       .dimension = 1,
       .neurons = 2,
       .diagonal = false,
       .own_rbf = true,
       .directed = true,
       .initial_weights = true},
      {.seed = 11, .players = 9, .dimension = 4, .neurons = 13, .order = {1, 2, 2, 1, 2, 1, 1, 2, 2}},
  };
}

}  // namespace mixed_order_game::testing
