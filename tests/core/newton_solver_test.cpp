#include "newton/newton_solver.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "families/quadratic_cost.hpp"
#include "game/game.hpp"
#include "loop_matrix.hpp"
#include "random_game.hpp"

namespace mixed_order_game {
namespace {

using testing::assorted_recipes;
using testing::PlainGame;
using testing::random_game;
using testing::RandomNumbers;
using testing::Recipe;
using testing::toml_of;

Real distance(const std::vector<Real>& a, const std::vector<Real>& b) {
  Real squares = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) squares += (a[k] - b[k]) * (a[k] - b[k]);
  return std::sqrt(squares);
}

Real norm(const std::vector<Real>& a) { return distance(a, std::vector<Real>(a.size(), 0.0)); }

/// A random state with about half of the columns on the sphere, linearized, and both solvers' answers for it.
class NewtonSystem {
 public:
  NewtonSystem(const PlainGame& game, std::uint64_t seed)
      : random_(seed), loop_(parse_game(toml_of(game)).parameters), jacobian_(loop_) {
    const Shape& shape = loop_.shape();
    std::vector<Real> state(at(loop_.layout().size()));
    random_.fill(state, -2.0, 2.0);
    Modes modes(at(shape.actions()), 0);
    for (auto& mode : modes) mode = random_.chance(0.5) ? 1 : 0;
    AlignedVector norm2(modes.size());
    loop_.weight_norms(state.data(), norm2.data());
    for (int m = 0; m < shape.neurons; ++m) {
      for (std::size_t p = 0; p < modes.size(); ++p) {
        const Real scale = std::sqrt(loop_.gains().W_max[p] / norm2[p]);
        if (modes[p] != 0 || scale < 1.0) state[at(loop_.layout().weights_of(m)) + p] *= scale;
      }
    }
    const std::vector<Real> d_ext(at(shape.actions()), 0.0);
    Signals signals(shape);
    std::vector<Real> rate(state.size());
    loop_.evaluate(1.0, state.data(), d_ext.data(), modes, signals, rate.data());
    // on the sphere e w'S >= 0, which random states do not obey by themselves
    for (std::size_t p = 0; p < modes.size(); ++p) {
      if (signals.error[p] * signals.network[p] < 0.0) modes[p] = 0;
    }
    loop_.evaluate(1.0, state.data(), d_ext.data(), modes, signals, rate.data());
    jacobian_.linearize(state.data(), loop_.plants(state.data(), nullptr, signals), signals, modes);
  }

  void compare(Real gamma) {
    const auto dense = make_dense_newton();
    const auto structured = make_structured_newton();
    for (NewtonSolver* solver : {dense.get(), structured.get()}) {
      solver->refresh(jacobian_);
      ASSERT_TRUE(solver->factor(jacobian_, gamma));
    }
    std::vector<Real> rhs(at(loop_.layout().size()));
    random_.fill(rhs, -1.0, 1.0);
    std::vector<Real> expected = rhs;
    std::vector<Real> solved = rhs;
    dense->solve(expected.data());
    structured->solve(solved.data());
    EXPECT_LE(distance(solved, expected), 1e-12 * norm(expected)) << "gamma = " << gamma;
  }

 private:
  RandomNumbers random_;
  ClosedLoop loop_;
  LoopJacobian jacobian_;
};

class StructuredNewton : public ::testing::TestWithParam<Recipe> {};

TEST_P(StructuredNewton, SolvesTheSameSystemAsDenseElimination) {
  const PlainGame game = random_game(GetParam());
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    NewtonSystem system(game, 100 * GetParam().seed + seed);
    for (const Real gamma : {1e-6, 1e-4, 1e-3, 1e-2, 0.1}) system.compare(gamma);
  }
}

INSTANTIATE_TEST_SUITE_P(AssortedGames, StructuredNewton, ::testing::ValuesIn(assorted_recipes()));
// too many players for the modes of the estimate blocks
INSTANTIATE_TEST_SUITE_P(
    ManyPlayers, StructuredNewton,
    ::testing::Values(Recipe{.seed = 12, .players = most_players_by_eigenvectors + 1, .dimension = 1, .neurons = 3},
                      Recipe{.seed = 13, .players = 19, .dimension = 2, .neurons = 2, .diagonal = false}));

class StructuredNewtonOnGraphs : public ::testing::TestWithParam<std::size_t> {};

TEST_P(StructuredNewtonOnGraphs, FromStarToCompleteGraph) {
  const std::size_t N = GetParam();
  PlainGame game = random_game({.seed = 21, .players = N, .dimension = 2, .neurons = 3});
  const auto linked = [N](const std::string& kind, std::size_t i, std::size_t j) {  // i < j
    if (kind == "star") return i == 0;
    if (kind == "path") return j == i + 1;
    if (kind == "ring") return j == i + 1 || (i == 0 && j == N - 1);
    if (kind == "clique with a tail") return j == i + 1 || j < 2 * N / 3;
    return true;
  };
  for (const std::string kind : {"star", "path", "ring", "clique with a tail", "complete"}) {
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t j = i + 1; j < N; ++j) {
        game.adjacency[i][j] = game.adjacency[j][i] = linked(kind, i, j) ? 0.5 + 0.1 * static_cast<Real>(i + j) : 0.0;
      }
    }
    SCOPED_TRACE(kind);
    NewtonSystem system(game, 5);
    system.compare(3e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(ByModesAndByElimination, StructuredNewtonOnGraphs, ::testing::Values(7, 11, 18));

TEST(StructuredNewtonRefresh, FollowsNewEdgesCouplingsAndGains) {
  const PlainGame before = random_game({.seed = 31, .players = 5, .dimension = 2, .neurons = 3});
  ClosedLoop loop(parse_game(toml_of(before)).parameters);
  LoopJacobian jacobian(loop);
  const auto structured = make_structured_newton();
  Signals signals(loop.shape());
  std::vector<Real> state(at(loop.layout().size()), 0.5);
  std::vector<Real> rate(state.size());
  const Modes modes(10, 0);
  const std::vector<Real> d_ext(10, 0.0);
  const auto linearize = [&] {
    loop.evaluate(0.0, state.data(), d_ext.data(), modes, signals, rate.data());
    jacobian.linearize(state.data(), loop.plants(state.data(), nullptr, signals), signals, modes);
  };
  linearize();
  structured->refresh(jacobian);
  ASSERT_TRUE(structured->factor(jacobian, 2e-3));
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < i; ++j) {
      loop.parameters().graph.set_weight(i, j, 0.7);
      loop.parameters().cost->coefficients[QuadraticCost::coupling][at(i * 5 + j)] = 0.3;
    }
  }
  const auto expect_followed = [&](const char* change) {
    loop.refresh();
    jacobian.refresh();
    structured->refresh(jacobian);
    const auto dense = make_dense_newton();
    linearize();
    ASSERT_TRUE(structured->factor(jacobian, 2e-3));
    ASSERT_TRUE(dense->factor(jacobian, 2e-3));
    std::vector<Real> expected = rate;
    dense->solve(expected.data());
    structured->solve(rate.data());
    EXPECT_LE(distance(rate, expected), 1e-12 * norm(expected)) << change;
  };
  expect_followed("edges and couplings");
  for (Real& k3 : loop.parameters().gains.k3) k3 *= 1.5;
  loop.parameters().gains.k1[0] = 3.0;
  expect_followed("k3 of all, k1");
  loop.parameters().gains.k3[2] *= 2.0;
  expect_followed("k3 of one");
  loop.parameters().graph.set_weight(1, 3, 0.2);
  expect_followed("an edge");
}

}  // namespace
}  // namespace mixed_order_game
