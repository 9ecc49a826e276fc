#include "integration/judge.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "game/game.hpp"
#include "reference_loop.hpp"

namespace mixed_order_game {
namespace {

struct Judged {
  int looks;
  Real energy;
};

/// Of actions that grow as scale exp(t), along steps of 0.1 ms.
Judged judged_at(const ClosedLoop& loop, Real scale) {
  AlignedVector state(at(loop.layout().size()));
  const AlignedVector inputs(at(loop.inputs().size()));
  int looks = 0;
  const Judge::Path path = [&](Real t) {
    ++looks;
    for (int p = 0; p < loop.shape().own_entries(); ++p) state[at(loop.layout().x_of(p))] = scale * std::exp(t);
    return Judge::Place{state.data(), inputs.data()};
  };
  const Modes modes(at(loop.shape().own_entries()), 0);
  Judge judge(loop);
  judge.set_equilibrium(std::vector<Real>(at(loop.shape().actions()), 1.0));
  judge.start(0.0, {}, path(0.0), modes);
  looks = 0;
  for (int k = 1; k <= 50; ++k) judge.pass(1e-4 * k, path, modes);
  return {looks, judge.judgement().control_energy};
}

TEST(Judge, LooksAtAStepAFewTimesHoweverLargeItsValues) {
  const testing::PlainGame game =
      testing::random_game({.seed = 3, .players = 2, .dimension = 1, .neurons = 3, .order = {1, 1}});
  const ClosedLoop loop(parse_game(testing::toml_of(game)).parameters);
  const Judged far = judged_at(loop, 1e100);
  EXPECT_LE(far.looks, 150);
  // first the differences of u'u leave the range of doubles, then it does itself
  for (const Real scale : {1e146, 1e148, 1e150, 1e151, 1e152, 3e152, 1e153, 1e155, 1e200}) {
    EXPECT_LE(judged_at(loop, scale).looks, 200) << scale;
  }
  EXPECT_NEAR(judged_at(loop, 1e148).energy / far.energy, 1e96, 1e86);
}

}  // namespace
}  // namespace mixed_order_game
