// What goes along with a run and leaves no trace in it.
#pragma once

#include "loop/signals.hpp"
#include "types.hpp"

namespace mixed_order_game {

class StepFollower {
 public:
  virtual ~StepFollower() = default;

  struct Event {
    Real t;
    const Real* state;  ///< continuous there
    const Modes& modes_before;
    const Modes& modes;
    bool restarts;   ///< rates jump, or the integrator begins anew
    bool ends_step;  ///< otherwise the step that was shown last goes on beyond t
  };

  /// A run begins.
  virtual void begin(Real t) = 0;
  /// A step of the integrator ends, whose method had this order; or it has reached an event.
  virtual void step(Real t, int order, const Real* state, const Modes& modes) = 0;
  /// The event, to which the last step led, has been passed.
  virtual void pass_event(const Event& event) = 0;
};

}  // namespace mixed_order_game
