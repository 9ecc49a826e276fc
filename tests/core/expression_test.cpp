// Random expressions: what the tapes evaluate, and its derivatives, against complex steps of trees of our own.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <functional>
#include <memory>

#include "expression/player_expressions.hpp"
#include "expression/unroll.hpp"
#include "random_game.hpp"

namespace mixed_order_game {
namespace {

using Complex = std::complex<Real>;
using testing::RandomNumbers;

const Shape shape{.players = 3, .dimension = 2, .neurons = 1, .order = {1, 2, 2}};

/// A point: x, v and parameters h[1..4], at which the trees and the tapes are evaluated.
struct Point {
  std::vector<Complex> x = std::vector<Complex>(6);
  std::vector<Complex> v = std::vector<Complex>(6);
  std::vector<Complex> h = std::vector<Complex>(4);
};

/// A text and what it means for player i and coordinate l, both from one.
struct Tree {
  std::string text;
  std::function<Complex(const Point&, int i, int l)> value;
};

class Generator {
 public:
  explicit Generator(std::uint64_t seed) : random_(seed) {}

  Tree tree(int depth) {
    if (depth == 0) return leaf();
    const std::size_t kind = random_.below(24);
    if (kind < 8) return binary(depth);
    if (kind == 8) return power(depth);
    if (kind == 9) return sum(depth);
    if (kind == 10) return chosen(depth);
    return function(kind - 11, depth);
  }

 private:
  Tree leaf() {
    switch (random_.below(6)) {
      case 0: {
        const Real number = std::round(random_.between(-40.0, 40.0)) / 8.0;
        return {"(" + std::to_string(number) + ")", [=](const Point&, int, int) { return Complex(number); }};
      }
      case 1:
        return {"x[i,l]", [](const Point& p, int i, int l) { return p.x[at((l - 1) * 3 + i - 1)]; }};
      case 2: {
        const auto shift = static_cast<int>(random_.below(3));
        return {"x[mod(i+" + std::to_string(shift) + ",N)+1,1]",
                [=](const Point& p, int i, int) { return p.x[at((i + shift) % 3)]; }};
      }
      case 3:
        return {"v[max(i,2),2]", [](const Point& p, int i, int) { return p.v[at(3 + std::max(i, 2) - 1)]; }};
      case 4: {
        const std::size_t k = random_.below(4);
        return {"h[" + std::to_string(k + 1) + "]", [=](const Point& p, int, int) { return p.h[k]; }};
      }
      default:
        return {"i*order[i]", [](const Point&, int i, int) { return Complex(i * (i == 1 ? 1 : 2)); }};
    }
  }

  Tree binary(int depth) {
    const Tree a = tree(depth - 1);
    const Tree b = tree(depth - 1);
    switch (random_.below(5)) {
      case 0:
        return {"(" + a.text + " + " + b.text + ")",
                [=](auto& p, int i, int l) { return a.value(p, i, l) + b.value(p, i, l); }};
      case 1:
        return {"(" + a.text + " - " + b.text + ")",
                [=](auto& p, int i, int l) { return a.value(p, i, l) - b.value(p, i, l); }};
      case 2:
        return {"(" + a.text + " / (2.5 + sin(" + b.text + ")))",
                [=](auto& p, int i, int l) { return a.value(p, i, l) / (2.5 + std::sin(b.value(p, i, l))); }};
      case 3:
        return {"-" + a.text + "*" + b.text,
                [=](auto& p, int i, int l) { return -a.value(p, i, l) * b.value(p, i, l); }};
      default:
        return {"hypot(" + a.text + ", 1 + (" + b.text + ")^2)", [=](auto& p, int i, int l) {
                  const Complex s = a.value(p, i, l);
                  const Complex t = 1.0 + b.value(p, i, l) * b.value(p, i, l);
                  return std::sqrt(s * s + t * t);
                }};
    }
  }

  Tree power(int depth) {
    const Tree a = tree(depth - 1);
    switch (random_.below(3)) {
      case 0:
        return {"(" + a.text + ")^2", [=](auto& p, int i, int l) { return a.value(p, i, l) * a.value(p, i, l); }};
      case 1:
        return {"(1.5 + sin(" + a.text + "))^-1.5",
                [=](auto& p, int i, int l) { return std::exp(-1.5 * std::log(1.5 + std::sin(a.value(p, i, l)))); }};
      default: {
        const Tree b = tree(0);
        return {"(1.5 + cos(" + a.text + "))^tanh(" + b.text + ")", [=](auto& p, int i, int l) {
                  return std::exp(std::tanh(b.value(p, i, l)) * std::log(1.5 + std::cos(a.value(p, i, l))));
                }};
      }
    }
  }

  Tree sum(int depth) {
    const Tree a = tree(depth - 1);
    return {"sum(x[j,1]*tanh(" + a.text + ") for j in 1..N if j != i)", [=](auto& p, int i, int l) {
              Complex total = 0.0;
              for (int j = 1; j <= 3; ++j) {
                if (j != i) total += p.x[at(j - 1)] * std::tanh(a.value(p, i, l));
              }
              return total;
            }};
  }

  Tree chosen(int depth) {
    const Tree a = tree(depth - 1);
    return {"if(i > 1 and not l == 2, " + a.text + ", x[i,1])",
            [=](auto& p, int i, int l) { return i > 1 && l != 2 ? a.value(p, i, l) : p.x[at(i - 1)]; }};
  }

  Tree function(std::size_t which, int depth) {
    const Tree a = tree(depth - 1);
    const auto of = [&](const std::string& before, const std::string& after, Complex (*apply)(Complex)) -> Tree {
      return {before + a.text + after, [=](auto& p, int i, int l) { return apply(a.value(p, i, l)); }};
    };
    switch (which) {
      case 0:
        return of("exp(sin(", "))", [](Complex s) { return std::exp(std::sin(s)); });
      case 1:
        return of("expm1(0.5*tanh(", "))", [](Complex s) { return std::exp(0.5 * std::tanh(s)) - 1.0; });
      case 2:
        return of("log(2 + (", ")^2)", [](Complex s) { return std::log(2.0 + s * s); });
      case 3:
        return of("log1p((", ")^2)", [](Complex s) { return std::log(1.0 + s * s); });
      case 4:
        return of("sqrt(1 + (", ")^2)", [](Complex s) { return std::sqrt(1.0 + s * s); });
      case 5:
        return of("tan(0.4*tanh(", "))", [](Complex s) { return std::tan(0.4 * std::tanh(s)); });
      case 6:
        return of("asin(0.6*sin(", "))", [](Complex s) { return std::asin(0.6 * std::sin(s)); });
      case 7:
        return of("acos(0.6*cos(", "))", [](Complex s) { return std::acos(0.6 * std::cos(s)); });
      case 8:
        return of("atan(", ")", [](Complex s) { return std::atan(s); });
      case 9:
        return of("sinh(tanh(", "))", [](Complex s) { return std::sinh(std::tanh(s)); });
      case 10:
        return of("cosh(sin(", "))", [](Complex s) { return std::cosh(std::sin(s)); });
      case 11:
        return of("atan2(", ", 2.0)", [](Complex s) { return std::atan(s / 2.0); });
      default:
        return of("cos(", ")", [](Complex s) { return std::cos(s); });
    }
  }

  RandomNumbers random_;
};

NamedParameters parameters() {
  NamedParameters named;
  named.declared.push_back({.name = "h", .description = {}, .unit = {}, .size = {4}});
  named.values = {0.7, -1.2, 0.3, 2.1};
  return named;
}

TEST(Expressions, ValuesAndDerivativesAreThoseOfComplexSteps) {
  constexpr Real h = 1e-30;
  const NamedParameters named = parameters();
  RandomNumbers random(5);
  int compared = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    Generator generator(seed);
    const Tree tree = generator.tree(4);
    SCOPED_TRACE(tree.text);
    PlayerExpressions expressions(6, 3, 6, 4);
    for (int i = 0; i < 3; ++i) {
      const auto graph = std::make_shared<ExpressionGraph>(100'000);
      for (int l = 0; l < 2; ++l) {
        const Place place{
            .shape = &shape, .parameters = &named, .purpose = Purpose::dynamics, .player = i, .coordinate = l};
        const int node = unroll(parse_expression(tree.text), place, *graph);
        expressions.add(shape.entry(i, l), i, graph, node);
      }
    }
    expressions.compile();

    Point point;
    std::vector<Real> x(6);
    std::vector<Real> v(6);
    random.fill(x, -2.0, 2.0);
    random.fill(v, -2.0, 2.0);
    std::copy(x.begin(), x.end(), point.x.begin());
    std::copy(v.begin(), v.end(), point.v.begin());
    std::copy(named.values.begin(), named.values.end(), point.h.begin());
    const LeafValues leaves{.points = x.data(), .stride = 0, .velocities = v.data(), .parameters = named.values.data()};
    std::vector<Real> values(6, 99.0);
    expressions.values(leaves, values.data());
    const auto value_at = [&](int slot) { return tree.value(point, slot % 3 + 1, slot / 3 + 1); };
    for (int slot = 0; slot < 6; ++slot) {
      const Real expected = value_at(slot).real();
      ASSERT_NEAR(values[at(slot)], expected, 1e-12 * (1.0 + std::abs(expected)));
    }
    for (const auto& [kind, moved] : {std::pair(LeafKind::action, &point.x), std::pair(LeafKind::velocity, &point.v),
                                      std::pair(LeafKind::parameter, &point.h)}) {
      const SparseRows& pattern = expressions.pattern(kind);
      std::vector<Real> entries(at(pattern.entries()));
      expressions.derivatives(kind, leaves, entries.data());
      for (int slot = 0; slot < 6; ++slot) {
        std::vector<Real> row(moved->size(), 0.0);
        for (int k = pattern.start[at(slot)]; k < pattern.start[at(slot + 1)]; ++k)
          row[at(pattern.column[at(k)])] = entries[at(k)];
        Real largest = 1.0;
        for (const Real entry : row) largest = std::max(largest, std::abs(entry));
        for (std::size_t column = 0; column < row.size(); ++column) {
          (*moved)[column] += Complex(0.0, h);
          const Real expected = value_at(slot).imag() / h;
          (*moved)[column] -= Complex(0.0, h);
          ASSERT_NEAR(row[column], expected, 1e-11 * (largest + std::abs(expected)));
          ++compared;
        }
      }
    }
  }
  EXPECT_GT(compared, 20'000);
}

TEST(Expressions, PlayersOfOneStructureShareATape) {
  const NamedParameters named = parameters();
  PlayerExpressions sums(40, 40, 40, 4);
  const Shape many{.players = 40, .dimension = 1, .neurons = 1, .order = std::vector<int>(40, 1)};
  for (int i = 0; i < 40; ++i) {
    const auto graph = std::make_shared<ExpressionGraph>(100'000);
    const Place place{.shape = &many, .parameters = &named, .purpose = Purpose::cost, .player = i, .coordinate = -1};
    sums.add(i, i, graph,
             unroll(parse_expression("x[i]^2 * i + sum(x[j]*j for j in 1..N) * exp(x[i])"), place, *graph));
  }
  sums.compile();
  EXPECT_LT(sums.memory(), 2'000'000U);  // 40 tapes of one lane each would take eight times as much
  std::vector<Real> x(40);
  RandomNumbers(3).fill(x, -1.0, 1.0);
  std::vector<Real> values(40);
  sums.values({.points = x.data(), .stride = 0, .parameters = named.values.data()}, values.data());
  Real total = 0.0;
  for (int j = 0; j < 40; ++j) total += x[at(j)] * (j + 1);
  for (int i = 0; i < 40; ++i) {
    EXPECT_NEAR(values[at(i)], x[at(i)] * x[at(i)] * (i + 1) + total * std::exp(x[at(i)]), 1e-11);
  }
}

TEST(Expressions, SumsOfActionsAreTakenTermByTermTheOwnOneFirst) {
  constexpr int players = 37;  // a whole tape, and one with empty lanes
  const NamedParameters named = parameters();
  const Shape many{.players = players, .dimension = 1, .neurons = 1, .order = std::vector<int>(players, 1)};
  std::vector<Real> points(at(players * players));  // each player sees others
  RandomNumbers(4).fill(points, -1.0, 1.0);
  const auto values_of = [&](const char* text) {
    PlayerExpressions sums(players, players, players, 4);
    for (int i = 0; i < players; ++i) {
      const auto graph = std::make_shared<ExpressionGraph>(100'000);
      const Place place{.shape = &many, .parameters = &named, .purpose = Purpose::cost, .player = i, .coordinate = -1};
      sums.add(i, i, graph, unroll(parse_expression(text), place, *graph));
    }
    sums.compile();
    std::vector<Real> values(players);
    sums.values({.points = points.data(), .stride = players, .parameters = named.values.data()}, values.data());
    return values;
  };
  const auto sum = [&](int i, int first, int last, int without) {
    Real total = i >= first && i <= last && i != without ? points[at(i * players + i)] : 0.0;
    for (int j = first; j <= last; ++j) {
      if (j != i && j != without) total += points[at(i * players + j)];
    }
    return total;
  };
  const std::vector<Real> all = values_of("sum(x[j] for j in 1..N)");
  const std::vector<Real> others = values_of("x[i] * sum(x[j] for j in 1..N if j != i)");
  const std::vector<Real> some =
      values_of("sum(x[j] for j in 1..7) * sum(x[j] for j in 1..N) - sum(x[j] for j in 5..9)");
  for (int i = 0; i < players; ++i) {
    const Real whole = sum(i, 0, players - 1, -1);
    EXPECT_EQ(all[at(i)], whole);
    EXPECT_EQ(others[at(i)], points[at(i * players + i)] * sum(i, 0, players - 1, i));
    EXPECT_EQ(some[at(i)], sum(i, 0, 6, -1) * whole - sum(i, 4, 8, -1));
  }
}

TEST(Expressions, PowersOfZeroAndTheErrorFunction) {
  const NamedParameters named = parameters();
  PlayerExpressions expressions(6, 3, 6, 4);
  const auto graph = std::make_shared<ExpressionGraph>(1000);
  const Place place{.shape = &shape, .parameters = &named, .purpose = Purpose::cost, .player = 0, .coordinate = -1};
  expressions.add(0, 0, graph, unroll(parse_expression("x[1,1]^h[1]"), place, *graph));
  expressions.add(1, 0, graph, unroll(parse_expression("erf(x[2,1])"), place, *graph));
  expressions.add(2, 0, graph, unroll(parse_expression("2^-x[2,1]^2"), place, *graph));
  expressions.compile();
  const std::vector<Real> x{0.0, 0.5, 0.0, 0.0, 0.0, 0.0};
  const LeafValues leaves{.points = x.data(), .stride = 0, .parameters = named.values.data()};
  std::vector<Real> values(6);
  expressions.values(leaves, values.data());
  EXPECT_EQ(values[0], 0.0);
  EXPECT_DOUBLE_EQ(values[1], std::erf(0.5));
  EXPECT_DOUBLE_EQ(values[2], std::pow(2.0, -0.25));
  std::vector<Real> along(at(expressions.pattern(LeafKind::parameter).entries()));
  expressions.derivatives(LeafKind::parameter, leaves, along.data());
  EXPECT_EQ(along, std::vector<Real>{0.0});  // 0^p along p
  std::vector<Real> entries(at(expressions.pattern(LeafKind::action).entries()));
  expressions.derivatives(LeafKind::action, leaves, entries.data());
  EXPECT_DOUBLE_EQ(entries[1], 2.0 / std::sqrt(std::acos(-1.0)) * std::exp(-0.25));
}

TEST(Expressions, NestingAndLengthAreBounded) {
  EXPECT_THROW(parse_expression(std::string(200, '(') + "1" + std::string(200, ')')), ExpressionError);
  EXPECT_THROW(parse_expression(std::string(30'000, '1')), ExpressionError);
  std::string powers = "2";
  for (int k = 0; k < 200; ++k) powers += "^1";
  EXPECT_THROW(parse_expression(powers), ExpressionError);
  std::string sums = "1";
  for (int k = 0; k < 9'000; ++k) sums += "+1";
  EXPECT_NO_THROW(parse_expression(sums));  // flat, however long
  EXPECT_NO_THROW(parse_expression(std::string(15'000, '-') + "1"));
  const NamedParameters named = parameters();
  ExpressionGraph graph(1000);
  const Place place{.shape = &shape, .parameters = &named, .purpose = Purpose::cost, .player = 0, .coordinate = -1};
  EXPECT_ANY_THROW(unroll(
      parse_expression("sum(sum(sum(x[1,1]^(a+b+c) for a in 1..999) for b in 1..999) for c in 1..999)"), place, graph));
}

}  // namespace
}  // namespace mixed_order_game
