// Loops that host some of the players, or whose plants are partly outside, against the loop of the whole game: what is
// left out of the state comes in by inputs, and nothing else changes.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <map>

#include "equilibrium/equilibrium.hpp"
#include "errors.hpp"
#include "game/game.hpp"
#include "loop/failure.hpp"
#include "loop/loop_tangent.hpp"
#include "loop_matrix.hpp"
#include "newton/newton_solver.hpp"
#include "reference_loop.hpp"

namespace mixed_order_game {
namespace {

using testing::Part;
using testing::PlainGame;
using testing::RandomNumbers;

struct Split {
  testing::Recipe recipe;
  Part part;
};

std::vector<Split> splits() {
  return {
      {{.seed = 1, .players = 3, .dimension = 2, .neurons = 5, .order = {1, 2, 1}}, {.elsewhere = {0, 2}}},
      {{.seed = 2,
        .players = 3,
        .dimension = 2,
        .neurons = 5,
        .diagonal = false,
        .order = {2, 2, 1},
        .own_gains = true},
       {.elsewhere = {1}}},
      {{.seed = 3, .players = 4, .dimension = 1, .neurons = 7, .order = {2, 1, 1, 2}}, {.external = {0, 1}}},
      {{.seed = 5, .players = 5, .dimension = 2, .neurons = 11, .order = {1, 1, 1, 2, 2}},
       {.elsewhere = {0, 3}, .external = {2, 4}}},
      {{.seed = 8, .players = 4, .dimension = 3, .neurons = 6, .robust = false, .order = {2, 1, 2, 1}},
       {.elsewhere = {0, 1, 3}, .external = {2}}},
      {{.seed = 11,
        .players = 13,
        .dimension = 2,
        .neurons = 3,
        .order = {1, 2, 2, 1, 2, 1, 1, 2, 2, 1, 1, 2, 1},
        .own_gains = true},
       {.elsewhere = {2, 7}, .external = {4, 9}}},  // more hosted players than are treated by eigenvectors
  };
}

/// The same state of the whole loop and of its part, with what the part is told.
class HostedPlayers : public ::testing::TestWithParam<Split> {
 protected:
  HostedPlayers() {
    std::vector<std::vector<int>> on_sphere;
    whole_state_ = testing::random_state(game_, random_, on_sphere).flat();
    for (std::size_t l = 0; l < game_.dimension; ++l) {
      for (std::size_t i = 0; i < game_.players; ++i) whole_modes_.push_back(on_sphere[i][l] != 0 ? 1 : 0);
    }
    whole_inputs_.resize(at(whole_.inputs().size()));
    for (Real& d_ext : whole_inputs_) d_ext = random_.between(-1.0, 1.0);
    for (int k = 0; k < whole_.layout().size(); ++k) number_[state_name(whole_, k)] = k;
    for (int k = 0; k < part_.layout().size(); ++k) {
      place_.push_back(number_.at(state_name(part_, k)));
      state_.push_back(whole_state_[at(place_.back())]);
    }
    for (int k = 0; k < part_.inputs().size(); ++k) inputs_.push_back(value_of_input(input_name(part_, k)));
    for (int p = 0; p < part_.shape().own_entries(); ++p) {
      modes_.push_back(whole_modes_[at(part_.shape().entry_of_own(p))]);
    }
  }

  /// Where the whole game has what is an input of the part.
  [[nodiscard]] int source(const std::string& input) const {
    if (!input.starts_with("xbar")) return number_.at(input);
    const std::string index = input.substr(4);
    return number_.at((whole_.shape().is_second_order(std::stoi(index.substr(1)) - 1) ? "x" : "z") + index);
  }
  [[nodiscard]] Real value_of_input(const std::string& input) const {
    for (int k = 0; k < whole_.inputs().size(); ++k) {
      if (input_name(whole_, k) == input) return whole_inputs_[at(k)];
    }
    return whole_state_[at(source(input))];
  }

  PlainGame game_ = testing::random_game(GetParam().recipe);
  ClosedLoop whole_{parse_game(toml_of(game_)).parameters};
  ClosedLoop part_{parse_game(toml_of(game_, GetParam().part)).parameters};
  RandomNumbers random_{500 + GetParam().recipe.seed};
  std::map<std::string, int> number_;  // of the whole state's entries
  std::vector<int> place_;             // of the part's entries in the whole state
  std::vector<Real> whole_state_, whole_inputs_, state_, inputs_;
  Modes whole_modes_, modes_;
};

TEST_P(HostedPlayers, MoveAsInTheWholeLoop) {
  Signals whole_signals(whole_.shape());
  Signals signals(part_.shape());
  std::vector<Real> whole_rate(whole_state_.size());
  std::vector<Real> rate(state_.size());
  whole_.evaluate(0.7, whole_state_.data(), whole_inputs_.data(), whole_modes_, whole_signals, whole_rate.data());
  part_.evaluate(0.7, state_.data(), inputs_.data(), modes_, signals, rate.data());
  Real largest = 0.0;
  for (const Real r : whole_rate) largest = std::max(largest, std::fabs(r));
  for (std::size_t k = 0; k < rate.size(); ++k) {
    EXPECT_NEAR(rate[k], whole_rate[at(place_[k])], 1e-13 * largest) << state_name(part_, static_cast<int>(k));
  }
  for (int p = 0; p < part_.shape().own_entries(); ++p) {
    const std::size_t entry = at(part_.shape().entry_of_own(p));
    EXPECT_NEAR(signals.control[at(p)], whole_signals.control[entry], 1e-13 * largest) << p;
    EXPECT_EQ(signals.shared[entry], whole_signals.shared[entry]) << p;
  }
  std::vector<Real> events(modes_.size());
  std::vector<Real> whole_events(whole_modes_.size());
  part_.event_functions(state_.data(), inputs_.data(), modes_, 1e-6, signals, events.data());
  whole_.event_functions(whole_state_.data(), nullptr, whole_modes_, 1e-6, whole_signals, whole_events.data());
  for (std::size_t p = 0; p < events.size(); ++p) {
    const Real expected = whole_events[at(part_.shape().entry_of_own(static_cast<int>(p)))];
    EXPECT_NEAR(events[p], expected, 1e-12 * std::max(1.0, std::fabs(expected))) << p;
  }
}

TEST_P(HostedPlayers, BeginAsInTheWholeLoop) {
  std::vector<Real> whole(whole_state_.size());
  std::vector<Real> state(state_.size());
  whole_.initial_state(whole.data());
  part_.initial_state(state.data());
  for (std::size_t k = 0; k < state.size(); ++k) EXPECT_EQ(state[k], whole[at(place_[k])]) << k;
}

// The part's Newton matrix is that of the whole loop without the rows and columns of what is left out.
TEST_P(HostedPlayers, HaveTheirRowsAndColumnsOfTheNewtonMatrix) {
  Signals whole_signals(whole_.shape());
  Signals signals(part_.shape());
  LoopJacobian whole_jacobian(whole_);
  LoopJacobian jacobian(part_);
  std::vector<Real> rate(whole_state_.size());
  whole_.evaluate(0.7, whole_state_.data(), whole_inputs_.data(), whole_modes_, whole_signals, rate.data());
  whole_jacobian.linearize(whole_state_.data(), whole_.plants(whole_state_.data(), nullptr, whole_signals),
                           whole_signals, whole_modes_);
  part_.evaluate(0.7, state_.data(), inputs_.data(), modes_, signals, rate.data());
  jacobian.linearize(state_.data(), part_.plants(state_.data(), inputs_.data(), signals), signals, modes_);

  const auto size = static_cast<Eigen::Index>(state_.size());
  std::vector<int> column_of(whole_state_.size(), -1);
  for (std::size_t k = 0; k < place_.size(); ++k) column_of[at(place_[k])] = static_cast<int>(k);
  const auto newton = make_structured_newton();
  newton->refresh(jacobian);
  for (const Real gamma : {1e-4, 1e-2}) {
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(size, size);
    for (const MatrixEntry& entry : matrix_of(whole_jacobian)) {
      const int row = column_of[at(entry.row)];
      const int column = column_of[at(entry.column)];
      if (row >= 0 && column >= 0) matrix(row, column) -= gamma * entry.value;
    }
    Eigen::VectorXd b(size);
    for (double& number : b) number = random_.between(-1.0, 1.0);
    const Eigen::VectorXd expected = matrix.partialPivLu().solve(b);
    ASSERT_TRUE(newton->factor(jacobian, gamma));
    newton->solve(b.data());
    EXPECT_LE((b - expected).cwiseAbs().maxCoeff(), 1e-9 * expected.cwiseAbs().maxCoeff()) << gamma;
  }
}

TEST_P(HostedPlayers, ChangeAlongStateAndInputsAsInTheWholeLoop) {
  LoopTangent whole(whole_);
  LoopTangent part(part_);
  for (Real& change : whole.state) change = random_.between(-1.0, 1.0);
  for (std::size_t k = 0; k < place_.size(); ++k) part.state[k] = whole.state[at(place_[k])];
  for (int k = 0; k < part_.inputs().size(); ++k) {
    const std::string name = input_name(part_, k);
    if (!name.starts_with("d_ext")) part.inputs[at(k)] = whole.state[at(source(name))];
  }
  whole.follow(0.7, whole_state_.data(), whole_inputs_.data(), whole_modes_);
  part.follow(0.7, state_.data(), inputs_.data(), modes_);
  Real largest = 0.0;
  for (const Real r : whole.rate) largest = std::max(largest, std::fabs(r));
  for (std::size_t k = 0; k < place_.size(); ++k) {
    EXPECT_NEAR(part.rate[k], whole.rate[at(place_[k])], 1e-12 * largest) << state_name(part_, static_cast<int>(k));
  }
  for (int p = 0; p < part_.shape().own_entries(); ++p) {
    EXPECT_NEAR(part.control[at(p)], whole.control[at(part_.shape().entry_of_own(p))], 1e-12 * largest) << p;
  }
}

INSTANTIATE_TEST_SUITE_P(Splits, HostedPlayers, ::testing::ValuesIn(splits()),
                         [](const auto& instance) { return "seed" + std::to_string(instance.param.recipe.seed); });

TEST(HostedPlayers, AreNamedInErrorsOfTheGameFile) {
  const PlainGame game = testing::random_game({.seed = 1, .order = {1, 2, 1}});
  const auto complaint = [](std::string text, const std::string& from, const std::string& to) -> std::string {
    text.replace(text.find(from), from.size(), to);
    try {
      parse_game(text);
    } catch (const GameError& error) {
      return error.what();
    }
    return "";
  };
  const std::string external = toml_of(game, {.external = {1}});
  const std::string line = "plant = \"external\"\n";
  EXPECT_EQ(complaint(external, line, "plant = \"mine\"\n"),
            "player[2].plant is \"mine\", expected \"external\", or no plant for one inside the loop");
  for (const std::string key : {"x0", "v0"}) {
    EXPECT_EQ(complaint(external, line, line + key + " = 1.0\n"),
              "player[2]." + key + " is 1, expected no " + key + " of player 2, whose plant is external");
  }
  const std::string alone = toml_of(game, {.elsewhere = {0, 2}});
  EXPECT_EQ(complaint(alone, "elsewhere = true\n", "elsewhere = true\nname = \"a\"\n"),
            "\"name\" is an unknown key of player[1], expected one of elsewhere, order");
  EXPECT_EQ(complaint(alone, "edges = [", "edges = [[1, 3], "),
            "graph.edges[1] is [1, 3], expected an edge of a player that is not elsewhere");
}

}  // namespace
}  // namespace mixed_order_game
