// The states of an instance, and in which of them which kind of variable may be set.
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

/// Several phases, one bit each.
using PhaseSet = unsigned;

namespace phase_set {

constexpr PhaseSet bit(Phase phase) { return 1U << static_cast<unsigned>(phase); }

inline constexpr PhaseSet fresh = bit(Phase::instantiated);
inline constexpr PhaseSet initializing = bit(Phase::initialization);
inline constexpr PhaseSet stepping = bit(Phase::step_complete);
inline constexpr PhaseSet at_event = bit(Phase::event_mode);
inline constexpr PhaseSet continuous = bit(Phase::continuous_time_mode);
inline constexpr PhaseSet running = stepping | at_event | continuous;
inline constexpr PhaseSet ended = bit(Phase::terminated);
inline constexpr PhaseSet failed = bit(Phase::error);
inline constexpr PhaseSet always = fresh | initializing | running | ended | failed;

/// In which an instance can be; only an integration of its own can fail.
constexpr PhaseSet of(Interface interface) {
  return interface == Interface::co_simulation ? always & ~(at_event | continuous) : always & ~(stepping | failed);
}

}  // namespace phase_set

/// As in "a tunable parameter".
std::string_view kind_of(const Family& family);

bool may_be_set(const Family& family, Phase phase);
/// Why a variable of this family cannot be set now.
std::string why_not_settable(const Family& family, Phase phase, Interface interface);

std::string_view name_of(Phase phase);
std::string_view name_of(Interface interface);

}  // namespace mixed_order_game
