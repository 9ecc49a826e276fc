// All conditions on which the closed loop's equations depend: the projection's modes, one for each weight column, the
// switches of expressions, and the bounds of controls. Each is held from one event to the next; located ones have an
// event function, those that time alone changes have times that are known beforehand.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "errors.hpp"
#include "loop/closed_loop.hpp"

namespace mixed_order_game {

class LocatedConditions {
 public:
  /// The loop must outlive it. The sizes follow from its game and never change.
  explicit LocatedConditions(const ClosedLoop& loop);

  /// Number of modes: weight columns, then the switches of cost, dynamics and disturbance, then bounded controls, which
  /// are at their bounds by -1 or 1 or between them by 0.
  [[nodiscard]] static int count(const Parameters& parameters);
  /// Number of event functions: of weight columns, then of the switches that are located, then of bounded controls, in
  /// the same order.
  [[nodiscard]] static int located(const Parameters& parameters);
  /// Whether a mode can have a value.
  [[nodiscard]] static bool can_hold(const Parameters& parameters, int k, Real value);

  /// The modes with which a run begins at a time and state: each condition as it is there, columns inside.
  void begin(Real t, const Real* state, const Real* inputs, Modes& modes) const;

  /// They rise through zero where modes end: ClosedLoop::event_functions and Switching::event_functions.
  void event_functions(Real t, const Real* state, const Real* inputs, const Modes& modes, Real tolerance,
                       Signals& signals, Real* values) const;

  /// The absolute time of the next event that is known beforehand; infinite when there is none.
  [[nodiscard]] Real next_event(Real t, const Modes& modes) const;
  /// Whether such an event is due at t and not yet in the modes.
  [[nodiscard]] bool is_due(Real t, const Modes& modes) const;

  struct Change {
    int events = 0;         ///< conditions that changed
    bool restarts = false;  ///< whether rates jumped
  };
  /// Ends the modes whose event functions passed through zero at this point, or all that have ended when passed is
  /// null, then all that have ended by that, until none changes. Throws Error when a condition points back on both
  /// sides.
  Change pass(Real t, const Real* state, const Real* inputs, Real tolerance, const int* passed, Signals& signals,
              Modes& modes) const;

  /// How the time of an event that changed modes moves, where the state just before it moves along a direction, and
  /// with it the bounds W_max of the weights, by player: dt*/dp from the condition that ended there. 0 where time alone
  /// ended it, or none did. The rates are those just before.
  [[nodiscard]] Real event_time_along(Real t, const Real* state, const Real* inputs, const Modes& before,
                                      const Modes& after, const Real* rate_before, const Real* along,
                                      const std::vector<Real>& W_max_along) const;

  /// The switch of an expression that changed last, for messages; empty when there was none.
  [[nodiscard]] const std::string& last_switch() const { return last_switch_; }

 private:
  struct Family {
    const Switching* switching;
    int first;  ///< mode
    bool acts;
  };
  [[nodiscard]] std::array<Family, 3> families() const;
  [[nodiscard]] LeafValues leaves(int family, Real t, const Real* state, const Real* inputs, const Modes& modes) const;
  [[nodiscard]] LeafValues leaves(Real t, const Modes& modes) const;
  [[nodiscard]] int pass_bounds(const Real* state, const Real* inputs, const int* passed, bool jumped, Signals& signals,
                                Modes& modes) const;
  /// Where a control is that is bounded: -1, 0 or 1.
  [[nodiscard]] Real place_of_control(int p, const Signals& signals) const;
  void pass_switches(Real t, const Real* state, const Real* inputs, const int* passed, Modes& modes) const;
  [[nodiscard]] Real switch_rate(int family, int k, Real t, const Real* state, const Real* inputs, const Modes& modes,
                                 const Real* state_rate, Real time_rate) const;
  void refuse_sliding(Real t, const Real* state, const Real* inputs, const Modes& before, const Modes& after) const;

  const ClosedLoop& loop_;
  int columns_;
  std::vector<int> bounded_;  // own entries
  int first_bound_;           // mode
  bool has_switches_;         // beside the columns
  mutable Signals signals_;
  mutable Signals plants_;  // for actions and velocities of all players
  std::vector<Real> inputs_at_rest_;
  mutable std::vector<Real> rate_x_, rate_v_;
  mutable AlignedVector values_, rate_before_, rate_after_;
  mutable Modes before_;
  mutable std::vector<std::vector<bool>> kept_;
  mutable std::string last_switch_;
};

}  // namespace mixed_order_game
