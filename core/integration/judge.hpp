// What judges a run: how long it takes to settle, what the control costs, how far actions go. Found along the
// integrator's own steps and its interpolation between their ends, so that no value depends on how a run is sampled.
//
// A function is known at the ends of the last steps. The parabola through three of them says where it may peak between
// two, and only there is it looked for; the cubic through four gives the integral of u'u, and where that is not certain
// Simpson's rule on halved intervals does.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <span>

#include "loop/closed_loop.hpp"

namespace mixed_order_game {

/// How a run is judged.
struct JudgingRule {
  Real settling_band = 0.0;  ///< |x - x*| that counts as settled; 0: 2 % of the initial one
  Real errors_from = 0.0;    ///< the peak of errors begins here, s
};

/// The values so far, and all that is needed to go on.
struct Judgement {
  Real begun = 0.0;              ///< the run, s
  Real until = 0.0;              ///< up to here, s
  Real last_outside = 0.0;       ///< when |x - x*| last exceeded the band
  bool outside = false;          ///< it still does
  Real control_energy = 0.0;     ///< integral of u'u
  Real control_peak = 0.0;       ///< largest |u| entry
  Real error_peak = 0.0;         ///< largest |x - x*| entry since errors_from
  Real farthest_beyond = 0.0;    ///< how far an entry of x went beyond x*, seen from its start
  Real errors_from = 0.0;        ///< as the rule says
  Real squared_band = 0.0;       ///< 0: the run is settled
  Real largest_deviation = 0.0;  ///< initial |x - x*| entry
  AlignedVector x_star;          ///< in force, at entry(i, l); empty where it is not known, and errors are not judged
  AlignedVector side;            ///< minus the sign of each initial entry of x - x*; empty where x* is not known

  [[nodiscard]] Real settling_time() const { return (outside ? until : last_outside) - begun; }
  /// As a part of the largest initial deviation; 0 where there is none.
  [[nodiscard]] Real overshoot() const { return largest_deviation > 0.0 ? farthest_beyond / largest_deviation : 0.0; }
  friend bool operator==(const Judgement&, const Judgement&) = default;
};

/// Where a step ends.
struct StepEnd {
  Real t;
  const AlignedVector& state;
  const AlignedVector& rate;
};
/// Hermite's cubic through the states and rates at both ends of a step, at time t.
void hermite_cubic(const StepEnd& from, const StepEnd& to, Real t, AlignedVector& state);

class Judge {
 public:
  /// What a run is at a time: its state and the values of its inputs, valid until the next one is asked for.
  struct Place {
    const Real* state;
    const Real* inputs;
  };
  /// Places within the step that is being judged.
  using Path = std::function<Place(Real t)>;

  /// The loop must outlive it.
  explicit Judge(const ClosedLoop& loop);

  /// x* from here on; acts at the next start() or jump().
  void set_equilibrium(std::span<const Real> x_star) { judgement_.x_star.assign(x_star.begin(), x_star.end()); }

  /// A run begins.
  void start(Real t, const JudgingRule& rule, const Place& place, const Modes& modes);
  /// The judgement so far is this one.
  void resume(const Judgement& judgement);
  /// The run goes on from time t, up to which it is judged.
  void stand(Real t, const Place& place, const Modes& modes);
  /// What follows time t has no past: equations, parameters or inputs changed there.
  void jump(Real t, const Place& place, const Modes& modes);
  /// The peak of errors begins anew at the later of t, where the run stands, and from.
  void begin_errors_anew(Real t, Real from, const Place& place);
  /// What follows is judged by this end alone, not by those before.
  void forget_past() { count_ = std::min(count_, 1); }

  /// The end of a step at time t, to be passed once the run has gone beyond it, with e and w'S there. The latter may be
  /// as it was evaluated last, which was for this state but for the last correction of an iteration.
  void note(Real t, const Place& place, const AlignedVector& error, const AlignedVector& network);
  [[nodiscard]] bool has_noted() const { return has_noted_; }
  /// Judges the step up to the end that was noted.
  void pass_noted(const Path& path, const Modes& modes);
  /// Judges up to time t.
  void pass(Real t, const Path& path, const Modes& modes);

  /// Of what was passed.
  [[nodiscard]] const Judgement& judgement() const { return judgement_; }
  /// As pass(t, ...) would leave it.
  [[nodiscard]] Judgement up_to(Real t, const Path& path, const Modes& modes);

 private:
  /// The functions that are judged, at one time.
  struct Node {
    Real t = 0.0;
    Real power = 0.0;                   ///< u'u
    Real square = 0.0;                  ///< (x - x*)'(x - x*)
    std::array<Real, 5> differences{};  ///< of the power: divided ones of orders 0 to 4, with the nodes before
    AlignedVector control;
    AlignedVector deviation;  ///< x - x*
  };
  /// From one end to the next; the third point is the end before, or the middle.
  struct Step {
    const Node* begin;
    const Node* end;
    const Node* third;
    Real h;
    const Path* path;
    const Modes* modes;
  };
  /// Newest first.
  [[nodiscard]] const Node& node(int age) const {
    return nodes_[at((newest_ + age) % static_cast<int>(nodes_.size()))];
  }

  void look(Real t, const Place& place, const Modes& modes, Node& node);
  void look_at_control(Node& node);
  void look_at_deviation(const Place& place, Node& node);
  [[nodiscard]] static bool is_usable(const Node& node);
  void keep(Node& node);
  static void observe(const Node& node, Judgement& judgement);
  [[nodiscard]] static Real error_record(Real t, const Judgement& judgement);
  [[nodiscard]] static bool stays_below(Real record, const Step& step, Real Node::* squared_norm);
  [[nodiscard]] static bool is_outside(Real square, const Judgement& judgement);
  void go_on(Node& end, const Path& path, const Modes& modes, Judgement& judgement);
  /// What is known between two ends.
  Real power_at(Real t, const Step& step);
  const Node& deviation_at(Real t, const Step& step);
  void add_energy(const Step& step, Judgement& judgement);
  Real energy(const Step& step, const std::array<Real, 3>& t, const std::array<Real, 3>& power, Real tolerance,
              int halvings);
  void find_control_peak(const Step& step, Judgement& judgement);
  void find_error_peaks(const Step& step, Judgement& judgement);
  void find_last_outside(const Step& step, Judgement& judgement);

  const ClosedLoop& loop_;
  Judgement judgement_;
  std::array<Node, 4> nodes_;  // ends of steps since the last jump
  int newest_ = 0;
  int count_ = 0;
  Node noted_;
  bool has_noted_ = false;
  // scratch
  Signals signals_;
  Node middle_;
  Node between_;
  Node end_;
};

}  // namespace mixed_order_game
