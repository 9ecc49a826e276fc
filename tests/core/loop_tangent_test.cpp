#include "loop/loop_tangent.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "families/polynomial_dynamics.hpp"
#include "families/quadratic_cost.hpp"
#include "families/sinusoidal_disturbance.hpp"
#include "game/game.hpp"
#include "reference_loop.hpp"

namespace mixed_order_game {
namespace {

using testing::assorted_recipes;
using testing::Blocks;
using testing::flat_actions;
using testing::LoopSignals;
using testing::LoopState;
using testing::Numbers;
using testing::PlainGame;
using testing::random_game;
using testing::random_state;
using testing::RandomNumbers;
using testing::Recipe;
using testing::reference_rate;
using testing::Rows;
using testing::rows_of;
using testing::toml_of;

constexpr Real t = 0.7;

/// State rate and control, one after the other.
template <typename Scalar>
std::vector<Scalar> rates_and_controls(const PlainGame& game, Real time, const LoopState<Scalar>& state,
                                       const Rows& d_ext, const std::vector<std::vector<int>>& on_sphere) {
  LoopSignals<Scalar> signals;
  std::vector<Scalar> numbers = reference_rate(game, time, state, d_ext, on_sphere, &signals).flat();
  for (std::size_t l = 0; l < game.dimension; ++l) {
    for (std::size_t i = 0; i < game.players; ++i) numbers.push_back(signals.control[i][l]);
  }
  return numbers;
}

std::vector<Real> rates_and_controls(const LoopTangent& tangent) {
  std::vector<Real> numbers(tangent.rate.begin(), tangent.rate.end());
  numbers.insert(numbers.end(), tangent.control.begin(), tangent.control.end());
  return numbers;
}

/// f'(0) from five points, with an error of the order h^4.
std::vector<Real> derivative_of(const std::function<std::vector<Real>(Real)>& f, Real h) {
  const std::vector<Real> near[] = {f(h), f(-h)};
  const std::vector<Real> far[] = {f(2.0 * h), f(-2.0 * h)};
  std::vector<Real> derivative(near[0].size());
  for (std::size_t k = 0; k < derivative.size(); ++k) {
    derivative[k] = (8.0 * (near[0][k] - near[1][k]) - (far[0][k] - far[1][k])) / (12.0 * h);
  }
  return derivative;
}

void expect_close(const std::vector<Real>& computed, const std::vector<Real>& expected, Real tolerance,
                  const std::string& what) {
  ASSERT_EQ(computed.size(), expected.size());
  Real largest = 1.0;
  for (const Real entry : expected) largest = std::max(largest, std::abs(entry));
  for (std::size_t k = 0; k < expected.size(); ++k) {
    ASSERT_NEAR(computed[k], expected[k], tolerance * largest) << what << ", entry " << k;
  }
}

class LoopTangentOfRandomGame : public ::testing::TestWithParam<Recipe> {
 protected:
  PlainGame game_ = random_game(GetParam());
  ClosedLoop loop_{parse_game(toml_of(game_)).parameters};
  LoopTangent tangent_{loop_};
  AlignedVector no_inputs_ = AlignedVector(at(loop_.inputs().size()));
  RandomNumbers random_{3000 + GetParam().seed};
  std::size_t size_ = at(loop_.layout().size());

  Modes modes_of(const std::vector<std::vector<int>>& on_sphere) const {
    Modes modes;
    for (std::size_t l = 0; l < game_.dimension; ++l) {
      for (std::size_t i = 0; i < game_.players; ++i) modes.push_back(on_sphere[i][l] != 0 ? 1 : 0);
    }
    return modes;
  }
};

TEST_P(LoopTangentOfRandomGame, FollowsTheState) {
  std::vector<std::vector<int>> on_sphere;
  LoopState<Real> state = random_state(game_, random_, on_sphere);
  const Rows no_input = rows_of(game_.players, game_.dimension);
  constexpr Real h = 1e-30;
  for (int repeat = 0; repeat < 5; ++repeat) {
    Numbers direction(size_);
    random_.fill(direction, -1.0, 1.0);
    std::copy(direction.begin(), direction.end(), tangent_.state.begin());
    tangent_.follow(t, state.flat().data(), no_inputs_.data(), modes_of(on_sphere));
    std::vector<std::complex<Real>> moved;
    const std::vector<Real> flat = state.flat();
    for (std::size_t k = 0; k < size_; ++k) moved.emplace_back(flat[k], h * direction[k]);
    LoopState<std::complex<Real>> complex_state(game_);
    complex_state.set_flat(moved);
    std::vector<Real> expected;
    for (const auto& number : rates_and_controls(game_, t, complex_state, no_input, on_sphere)) {
      expected.push_back(number.imag() / h);
    }
    expect_close(rates_and_controls(tangent_), expected, 1e-13, "along a state");
  }
}

TEST_P(LoopTangentOfRandomGame, FollowsInputsAndTime) {
  std::vector<std::vector<int>> on_sphere;
  LoopState<Real> state = random_state(game_, random_, on_sphere);
  Rows d_ext = rows_of(game_.players, game_.dimension);
  Rows direction = d_ext;
  random_.fill(d_ext, -1.0, 1.0);
  random_.fill(direction, -1.0, 1.0);
  constexpr Real time_direction = 0.3;
  const Numbers input = flat_actions(direction);
  std::copy(input.begin(), input.end(), tangent_.inputs.begin());
  tangent_.time = time_direction;
  tangent_.follow(t, state.flat().data(), no_inputs_.data(), modes_of(on_sphere));
  const auto along = [&](Real s) {
    Rows moved = d_ext;
    for (std::size_t i = 0; i < game_.players; ++i) {
      for (std::size_t l = 0; l < game_.dimension; ++l) moved[i][l] += s * direction[i][l];
    }
    return rates_and_controls(game_, t + s * time_direction, state, moved, on_sphere);
  };
  expect_close(rates_and_controls(tangent_), derivative_of(along, 1e-3), 1e-9, "along inputs and time");
}

TEST_P(LoopTangentOfRandomGame, AlongTimeIsTheRateByTime) {
  std::vector<std::vector<int>> on_sphere;
  const AlignedVector state = [&] {
    const std::vector<Real> flat = random_state(game_, random_, on_sphere).flat();
    return AlignedVector(flat.begin(), flat.end());
  }();
  const Modes modes = modes_of(on_sphere);
  Numbers inputs(no_inputs_.size());
  random_.fill(inputs, -1.0, 1.0);
  tangent_.time = 1.0;
  tangent_.follow(t, state.data(), inputs.data(), modes);
  Signals signals(loop_.shape());
  AlignedVector rate(size_), by_time(size_), d(at(loop_.shape().own_entries()));
  loop_.evaluate(t, state.data(), inputs.data(), modes, signals, rate.data());
  loop_.evaluate_rate_by_time(t, 1e-7, inputs.data(), modes, signals, d.data(), by_time.data());
  expect_close({by_time.begin(), by_time.end()}, {tangent_.rate.begin(), tangent_.rate.end()}, 1e-5, "along time");
}

/// One kind of parameter: how to move it in the plain game, and the direction's coefficients in the core's order.
struct Move {
  std::string name;
  std::function<void(PlainGame&, Real)> plain;
  std::function<void(Parameters&)> core;
};

std::vector<Move> moves_of(const PlainGame& game, RandomNumbers& random) {
  const std::size_t N = game.players;
  const std::size_t D = game.dimension;
  std::vector<Move> moves;
  const auto add_gain = [&](const char* name, Numbers PlainGame::* plain, std::vector<Real> Gains::* core) {
    Numbers gains(N);
    random.fill(gains, -1.0, 1.0);
    moves.push_back({name,
                     [=](PlainGame& moved, Real s) {
                       for (std::size_t i = 0; i < N; ++i) (moved.*plain)[i] += s * gains[i];
                     },
                     [=](Parameters& direction) { direction.gains.*core = gains; }});
  };
  add_gain("k1", &PlainGame::k1, &Gains::k1);
  add_gain("k2", &PlainGame::k2, &Gains::k2);
  add_gain("k3", &PlainGame::k3, &Gains::k3);
  add_gain("k4", &PlainGame::k4, &Gains::k4);
  add_gain("beta", &PlainGame::beta, &Gains::beta);
  add_gain("delta", &PlainGame::delta, &Gains::delta);
  add_gain("epsilon", &PlainGame::epsilon, &Gains::epsilon);
  Numbers widths(N);
  random.fill(widths, -1.0, 1.0);
  moves.push_back({"width",
                   [=](PlainGame& moved, Real s) {
                     for (std::size_t i = 0; i < N; ++i) moved.width[i] += s * widths[i];
                   },
                   [=](Parameters& direction) { direction.rbf.width = widths; }});

  Blocks centers(N, game.centers[0]);  // the same of all players where they have one network
  random.fill(centers[0], -1.0, 1.0);
  for (std::size_t i = 1; i < N; ++i) centers[i] = centers[0];
  if (game.own_rbf) random.fill(centers, -1.0, 1.0);
  moves.push_back({"centers",
                   [=](PlainGame& moved, Real s) {
                     for (std::size_t i = 0; i < N; ++i) {
                       for (std::size_t m = 0; m < centers[i].size(); ++m) {
                         for (std::size_t k = 0; k < centers[i][m].size(); ++k) {
                           moved.centers[i][m][k] += s * centers[i][m][k];
                         }
                       }
                     }
                   },
                   [=](Parameters& direction) {
                     RbfNetwork& rbf = direction.rbf;
                     for (std::size_t i = 0; i < N; ++i) {
                       for (std::size_t m = 0; m < centers[i].size(); ++m) {
                         const std::size_t row = rbf.row(static_cast<int>(m), static_cast<int>(i));
                         if (rbf.diagonal) {
                           rbf.centers[m * N + i] = centers[i][m][0];
                           continue;
                         }
                         for (std::size_t k = 0; k < N * D; ++k) {
                           rbf.centers[row * N * D + (k % D) * N + k / D] = centers[i][m][k];
                         }
                       }
                     }
                   }});

  Rows weights = rows_of(N, N);  // edges of weight zero are moved as well
  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t j = 0; j < i; ++j) weights[i][j] = weights[j][i] = random.between(-1.0, 1.0);
    for (std::size_t j = 0; game.directed && j < i; ++j) weights[j][i] = random.between(-1.0, 1.0);
  }
  moves.push_back({"adjacency",
                   [=](PlainGame& moved, Real s) {
                     for (std::size_t i = 0; i < N; ++i) {
                       for (std::size_t j = 0; j < N; ++j) moved.adjacency[i][j] += s * weights[i][j];
                     }
                   },
                   [=](Parameters& direction) {
                     for (std::size_t i = 0; i < N; ++i) {
                       for (std::size_t j = 0; j < N; ++j) {
                         if (j != i)
                           direction.graph.set_weight(static_cast<int>(i), static_cast<int>(j), weights[i][j]);
                       }
                     }
                   }});

  Rows coupling = rows_of(N, N);
  random.fill(coupling, -1.0, 1.0);
  for (std::size_t i = 0; i < N; ++i) coupling[i][i] = 0.0;
  moves.push_back({"coupling",
                   [=](PlainGame& moved, Real s) {
                     for (std::size_t i = 0; i < N; ++i) {
                       for (std::size_t j = 0; j < N; ++j) moved.coupling[i][j] += s * coupling[i][j];
                     }
                   },
                   [=](Parameters& direction) {
                     for (std::size_t i = 0; i < N; ++i) {
                       for (std::size_t j = 0; j < N; ++j)
                         direction.cost->coefficients[QuadraticCost::coupling][i * N + j] = coupling[i][j];
                     }
                   }});
  Numbers quadratic(N);
  random.fill(quadratic, -1.0, 1.0);
  moves.push_back({"quadratic",
                   [=](PlainGame& moved, Real s) {
                     for (std::size_t i = 0; i < N; ++i) moved.quadratic[i] += s * quadratic[i];
                   },
                   [=](Parameters& direction) { direction.cost->coefficients[QuadraticCost::quadratic] = quadratic; }});
  const auto add_rows = [&](const char* name, Rows PlainGame::* plain,
                            const std::function<void(Parameters&, const Numbers&)>& core) {
    Rows rows = rows_of(N, D);
    random.fill(rows, -1.0, 1.0);
    moves.push_back({name,
                     [=](PlainGame& moved, Real s) {
                       for (std::size_t i = 0; i < N; ++i) {
                         for (std::size_t l = 0; l < D; ++l) (moved.*plain)[i][l] += s * rows[i][l];
                       }
                     },
                     [=](Parameters& direction) { core(direction, flat_actions(rows)); }});
  };
  add_rows("linear", &PlainGame::linear,
           [](Parameters& to, const Numbers& v) { to.cost->coefficients[QuadraticCost::linear] = v; });
  add_rows("amplitude", &PlainGame::amplitude, [](Parameters& to, const Numbers& v) {
    to.disturbance->coefficients[SinusoidalDisturbance::amplitude] = v;
  });
  add_rows("frequency", &PlainGame::frequency, [](Parameters& to, const Numbers& v) {
    to.disturbance->coefficients[SinusoidalDisturbance::frequency] = v;
  });
  add_rows("phase", &PlainGame::phase,
           [](Parameters& to, const Numbers& v) { to.disturbance->coefficients[SinusoidalDisturbance::phase] = v; });
  add_rows("bias", &PlainGame::bias,
           [](Parameters& to, const Numbers& v) { to.disturbance->coefficients[SinusoidalDisturbance::bias] = v; });
  add_rows("x0", &PlainGame::x0, [](Parameters& to, const Numbers& v) { to.initial.x = v; });
  Blocks y0 = game.y0;
  random.fill(y0, -1.0, 1.0);
  moves.push_back({"y0",
                   [=](PlainGame& moved, Real s) {
                     for (std::size_t i = 0; i < N; ++i) {
                       for (std::size_t j = 0; j < N; ++j) {
                         for (std::size_t l = 0; l < D; ++l) moved.y0[i][j][l] += s * y0[i][j][l];
                       }
                     }
                   },
                   [=](Parameters& direction) {
                     for (std::size_t i = 0; i < N; ++i) {
                       const Numbers row = flat_actions(y0[i]);
                       std::copy(row.begin(), row.end(), direction.initial.y.begin() + static_cast<long>(i * N * D));
                     }
                   }});
  add_rows("reference0", &PlainGame::reference0, [](Parameters& to, const Numbers& v) { to.initial.reference = v; });

  if (!game.W0.empty()) {
    Blocks W0 = game.W0;
    random.fill(W0, -1.0, 1.0);
    moves.push_back({"W0",
                     [=](PlainGame& moved, Real s) {
                       for (std::size_t i = 0; i < N; ++i) {
                         for (std::size_t m = 0; m < W0[i].size(); ++m) {
                           for (std::size_t l = 0; l < D; ++l) moved.W0[i][m][l] += s * W0[i][m][l];
                         }
                       }
                     },
                     [=](Parameters& direction) {
                       for (std::size_t i = 0; i < N; ++i) {
                         for (std::size_t m = 0; m < W0[i].size(); ++m) {
                           for (std::size_t l = 0; l < D; ++l) {
                             direction.initial.W[m * N * D + l * N + i] = W0[i][m][l];
                           }
                         }
                       }
                     }});
  }

  Numbers gain(N);  // the plain game has no gain: scaling its coefficients is the same
  random.fill(gain, -1.0, 1.0);
  moves.push_back({"dynamics_gain",
                   [=](PlainGame& moved, Real s) {
                     for (std::size_t i = 0; i < N; ++i) {
                       for (auto* blocks : {&moved.G, &moved.H}) {
                         for (Numbers& coefficients : (*blocks)[i]) {
                           for (double& coefficient : coefficients) coefficient *= 1.0 + s * gain[i];
                         }
                       }
                     }
                   },
                   [=](Parameters& direction) { direction.dynamics->coefficients[PolynomialDynamics::gain] = gain; }});
  return moves;
}

TEST_P(LoopTangentOfRandomGame, FollowsParametersAtTheStart) {
  const std::vector<std::vector<int>> inside(game_.players, std::vector<int>(game_.dimension));
  const Rows no_input = rows_of(game_.players, game_.dimension);
  const auto start_of = [](const PlainGame& game) {
    LoopState<Real> state(game);
    state.x = game.x0;
    state.reference = game.reference0;
    state.y = game.y0;
    if (!game.W0.empty()) state.W = game.W0;
    return state;
  };
  std::vector<Real> initial_state(size_);
  loop_.initial_state(initial_state.data());
  for (const Move& move : moves_of(game_, random_)) {
    Parameters direction = loop_.parameters().zero_direction();
    move.core(direction);
    direction.refresh();
    tangent_.follow_parameters(direction, t, initial_state.data(), no_inputs_.data(), modes_of(inside));
    const auto along = [&](Real s) {
      PlainGame moved = game_;
      move.plain(moved, s);
      return rates_and_controls(moved, t, start_of(moved), no_input, inside);
    };
    expect_close(rates_and_controls(tangent_), derivative_of(along, 2e-3), 1e-8, "along " + move.name);
  }
}

INSTANTIATE_TEST_SUITE_P(Assorted, LoopTangentOfRandomGame, ::testing::ValuesIn(assorted_recipes()),
                         [](const auto& instance) { return "seed" + std::to_string(instance.param.seed); });

TEST(LoopTangent, OfAnAmplitudeOfZeroHasNoRobustTerm) {
  PlainGame game = random_game({.seed = 42, .players = 2, .dimension = 3, .neurons = 4, .order = {2, 1}});
  game.delta = everyone(game, 0.0);
  const ClosedLoop loop(parse_game(toml_of(game)).parameters);
  std::vector<Real> state(at(loop.layout().size()));
  loop.initial_state(state.data());
  Parameters direction = loop.parameters().zero_direction();
  direction.gains.delta = direction.gains.epsilon = everyone(game, 1.0);
  LoopTangent tangent(loop);
  const AlignedVector no_inputs(at(loop.inputs().size()));
  tangent.follow_parameters(direction, t, state.data(), no_inputs.data(), Modes(at(loop.shape().actions())));
  for (const Real change : rates_and_controls(tangent)) EXPECT_EQ(change, 0.0);
}

}  // namespace
}  // namespace mixed_order_game
