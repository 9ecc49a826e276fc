// The closed loop as a pure function: state_rate = f(t, state, inputs, modes, parameters), and its output formulas.
//
// Plants, seeking laws, estimates, network and adaptation of the mixed-order game; notation.md lists the symbols.
#pragma once

#include <array>
#include <cmath>

#include "game/parameters.hpp"
#include "loop/input_layout.hpp"
#include "loop/signals.hpp"
#include "loop/state_layout.hpp"
#include "loop/terms.hpp"

namespace mixed_order_game {

/// What hosted players have of their own, at own entries, and what is computed from it alone.
struct GainRows {
  explicit GainRows(const Shape& shape);
  void refresh(const Parameters& parameters);

  AlignedVector k;  ///< k1 (order 1) or k4 (order 2)
  AlignedVector k2;
  std::vector<Real> k3;  ///< by host number
  AlignedVector beta;
  AlignedVector delta;
  AlignedVector sharpness;  ///< K delta / epsilon
  AlignedVector steepest;   ///< K delta^2 / epsilon, the largest slope of the robust term
  AlignedVector curvature;  ///< 4 / (3 sqrt 3) delta (K delta / epsilon)^2, the largest |phi''|
  AlignedVector W_max;
  AlignedVector u_max;                     ///< empty where no control is bounded
  std::vector<Real> own_centers;           ///< as RbfNetwork's, of hosted players, where others are elsewhere
  AlignedVector sharpness_of_activations;  ///< 1 / rho^2, by player
};

/// Actions, and references (order 1) or velocities (order 2), of all players at entry(i, l); 0 where the loop does not
/// know them.
struct Plants {
  const Real* x;
  const Real* reference;
};

class ClosedLoop {
 public:
  explicit ClosedLoop(Parameters parameters);

  [[nodiscard]] const Parameters& parameters() const { return parameters_; }
  /// For edits; call refresh() before the next evaluation.
  [[nodiscard]] Parameters& parameters() { return parameters_; }
  void refresh();

  /// The absolute time [s] from which every t below counts. Near it no time loses digits, whatever the date.
  [[nodiscard]] Real time_origin() const { return time_origin_; }
  void set_time_origin(Real time_origin);

  [[nodiscard]] const Shape& shape() const { return parameters_.shape; }
  [[nodiscard]] const StateLayout& layout() const { return layout_; }
  [[nodiscard]] const GainRows& gains() const { return gains_; }
  [[nodiscard]] const InputLayout& inputs() const { return inputs_; }

  /// state[size()] at the start of a run, from x0, z0, v0, y0 and W0, scaled down to the sphere where it is outside.
  void initial_state(Real* state) const;
  /// The same from other values, such as those of a direction, and not scaled.
  void initial_state(const InitialState& initial, Real* state) const;

  /// Cost, dynamics and disturbance, for what their switches hold.
  enum Family : std::size_t { of_cost, of_dynamics, of_disturbance };
  [[nodiscard]] const Real* held(Family family, const Modes& modes) const {
    return modes.data() + first_switch_[family];
  }

  /// What the plants stand at: in the state, or in the signals' scratch where some of it are inputs.
  Plants plants(const Real* state, const Real* inputs, Signals& signals) const {
    if (!is_whole_) gather_plants(state, inputs, signals);
    return found_plants(state, signals);
  }

  /// The first of the signals: xbar, gradient and error.
  void evaluate_errors(const Real* state, const Real* inputs, const Modes& modes, Signals& signals) const;

  /// Activations and network.
  void evaluate_network(const Real* state, Signals& signals) const;

  /// phi of the signals' errors.
  void evaluate_robust_term(Signals& signals) const;

  /// d phi / d e = K delta^2 / epsilon (1 - (phi / delta)^2) of own entry p, from phi.
  [[nodiscard]] Real robust_term_slope(std::size_t p, Real phi) const {
    const Real delta = gains_.delta[p];
    const Real tanh = delta != 0.0 ? phi / delta : 0.0;
    return gains_.steepest[p] * ((1.0 - tanh) * (1.0 + tanh));
  }

  /// u of own entry p before it is bounded, from what evaluate_seeking sets.
  [[nodiscard]] Real wanted_control(std::size_t p, const Signals& signals) const {
    return terms::control(gains_.k[p], signals.error[p], signals.network[p], signals.robust[p]);
  }
  /// Whether the bound takes its place.
  [[nodiscard]] bool is_bounded(std::size_t p, const Signals& signals) const {
    return !gains_.u_max.empty() && std::fabs(wanted_control(p, signals)) > gains_.u_max[p];
  }

  /// The part of the signals that every player computes from its own state and estimates: xbar, gradient, error,
  /// activations, network and robust term.
  void evaluate_seeking(const Real* state, const Real* inputs, const Modes& modes, Signals& signals) const;

  /// u of the signals' errors, network and robust term.
  void evaluate_control(Signals& signals) const;

  /// All signals and state rates at time_origin() + t [s]; the inputs lie as inputs() says.
  void evaluate(Real t, const Real* state, const Real* inputs, const Modes& modes, Signals& signals, Real* rate) const;

  /// How the rates change by time alone at t, per s, while the inputs stand still: by the disturbances, whose change
  /// over a moment is taken for their derivative. The signals are those at t; d is scratch of own entries.
  void evaluate_rate_by_time(Real t, Real moment, const Real* inputs, const Modes& modes, const Signals& signals,
                             Real* d, Real* rate_by_time) const;

  /// w'w of each weight column, at own entries.
  void weight_norms(const Real* state, Real* norm2) const;

  /// One event function for each column, at own entries, which rises through zero where the column's mode ends: inside,
  /// w'w / W_max - 1; on the sphere, where both 1 - tolerance - w'w / W_max and the rate -2 beta e w'S / W_max at which
  /// w'w falls are positive, the lesser of the two. The sign of e alone is noise where e is below the integrator's
  /// tolerance; that a column has left is certain once w'w has fallen by as much, and until then its rates are those
  /// inside anyway. Never exactly zero. Evaluates errors and network when a column is on the sphere.
  void event_functions(const Real* state, const Real* inputs, const Modes& modes, Real tolerance, Signals& signals,
                       Real* values) const;

  /// Gives the columns whose event functions are positive the other mode. Returns how many there were.
  int resolve_modes(const Real* state, const Real* inputs, Real tolerance, Signals& signals, Modes& modes) const;

  /// Scales columns above the bound back to it, and those on the sphere, where drift has taken them below, up to it.
  /// But where e w'S < 0 a column on the sphere is on its way inward and stays below. Evaluates errors and network when
  /// a column is on the sphere.
  void project(const Modes& modes, const Real* inputs, Signals& signals, Real* state) const;

 private:
  /// Where an own entry lies in a joint action and in the state: -1 where it is an input.
  struct OwnEntry {
    int entry;
    int x;
    int reference;
    bool second;  ///< order 2
  };
  void gather_plants(const Real* state, const Real* inputs, Signals& signals) const;
  /// As plants() found them for this state.
  [[nodiscard]] Plants found_plants(const Real* state, const Signals& signals) const {
    if (is_whole_) return {state + layout_.x(), state + layout_.reference()};
    return {signals.actions.data(), signals.references.data()};
  }
  void add_consensus_with_others(const Real* state, const Real* inputs, Real* rate) const;

  [[nodiscard]] bool is_any_on_sphere(const Modes& modes) const;

  Parameters parameters_;
  StateLayout layout_;
  GainRows gains_;
  InputLayout inputs_;
  bool is_whole_;  // all players with their plants: joint actions lie in the state
  std::vector<OwnEntry> own_;
  std::vector<int> number_heard_;  // of each player elsewhere among those heard, otherwise -1
  std::array<int, 3> first_switch_;
  Real time_origin_ = 0.0;
};

}  // namespace mixed_order_game
