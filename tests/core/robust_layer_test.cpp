#include "newton/robust_layer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "game/game.hpp"
#include "reference_loop.hpp"

namespace mixed_order_game {
namespace {

using testing::assorted_recipes;
using testing::PlainGame;
using testing::random_game;
using testing::random_state;
using testing::RandomNumbers;
using testing::toml_of;

constexpr Real K = 0.2784645427610738;

/// A loop with a robust term, linearized at a state.
struct Linearized {
  Linearized(const testing::Recipe& recipe, unsigned seed)
      : game(random_game(recipe)),
        random(seed),
        loop(parse_game(toml_of(game)).parameters),
        modes(at(loop.shape().actions())),
        state(random_state(game, random, on_sphere).flat()),
        signals(loop.shape()),
        jacobian(loop),
        layer(loop) {
    loop.evaluate_seeking(state.data(), nullptr, modes, signals);
    jacobian.linearize(state.data(), loop.plants(state.data(), nullptr, signals), signals, modes);
  }
  [[nodiscard]] std::size_t place(int p) const {
    const bool second = loop.shape().is_second_order(loop.shape().player_of(p));
    return at((second ? loop.layout().reference() : loop.layout().x()) + p);
  }
  [[nodiscard]] std::size_t player(std::size_t p) const { return p % game.players; }
  /// Of column p.
  [[nodiscard]] Real phi(std::size_t p, Real e) const {
    const std::size_t i = player(p);
    return game.delta[i] * std::tanh(K * game.delta[i] * e / game.epsilon[i]);
  }
  [[nodiscard]] Real slope(std::size_t p, Real e) const {
    const std::size_t i = player(p);
    return K * game.delta[i] * game.delta[i] / game.epsilon[i] /
           std::pow(std::cosh(K * game.delta[i] * e / game.epsilon[i]), 2);
  }
  /// Half the width of the layer of column p.
  [[nodiscard]] Real width(std::size_t p) const { return game.epsilon[player(p)] / (K * game.delta[player(p)]); }
  /// A state that differs from this one by up to the size in each entry.
  [[nodiscard]] std::vector<Real> near(const std::vector<Real>& from, Real size) {
    std::vector<Real> moved = from;
    for (Real& number : moved) number += random.between(-size, size);
    return moved;
  }
  [[nodiscard]] std::vector<Real> errors(const std::vector<Real>& at_state) const {
    Signals there(loop.shape());
    loop.evaluate_errors(at_state.data(), nullptr, modes, there);
    return {there.error.begin(), there.error.end()};
  }

  /// The largest of the weights with which a change of e_p enters the state: its own, and by w' = beta S e.
  [[nodiscard]] Real heaviest(int p, Real gamma, const std::vector<Real>& weight) const {
    Real largest = weight[place(p)];
    for (int m = 0; m < loop.shape().neurons; ++m) {
      const Real activation = jacobian.activation[at(m * loop.shape().actions() + p)];
      const Real beta = game.beta[player(at(p))];
      largest = std::max(largest, gamma * beta * activation * weight[at(loop.layout().weights_of(m) + p)]);
    }
    return largest;
  }

  std::vector<std::vector<int>> on_sphere;
  PlainGame game;
  RandomNumbers random;
  ClosedLoop loop;
  Modes modes;
  std::vector<Real> state;
  Signals signals;
  LoopJacobian jacobian;
  RobustLayer layer;
};

/// Defects that are a part of phi's range count more.
Real counted(Real defect, Real delta) { return std::fabs(defect) * (1.0 + 20.0 * std::fabs(defect) / delta); }

TEST(RobustLayer, TellsWhetherTheLinearizationHolds) {
  int checked = 0;
  for (const testing::Recipe& recipe : assorted_recipes()) {
    if (!recipe.robust) continue;
    Linearized loop(recipe, 5);
    for (const Real size : {1e-4, 1e-2, 1.0, 100.0}) {
      // the Jacobian's state, the last evaluation's and the new one all differ
      const std::vector<Real> evaluated = loop.near(loop.state, size);
      const std::vector<Real> state = loop.near(evaluated, size);
      const std::vector<Real> weight = loop.near(std::vector<Real>(state.size(), 2.0), 1.0);
      const Real gamma = loop.random.between(0.0, 0.2);
      const std::vector<Real> e0 = loop.errors(loop.state);
      const std::vector<Real> e1 = loop.errors(evaluated);
      const std::vector<Real> e2 = loop.errors(state);
      Real defect = 0.0;
      for (std::size_t p = 0; p < e0.size(); ++p) {
        const Real slope = loop.slope(p, e0[p]);
        const Real missed = std::fabs(loop.phi(p, e2[p]) - loop.phi(p, e1[p]) - slope * (e2[p] - e1[p]));
        const Real share = gamma / (1.0 + gamma * std::min(slope, loop.slope(p, e2[p])));
        const Real delta = loop.game.delta[loop.player(p)];
        defect = std::max(defect, share * counted(missed, delta) * loop.heaviest(static_cast<int>(p), gamma, weight));
      }
      loop.loop.evaluate_seeking(evaluated.data(), nullptr, loop.modes, loop.signals);
      const auto holds = [&](Real tolerance) {
        return loop.layer.linearization_holds(loop.jacobian, loop.signals, loop.modes, state.data(), nullptr, gamma,
                                              weight.data(), tolerance);
      };
      EXPECT_TRUE(holds(1.0001 * defect + 1e-13)) << size;
      if (defect < 1e-10) continue;
      EXPECT_FALSE(holds(0.9999 * defect)) << size;
      ++checked;
    }
  }
  EXPECT_GT(checked, 20);
}

/// Of column 0, the weighted difference between phi after a step from e0 to e1 and what the linearization at e0
/// foretells.
Real defect_of(const Linearized& loop, Real gamma, Real weight, Real e0, Real e1) {
  const Real slope = loop.slope(0, e0);
  const Real missed = loop.phi(0, e1) - loop.phi(0, e0) - slope * (e1 - e0);
  return gamma * counted(missed, loop.game.delta[0]) / (1.0 + gamma * std::min(slope, loop.slope(0, e1))) * weight;
}

TEST(RobustLayer, TellsSoForAnyStepInAStiffLayer) {
  Linearized loop({.seed = 21, .players = 2, .dimension = 1, .neurons = 1, .order = {1, 2}}, 3);
  const Real layer = loop.width(0);
  const Real gamma = 1e3 * layer / loop.game.delta[0];  // a thousand times the inverse of the steepest slope
  const std::vector<Real> weight(loop.state.size(), 3.0);
  const auto with_error = [&](Real error) {
    std::vector<Real> state = loop.state;
    state[0] += error - loop.errors(loop.state)[0];
    return state;
  };
  for (Real from = -3.0; from <= 3.0; from += 0.125) {
    const std::vector<Real> start = with_error(from * layer);
    loop.loop.evaluate_seeking(start.data(), nullptr, loop.modes, loop.signals);
    loop.jacobian.linearize(start.data(), loop.loop.plants(start.data(), nullptr, loop.signals), loop.signals,
                            loop.modes);
    for (Real to = -3.0; to <= 3.0; to += 0.125) {
      const std::vector<Real> state = with_error(to * layer);
      const Real defect = defect_of(loop, gamma, loop.heaviest(0, gamma, weight), from * layer, to * layer);
      if (defect < 1e-8) continue;
      for (const Real part : {0.5, 0.9, 0.999, 1.001}) {
        EXPECT_EQ(loop.layer.linearization_holds(loop.jacobian, loop.signals, loop.modes, state.data(), nullptr, gamma,
                                                 weight.data(), part * defect),
                  part > 1.0)
            << from << " " << to << " " << part;
      }
    }
  }
}

TEST(RobustLayer, StopsInTheMiddleWhatACorrectionCarriedAcross) {
  Linearized loop({.seed = 11, .players = 4, .dimension = 3, .neurons = 2, .order = {1, 2, 2, 1}, .own_gains = true},
                  9);
  const auto with_errors = [&](auto wanted) {  // in layers
    std::vector<Real> state = loop.state;
    const std::vector<Real> errors = loop.errors(state);
    for (int p = 0; p < 12; ++p) state[loop.place(p)] += wanted(p) * loop.width(at(p)) - errors[at(p)];
    return state;
  };
  // by p mod 4: stays outside; carried across; comes from the middle; moves a little within the layer
  const auto choose = [](int p, Real a, Real b, Real c, Real d) { return std::array{a, b, c, d}[at(p % 4)]; };
  const std::vector<Real> from = with_errors([&](int p) { return choose(p, -5.0, 4.0, 0.0, 0.1); });
  const std::vector<Real> to = with_errors([&](int p) { return choose(p, -2.0, -0.5, 5.0, -0.1); });
  loop.loop.evaluate_seeking(from.data(), nullptr, loop.modes, loop.signals);
  std::vector<Real> stopped = to;
  EXPECT_TRUE(loop.layer.stop_in_the_middle(loop.signals, loop.modes, nullptr, stopped.data()));
  const std::vector<Real> errors = loop.errors(stopped);
  std::vector<Real> expected = to;
  for (int p = 1; p < 12; p += 4) {
    EXPECT_NEAR(errors[at(p)], 0.0, 1e-12 * std::fabs(stopped[loop.place(p)]) + 1e-15) << p;
    expected[loop.place(p)] = stopped[loop.place(p)];
  }
  EXPECT_EQ(stopped, expected);
  // nothing was carried across
  loop.loop.evaluate_seeking(stopped.data(), nullptr, loop.modes, loop.signals);
  std::vector<Real> kept = to;
  EXPECT_FALSE(loop.layer.stop_in_the_middle(loop.signals, loop.modes, nullptr, kept.data()));
  EXPECT_EQ(kept, to);
}

TEST(RobustLayer, IsNotThereWithoutTheRobustTerm) {
  Linearized loop({.seed = 12, .players = 3, .dimension = 1, .neurons = 4, .robust = false}, 2);
  std::vector<Real> state = loop.state;
  const std::vector<Real> weight(state.size(), 1.0);
  const std::vector<Real> far = loop.near(state, 1e3);
  EXPECT_TRUE(loop.layer.linearization_holds(loop.jacobian, loop.signals, loop.modes, far.data(), nullptr, 1.0,
                                             weight.data(), 0.0));
  EXPECT_FALSE(loop.layer.stop_in_the_middle(loop.signals, loop.modes, nullptr, state.data()));
  EXPECT_EQ(state, loop.state);
}

}  // namespace
}  // namespace mixed_order_game
