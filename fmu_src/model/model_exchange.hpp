// A run by the importer's integrator: the importer sets time and state, the instance holds the modes of the weight
// columns, which change in event mode only.
#pragma once

#include <cstdint>
#include <span>

#include "evaluation.hpp"

namespace mixed_order_game {

class ModelExchange {
 public:
  /// All that a run consists of besides the settings.
  struct Point {
    Real time = 0.0;
    AlignedVector state;
    Modes modes;
    std::int64_t events = 0;  ///< columns that entered or left the sphere, and switches of expressions
  };

  /// The evaluation must outlive the run.
  ModelExchange(Evaluation& evaluation, Point start, Real start_time);

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

  [[nodiscard]] const Point& save() const { return point_; }

 private:
  void moved();

  Evaluation& evaluation_;
  Point point_;
  Real start_time_;
};

}  // namespace mixed_order_game
