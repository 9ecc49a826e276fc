// The switches of all players' expressions for one purpose: which values they hold at a point, where these end, and, of
// those that time alone changes, when.
//
// A located switch has an event function, which rises through zero where its held value ends. The events of a timed
// switch, whose s is affine in time, are known beforehand: level k is reached when s = k step, and what it holds from
// then on follows from the time itself, so that no rounding of s moves it.
#pragma once

#include <memory>
#include <string>

#include "expression/player_expressions.hpp"

namespace mixed_order_game {

class Switching {
 public:
  struct OfPlayer {
    int row;     ///< of points: the number among the hosted players
    int player;  ///< from zero, for messages
    std::shared_ptr<const ExpressionGraph> graph;
  };

  Switching() = default;
  /// The switches of all graphs, whose numbers follow each other; of says in messages what they are, as in "cost".
  Switching(const std::vector<OfPlayer>& graphs, const std::string& of, int rows, int actions, int parameters);

  [[nodiscard]] int count() const { return static_cast<int>(switches_.size()); }
  [[nodiscard]] bool is_located(int k) const { return !switches_[at(k)].is_timed; }
  /// Whether nothing jumps where it switches.
  [[nodiscard]] bool is_bend(int k) const { return switches_[at(k)].is_bend; }
  /// As in: the condition "x[1] > 0" in the cost of player 1.
  [[nodiscard]] const std::string& description(int k) const { return switches_[at(k)].text; }
  /// Whether it can hold a value.
  [[nodiscard]] bool can_hold(int k, Real value) const;

  /// What is held at a point, each as its own condition says there; timed ones as just after the time origin + t.
  /// leaves.time and leaves.held are not read.
  void own_values(LeafValues leaves, Real origin, Real t, Real* held) const;
  /// The same of one of them after its event function passed through zero at the point.
  [[nodiscard]] Real next_value(int k, const LeafValues& leaves) const;
  /// Gives those that are not kept the values that they have once what they held has ended; true when any changed.
  bool settle(LeafValues leaves, Real origin, Real t, const std::vector<bool>& kept, Real* held) const;

  /// value[k] of located switches in the order of their numbers: positive where the held value has ended; never zero,
  /// and -1 where nothing depends on it or s is not finite.
  void event_functions(const LeafValues& leaves, Real* value) const;
  [[nodiscard]] int located() const { return located_; }
  /// Whether something depends on it.
  [[nodiscard]] bool is_active(int k, const LeafValues& leaves) const;

  /// ds/dt of switch k along rates of actions, velocities and time (1 along a run).
  [[nodiscard]] Real rate(int k, const LeafValues& leaves, const LeafValues& rates) const;

  /// The absolute time of the next event of a timed switch after origin + t; infinite when there is none.
  [[nodiscard]] Real next_event(const LeafValues& leaves, Real origin, Real t) const;

  /// Throws GameError that names what stands in a text, when a parameter has a value that it cannot have there.
  void judge(const Real* parameters) const;

 private:
  struct Compiled {
    SwitchKind kind;
    bool is_timed;
    bool is_bend;
    bool has_step;
    bool has_guard;
    int row;
    std::string text;
  };
  struct Judged {
    Requirement::Kind kind;
    std::string text;
  };
  void evaluate(const LeafValues& leaves) const;
  void evaluate_times(const LeafValues& leaves) const;
  [[nodiscard]] Real own_value(int k) const;
  [[nodiscard]] Real event_function(int k, Real held) const;
  [[nodiscard]] bool is_masked(int k) const {
    return switches_[at(k)].has_guard && step_and_guard_[at(2 * k + 1)] == 0.0;
  }
  [[nodiscard]] Real timed_value(int k, Real origin, Real t) const;
  [[nodiscard]] Real time_of_level(int k, Real level) const;
  [[nodiscard]] static bool is_reached(Real time, Real origin, Real t);

  std::vector<Compiled> switches_;
  int located_ = 0;
  bool has_timed_ = false;
  PlayerExpressions values_;  // s
  Tapes steps_and_guards_;    // at 2 k and 2 k + 1
  Tapes requirements_;
  std::vector<Judged> judged_;
  // of the last evaluation
  mutable std::vector<Real> value_, step_and_guard_, slope_, offset_, entries_;
};

}  // namespace mixed_order_game
