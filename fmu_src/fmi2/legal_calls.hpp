// Which call of FMI 2.0 is legal in which state of an instance.
#pragma once

#include <cstdint>
#include <string>

#include "lifecycle.hpp"

namespace mixed_order_game {

enum class Call : std::uint8_t {
  set_debug_logging,
  setup_experiment,
  enter_initialization,
  exit_initialization,
  terminate,
  reset,
  get_values,
  set_reals,
  set_discrete_values,  ///< of the other types
  get_state,
  set_state,
  free_state,
  serialize_state,
  get_directional_derivative,
  // co-simulation
  set_input_derivatives,
  get_output_derivatives,
  do_step,
  cancel_step,
  get_status,
  // model exchange
  enter_event_mode,
  new_discrete_states,
  enter_continuous_time_mode,
  completed_integrator_step,
  set_time,
  set_continuous_states,
  get_continuous_states,
  get_derivatives,
  get_event_indicators,
  get_nominals,
};

bool is_legal(Call call, Phase phase);
bool belongs_to(Call call, Interface interface);
/// As in "instantiated or initialization mode".
std::string legal_phases(Call call, Interface interface);

}  // namespace mixed_order_game
