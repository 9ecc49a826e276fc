#include "integration/judge.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "game/game.hpp"
#include "reference_loop.hpp"

namespace mixed_order_game {
namespace {

struct Judged {
  int looks;
  Judgement judgement;
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
  judge.start(0.0, {.settling_band = 1.0}, path(0.0), modes);
  looks = 0;
  for (int k = 1; k <= 50; ++k) judge.pass(1e-4 * k, path, modes);
  return {looks, judge.judgement()};
}

ClosedLoop loop_of_two() {
  const testing::PlainGame game =
      testing::random_game({.seed = 3, .players = 2, .dimension = 1, .neurons = 3, .order = {1, 1}});
  return ClosedLoop(parse_game(testing::toml_of(game)).parameters);
}

TEST(Judge, LooksAtAStepAFewTimesHoweverLargeItsValues) {
  const ClosedLoop loop = loop_of_two();
  const Judged far = judged_at(loop, 1e100);
  EXPECT_LE(far.looks, 150);
  // first the differences of u'u leave the range of doubles, then it does itself
  for (const Real scale : {1e146, 1e148, 1e150, 1e151, 1e152, 3e152, 1e153, 1e155, 1e200}) {
    EXPECT_LE(judged_at(loop, scale).looks, 200) << scale;
  }
  EXPECT_NEAR(judged_at(loop, 1e148).judgement.control_energy / far.judgement.control_energy, 1e96, 1e86);
}

TEST(Judge, KnowsWhatIsTooLargeToBeSquared) {
  const ClosedLoop loop = loop_of_two();
  for (const Real scale : {1e100, 1e152, 1e155}) {
    const Judgement judgement = judged_at(loop, scale).judgement;
    EXPECT_DOUBLE_EQ(judgement.error_peak, scale * std::exp(0.005)) << scale;
    EXPECT_GT(judgement.control_peak, scale) << scale;
    EXPECT_TRUE(judgement.outside) << scale;
    EXPECT_DOUBLE_EQ(judgement.until, 0.005) << scale;
    EXPECT_EQ(judgement.control_energy == std::numeric_limits<Real>::max(), scale > 1e154) << scale;
  }
}

TEST(Judge, TakesAStepAsShortAsTheResolutionOfTime) {
  const ClosedLoop loop = loop_of_two();
  const AlignedVector state(at(loop.layout().size()), 1.0);
  const AlignedVector inputs(at(loop.inputs().size()));
  const Judge::Path path = [&](Real) { return Judge::Place{state.data(), inputs.data()}; };
  const Modes modes(at(loop.shape().own_entries()), 0);
  Judge judge(loop);
  judge.start(0.75, {}, path(0.75), modes);
  judge.pass(std::nextafter(0.75, 1.0), path, modes);
  EXPECT_LT(judge.judgement().control_energy, 1e-10);
}

}  // namespace
}  // namespace mixed_order_game
