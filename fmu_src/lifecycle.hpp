// Which call is legal in which state of an instance, and when which kind of variable may be set.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "model_variables.hpp"

namespace mixed_order_game {

enum class Phase : std::uint8_t { instantiated, initialization, step_complete, terminated, error };
inline constexpr int phases = 5;

enum class Call : std::uint8_t {
  set_debug_logging,
  setup_experiment,
  enter_initialization,
  exit_initialization,
  terminate,
  reset,
  get_values,
  set_values,
  get_state,
  set_state,
  free_state,
  serialize_state,
  get_directional_derivative,
  set_input_derivatives,
  get_output_derivatives,
  do_step,
  cancel_step,
  get_status,
  model_exchange,  ///< any call of model exchange
};

bool is_legal(Call call, Phase phase);
/// As in "instantiated or initialization mode".
std::string legal_phases(Call call);

/// As in "a tunable parameter".
std::string_view kind_of(const Family& family);

bool may_be_set(const Family& family, Phase phase);
/// Why a variable of this family cannot be set now.
std::string why_not_settable(const Family& family, Phase phase);

std::string_view name_of(Phase phase);

}  // namespace mixed_order_game
