#include "loop/located_conditions.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <utility>

#include "game/game.hpp"

namespace mixed_order_game {
namespace {

/// The paper's game without the robust part, in which the controls of player 1 are bounded: they are -10 x.
Parameters bounded_game() {
  std::ifstream file(std::string(MIXED_ORDER_GAME_SOURCE_DIR) + "/modelDescription/games/five_vehicles.toml");
  std::stringstream text;
  text << file.rdbuf();
  std::string game = text.str();
  game.insert(game.find("\nx0 = "), "\nu_max = [10.0, 20.0]");
  Parameters parameters = parse_game(game).parameters;
  parameters.strategy.robust = false;
  return parameters;
}

TEST(LocatedConditions, OfABoundedControlRiseWhereItLeavesItsPlace) {
  const Parameters parameters = bounded_game();
  const ClosedLoop loop(parameters);
  const LocatedConditions conditions(loop);
  const std::vector<int> bounded = parameters.bounded();
  ASSERT_EQ(bounded.size(), 2);
  const std::size_t mode = at(LocatedConditions::count(parameters)) - 2;
  const std::size_t value = at(LocatedConditions::located(parameters)) - 2;
  const std::vector<Real> inputs(at(loop.inputs().size()));
  Signals signals(loop.shape());
  const auto values = [&](Real u_1, Real u_2, Real place_1, Real place_2) {
    AlignedVector state(at(loop.layout().size()));
    state[at(loop.layout().x_of(bounded[0]))] = -0.1 * u_1;
    state[at(loop.layout().x_of(bounded[1]))] = -0.1 * u_2;
    Modes modes(at(LocatedConditions::count(parameters)));
    modes[mode] = place_1;
    modes[mode + 1] = place_2;
    AlignedVector found(value + 2);
    conditions.event_functions(0.0, state.data(), inputs.data(), modes, 1e-6, signals, found.data());
    return std::pair{found[value], found[value + 1]};
  };
  EXPECT_EQ(values(5.0, -30.0, 0.0, 0.0), std::pair(-0.5, 0.5));
  EXPECT_EQ(values(15.0, -30.0, 1.0, -1.0), std::pair(-0.5, -0.5));
  EXPECT_EQ(values(5.0, -10.0, 1.0, -1.0), std::pair(0.5, 0.5));
  // beyond the other bound at once
  EXPECT_EQ(values(-15.0, 30.0, 1.0, -1.0), std::pair(2.5, 2.5));
  // at its bound it has not passed it
  const auto [first, second] = values(10.0, -20.0, 0.0, -1.0);
  EXPECT_TRUE(-1e-99 < first && first < 0.0);
  EXPECT_TRUE(-1e-99 < second && second < 0.0);
}

}  // namespace
}  // namespace mixed_order_game
