// A run by the importer's integrator: the importer sets time and state, the instance holds the modes of the weight
// columns, which change in event mode only.
#pragma once

#include <cstdint>
#include <span>

#include "evaluation.hpp"
#include "integration/judge.hpp"

namespace mixed_order_game {

class ModelExchange {
 public:
  /// All that a run consists of besides the settings.
  struct Point {
    Real time = 0.0;
    AlignedVector state;
    Modes modes;
    std::int64_t events = 0;  ///< columns that entered or left the sphere, and switches of expressions
    // where the last accepted step ended; the judgement is of the run up to there
    Real accepted_time = 0.0;
    AlignedVector accepted_state = {};
    AlignedVector accepted_inputs = {};
    Judgement judgement = {};
  };

  /// A run that begins. The evaluation must outlive it.
  ModelExchange(Evaluation& evaluation, Real start_time, const AlignedVector& state, const Modes& modes,
                const JudgingRule& rule, std::span<const Real> x_star);
  /// One that goes on from a point.
  ModelExchange(Evaluation& evaluation, Point point, Real start_time);

  [[nodiscard]] Standing standing() const;
  [[nodiscard]] Statistics statistics() const { return {.events = point_.events}; }
  void set_time(Real t);
  void set_state(std::span<const Real> state);

  /// Gives each condition the mode that it has from here on and puts the state within the bound: a column that enters
  /// lies exactly on the sphere then. True when that moved the state. Throws Error, and changes nothing, where a
  /// condition slides.
  bool update_modes(Real tolerance);
  /// The absolute time of the next event that is known beforehand; infinite when there is none.
  [[nodiscard]] Real next_event() const;
  /// Whether one has been passed over.
  [[nodiscard]] bool is_event_due() const;

  /// The importer's step from the last accepted point to this one is accepted: judges it.
  void accept_step();
  /// From here on settings and modes may be others than before, and x* with them.
  void begin_after_event(std::span<const Real> x_star);
  [[nodiscard]] const Judgement& judgement() const { return judge_.judgement(); }
  /// The peak of errors begins anew at the later of the present time and from, in seconds from the start on.
  void begin_errors_anew(Real from);

  [[nodiscard]] Point save() const;

 private:
  void moved();
  Judge::Place place();
  Judge::Place between(Real t);
  void note_accepted();

  Evaluation& evaluation_;
  Point point_;
  Real start_time_;
  Judge judge_;
  Judge::Path path_;  // through the step that was accepted last
  AlignedVector accepted_rate_;
  // scratch
  AlignedVector state_between_;
  AlignedVector inputs_between_;
};

}  // namespace mixed_order_game
