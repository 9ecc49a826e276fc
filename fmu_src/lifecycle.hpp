// Which call is legal in which state of an instance, and when which kind of variable may be set.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "model_variables.hpp"

namespace mixed_order_game {

/// What an instance was made for.
enum class Interface : std::uint8_t { co_simulation, model_exchange };

enum class Phase : std::uint8_t {
  instantiated,
  initialization,
  step_complete,  ///< co-simulation
  event_mode,     ///< model exchange
  continuous_time_mode,
  terminated,
  error
};
inline constexpr int phases = 7;

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

/// As in "a tunable parameter".
std::string_view kind_of(const Family& family);

bool may_be_set(const Family& family, Phase phase);
/// Why a variable of this family cannot be set now.
std::string why_not_settable(const Family& family, Phase phase, Interface interface);

std::string_view name_of(Phase phase);
std::string_view name_of(Interface interface);

}  // namespace mixed_order_game
