#include "equilibrium/equilibrium_verdict.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>

#include "equilibrium/hessian_bounds.hpp"
#include "errors.hpp"
#include "game/game.hpp"

namespace mixed_order_game {
namespace {

using Kind = EquilibriumVerdict::Kind;
constexpr Real everywhere = std::numeric_limits<Real>::infinity();

std::string game(const std::string& cost, int dimension = 1, const std::string& more = "") {
  return "title = \"Two players\"\ndimension = " + std::to_string(dimension) +
         "\n[gains]\nk1 = 1.0\nk2 = 1.0\nk3 = 1.0\nk4 = 1.0\nbeta = 1.0\ndelta = 1.0\nepsilon = 1.0\n"
         "[rbf]\ncenters = [0.0]\nwidth = 1.0\nW_max = 1.0\n[graph]\nedges = [[1, 2]]\n" +
         more + "[defaults]\norder = 1\nx0 = 1.0\ncost = { expression = \"" + cost +
         "\" }\n[[player]]\nname = \"a\"\n[[player]]\nname = \"b\"\n";
}

EquilibriumVerdict verdict_of(const std::string& toml) {
  GameExpressions expressions;
  const Game read = parse_game(toml, expressions);
  return judge_equilibrium(read.parameters, expressions.costs);
}

TEST(Verdict, IsNashWhereOwnCostsAreConvexEverywhere) {
  for (const char* cost : {
           "(x[i] - i)^2 + 0.1 * x[1] * x[2]",
           "cosh(x[i] - i) + 0.1 * x[1] * x[2]",
           "exp(x[i]) - x[i] + 0.1 * sin(x[mod(i, N) + 1])",
           "(x[i] - 1)^4 + x[i]^2",
           "0.2 * x[i] - log(1 + x[i]) + 0.1 * x[1] * x[2]",  // where it is defined: above -1
           "x[i] - 2 * log(1 + 3 * x[i] / (1 + exp(x[mod(i, N) + 1])))",
           "x[i]^2 + sin(x[i])",
       }) {
    const EquilibriumVerdict verdict = verdict_of(game(cost));
    EXPECT_EQ(verdict.kind, Kind::nash) << cost;
    for (const auto& player : verdict.players) EXPECT_EQ(player.convex_within, everywhere) << cost;
    EXPECT_TRUE(verdict.others.empty()) << cost;
  }
}

TEST(Verdict, IsLocalWhereTheyAreNot) {
  struct Case {
    const char* cost;
    Real convex_within;  // at most: where the second derivative by hand is zero, or the domain falls apart
  };
  for (const auto& [cost, convex_within] : {
           Case{"-exp(-(x[i] - 1)^2) + 0.01 * x[1] * x[2]", std::sqrt(0.5) + 0.1},
           Case{"x[i] + 1 / x[i]", 1.0},  // below 0 costs are negative
           Case{"cos(x[i]) + 0.1 * x[i]", 1.7},
           Case{"-1 / (0.1 + (x[i] - 1)^2)", 0.2},
           Case{"(x[i]^2 - 1)^2", 1.0},
       }) {
    const EquilibriumVerdict verdict = verdict_of(game(cost));
    EXPECT_EQ(verdict.kind, Kind::local_nash) << cost;
    for (const auto& player : verdict.players) {
      EXPECT_GT(player.convex_within, 0.01) << cost;
      EXPECT_LE(player.convex_within, convex_within) << cost;
    }
  }
}

TEST(Verdict, IsOpenWithoutASecondOrderProof) {
  // x* = 0, where the second derivative is zero; one is a minimum along the own action, the other none
  const std::string guess = "[equilibrium]\nguess = [0.0, 0.0]\n";
  const EquilibriumVerdict verdict =
      verdict_of(game("x[i]^4 * (1 + 0.5 * sin(5 * x[i])) + x[i] * x[mod(i, N) + 1]", 1, guess));
  EXPECT_EQ(verdict.kind, Kind::open);
  EXPECT_EQ(verdict.players[0].curvature, 0.0);
  EXPECT_EQ(verdict.players[0].convex_within, 0.0);
}

TEST(Verdict, DecidesConditionsAwayFromTheirKinks) {
  struct Case {
    const char* cost;
    Real convex_within;  // at most: the distance to the kink, or where the branch is no longer taken
  };
  for (const auto& [cost, convex_within] : {
           Case{"(x[i] - 1)^2 + 0.1 * abs(x[i] - 3)", 2.05},
           Case{"(x[i] - 1)^2 - 0.5 * max(0, x[i] - 2)^2", 1.0},
           Case{"if(x[i] < 2, (x[i] - 1)^2, x[i])", 1.0},
           Case{"(x[i] - 1)^2 + min(x[i], 4) * 0.1", 3.05},
           Case{"if(x[i] > 0.5, x[i] - log(x[i]), 0.2 * x[i]^2)", 0.5},  // log is not taken below
           Case{"(x[i] - 1)^2 * (1 + floor(x[i] / 3))", 1.0},
           Case{"(x[i] - 1)^2 + 0.05 * sign(x[i] + 1)", 2.0},
           Case{"(x[i] - 1)^2 + 0.05 * mod(x[i], 4)", 1.0},
       }) {
    const EquilibriumVerdict verdict = verdict_of(game(cost));
    EXPECT_EQ(verdict.kind, Kind::local_nash) << cost;
    for (const auto& player : verdict.players) {
      EXPECT_GT(player.convex_within, 0.2) << cost;
      EXPECT_LE(player.convex_within, convex_within) << cost;
      EXPECT_EQ(player.kink, "") << cost;
    }
  }
}

TEST(Verdict, ProvesNoConvexityAcrossAKink) {
  // each side of 0.5 is convex, both together are not
  const EquilibriumVerdict verdict = verdict_of(game("(x[i] - 1)^2 - 0.9 * abs(x[i] - 0.5)"));
  for (const auto& player : verdict.players) EXPECT_LE(player.convex_within, 0.96);
}

TEST(Verdict, NamesAKinkAtTheEquilibrium) {
  // the gradient is continuous at x* = 0, and the second derivative jumps from 2 to 3
  const EquilibriumVerdict verdict = verdict_of(game("x[i]^2 + 0.5 * max(0, x[i])^2"));
  EXPECT_EQ(verdict.kind, Kind::open);
  for (const auto& player : verdict.players) {
    EXPECT_EQ(player.kink, "max(0, x[i])");
    EXPECT_EQ(player.convex_within, 0.0);
  }
}

TEST(Verdict, CountsEquilibria) {
  const EquilibriumVerdict verdict = verdict_of(game("(x[i]^2 - 1)^2"));
  ASSERT_FALSE(verdict.others.empty());
  for (const auto& other : verdict.others) {
    for (const Real x : other) EXPECT_NEAR(std::abs(x), 1.0, 1e-9);
  }
  EXPECT_GT(verdict.monotonicity, 0.0);
  EXPECT_FALSE(verdict.is_affine);
}

TEST(Verdict, KnowsGradientsThatAreAffine) {
  for (const auto& [cost, is_affine] : {
           std::pair{"x[i]^2 + (3 - i) * x[1] * x[2] - 2 * x[i]", true},
           std::pair{"(x[i] - 2 * x[mod(i, N) + 1])^2 / 3 + sum(x[j] for j in 1..N)^2", true},
           std::pair{"x[i]^2 + x[mod(i, N) + 1]^4", true},  // of what others do, the own gradient does not depend on
           std::pair{"x[i]^2 + 0.1 * x[i]^3", false},
           std::pair{"x[i]^2 + 0.1 * x[i] * x[mod(i, N) + 1]^2", false},
           std::pair{"(x[i] - 3)^2 + 0.1 * abs(x[i])", false},
           std::pair{"x[i]^2 + log(x[mod(i, N) + 1] + 9)", false},  // not defined everywhere
       }) {
    const EquilibriumVerdict verdict = verdict_of(game(cost));
    EXPECT_EQ(verdict.is_affine, is_affine) << cost;
    if (is_affine) {
      EXPECT_TRUE(verdict.others.empty()) << cost;
    }
  }
}

TEST(Verdict, TakesTheMonotonicityAtTheEquilibrium) {
  // P' = [[2, 3], [1, 2]]: symmetric part [[2, 2], [2, 2]], eigenvalues 0 and 4
  const EquilibriumVerdict verdict = verdict_of(game("x[i]^2 + (4 - 2 * i + 1) * x[1] * x[2]"));
  EXPECT_NEAR(verdict.monotonicity, 0.0, 1e-12);
}

TEST(Verdict, NamesWhatIsNotDefinedWhereTheSearchBegins) {
  const std::string guess = "[equilibrium]\nguess = [21.0, 1.0]\n";
  const auto refused = [](const std::string& toml) {
    try {
      parse_game(toml);
    } catch (const GameError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(refused(game("x[i] - log(x[i] - 20)", 1, guess)).find("player[2].cost is not finite"), std::string::npos);
}

TEST(HessianBounds, ProveConvexityOfSeveralCoordinates) {
  GameExpressions expressions;
  const Game read =
      parse_game(game("cosh(x[i,1] + x[i,2]) + x[i,1]^2 + x[i,2]^2 + 0.1 * x[i,1] * x[i,2]", 2), expressions);
  const HessianBounds bounds(read.parameters, expressions.costs);
  const std::vector<Real> x(4, 0.0);
  EXPECT_TRUE(bounds.is_convex(0, x, 1.0));
  const Game saddle =
      parse_game(game("x[i,1]^2 + x[i,2]^2 + 1.9 * x[i,1] * x[i,2] + 0.05 * cos(x[i,1])", 2), expressions);
  EXPECT_TRUE(HessianBounds(saddle.parameters, expressions.costs).is_convex(0, x, 1.0));
  const Game above =
      parse_game(game("x[i,1]^2 + x[i,2]^2 + 1.9 * x[i,1] * x[i,2] + 0.3 * cos(x[i,1] - 3)", 2), expressions);
  EXPECT_FALSE(HessianBounds(above.parameters, expressions.costs).is_convex(0, x, 10.0));
}

TEST(HessianBounds, DecideBranchesOverBoxes) {
  GameExpressions expressions;
  const Game read = parse_game(game("(x[i] - 1)^2 + if(x[i] > 0.5, 0.1 / x[i], 0.1 * exp(x[i]))"), expressions);
  const HessianBounds bounds(read.parameters, expressions.costs);
  std::vector<Interval> rows;
  const Enclosure::Found above = bounds.rows(0, {{0.6, 2.0}, {0.0, 0.0}}, rows);
  EXPECT_EQ(above.definition, Enclosure::Definition::everywhere);
  EXPECT_EQ(above.kink, nullptr);
  EXPECT_TRUE(rows[0].contains(2.2));  // 2 + 0.2 / x^3 at 1
  EXPECT_LT(rows[0].upper, 3.2);
  const Enclosure::Found below = bounds.rows(0, {{-1.0, 0.4}, {0.0, 0.0}}, rows);  // 1 / x is not taken
  EXPECT_EQ(below.definition, Enclosure::Definition::everywhere);
  EXPECT_TRUE(rows[0].contains(2.1));  // 2 + 0.1 exp(x) at 0
  const Enclosure::Found across = bounds.rows(0, {{0.4, 0.6}, {0.0, 0.0}}, rows);
  ASSERT_NE(across.kink, nullptr);
  EXPECT_EQ(across.kink->text, "x[i] > 0.5");
  EXPECT_NE(bounds.rows(0, {{0.5, 0.6}, {0.0, 0.0}}, rows).kink, nullptr);  // at the edge
}

TEST(HessianBounds, EncloseTheHessian) {
  GameExpressions expressions;
  const Game read = parse_game(
      game("x[i,1]^2 + x[i,2]^2 + exp(0.3 * x[1,1] * x[2,2]) + sin(x[i,1] * x[i,2]) + 0.2 * x[1,1]^3", 2), expressions);
  const Shape& shape = read.parameters.shape;
  const HessianBounds bounds(read.parameters, expressions.costs);
  const std::vector<Interval> box(4, {-1.0, 1.0});
  std::vector<Interval> rows;
  const SparseRows& pattern = read.parameters.cost->hessian_pattern();
  std::vector<Real> hessian(at(pattern.entries()));
  for (int sample = 0; sample < 200; ++sample) {
    std::vector<Real> x(4);
    for (std::size_t p = 0; p < 4; ++p) x[p] = std::sin(1.0 + 7.0 * sample + 3.0 * static_cast<Real>(p));
    read.parameters.cost->hessian_rows(x.data(), 0, hessian.data());
    for (int i = 0; i < 2; ++i) {
      ASSERT_EQ(bounds.rows(i, box, rows).definition, Enclosure::Definition::everywhere);
      for (int l = 0; l < 2; ++l) {
        const auto row = at(shape.entry(i, l));
        for (int k = pattern.start[row]; k < pattern.start[row + 1]; ++k) {
          EXPECT_TRUE(rows[at(l) * 4 + at(pattern.column[at(k)])].contains(hessian[at(k)]));
        }
      }
    }
  }
}

}  // namespace
}  // namespace mixed_order_game
