// Why a run stopped: what the state and the signals that it had reached say about it, as parts of a message.
#pragma once

#include <string>

#include "loop/closed_loop.hpp"

namespace mixed_order_game {

std::string number_text(Real value, int digits = 6);

/// Of entry k of the state vector, such as "x[1,2]" or "y[1,3,2]", as the FMU names its variables.
std::string state_name(const ClosedLoop& loop, int k);
/// Of input k.
std::string input_name(const ClosedLoop& loop, int k);

/// Names the player whose state has grown out of all proportion to the initial state, the largest entry and its value;
/// or an input that is out of proportion and no smaller; empty when there is none.
std::string unbounded_growth(const ClosedLoop& loop, const Real* state, const Real* inputs);

/// Names what makes the rates of this evaluation too large to go on with, or not finite: an input, a signal or, when it
/// is none of these, a rate; empty when none is.
std::string unusable_rate(const ClosedLoop& loop, const Real* inputs, const Signals& signals, const Real* rate);

/// The same of the rates at the start, where a gradient that is not finite means first estimates outside of what the
/// cost is defined for.
std::string unusable_start(const ClosedLoop& loop, const Real* inputs, const Signals& signals, const Real* rate);

}  // namespace mixed_order_game
