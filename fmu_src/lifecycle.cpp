#include "lifecycle.hpp"

#include <iterator>

namespace mixed_order_game {

namespace {

constexpr unsigned bit(Phase phase) { return 1U << static_cast<unsigned>(phase); }

constexpr unsigned fresh = bit(Phase::instantiated);
constexpr unsigned initializing = bit(Phase::initialization);
constexpr unsigned stepping = bit(Phase::step_complete);
constexpr unsigned at_event = bit(Phase::event_mode);
constexpr unsigned continuous = bit(Phase::continuous_time_mode);
constexpr unsigned running = stepping | at_event | continuous;
constexpr unsigned ended = bit(Phase::terminated);
constexpr unsigned failed = bit(Phase::error);
constexpr unsigned always = fresh | initializing | running | ended | failed;

constexpr unsigned bit(Interface interface) { return 1U << static_cast<unsigned>(interface); }

constexpr unsigned co_simulation = bit(Interface::co_simulation);
constexpr unsigned model_exchange = bit(Interface::model_exchange);
constexpr unsigned both = co_simulation | model_exchange;

// The standard's tables for co-simulation and model exchange. Allowed beyond them, because importers rely on it and
// nothing is lost: reading any variable before initialization ends, setting inputs and reading or restoring states
// right after instantiation, reading derivatives in initialization mode and nominal values in every state, and all that
// still makes sense after a failed integration.
struct CallRule {
  Call call;
  unsigned legal;
  unsigned interfaces = both;
};
constexpr CallRule call_rules[] = {
    {Call::set_debug_logging, always},
    {Call::setup_experiment, fresh},
    {Call::enter_initialization, fresh},
    {Call::exit_initialization, initializing},
    {Call::terminate, running | failed},
    {Call::reset, always},
    {Call::get_values, always},
    {Call::set_values, fresh | initializing | running},
    {Call::get_state, fresh | initializing | running | ended},
    {Call::set_state, always},
    {Call::free_state, always},
    {Call::serialize_state, always},
    {Call::get_directional_derivative, initializing | running | ended},
    {Call::set_input_derivatives, fresh | initializing | stepping, co_simulation},
    {Call::get_output_derivatives, stepping | ended | failed, co_simulation},
    {Call::do_step, stepping, co_simulation},
    {Call::cancel_step, 0, co_simulation},  // only while an asynchronous step runs, and there are none
    {Call::get_status, always, co_simulation},
    {Call::enter_event_mode, at_event | continuous, model_exchange},
    {Call::new_discrete_states, at_event, model_exchange},
    {Call::enter_continuous_time_mode, at_event, model_exchange},
    {Call::completed_integrator_step, continuous, model_exchange},
    {Call::set_time, at_event | continuous, model_exchange},
    {Call::set_continuous_states, continuous, model_exchange},
    {Call::get_continuous_states, initializing | at_event | continuous | ended, model_exchange},
    {Call::get_derivatives, initializing | at_event | continuous | ended, model_exchange},
    {Call::get_event_indicators, initializing | at_event | continuous | ended, model_exchange},
    {Call::get_nominals, always, model_exchange},
};

struct VariableRule {
  Causality causality;
  Variability variability;
  unsigned settable;
};
constexpr VariableRule variable_rules[] = {
    {Causality::parameter, Variability::fixed, fresh | initializing},
    {Causality::parameter, Variability::tunable, fresh | initializing | stepping | at_event},
    {Causality::input, Variability::continuous, fresh | initializing | running},
};

constexpr std::string_view phase_names[] = {"instantiated", "initialization mode",  "step complete",
                                            "event mode",   "continuous-time mode", "terminated",
                                            "error"};
static_assert(std::size(phase_names) == phases);

constexpr bool in_order_of_calls() {
  for (std::size_t k = 0; k < std::size(call_rules); ++k) {
    if (static_cast<std::size_t>(call_rules[k].call) != k) return false;
  }
  return std::size(call_rules) == static_cast<std::size_t>(Call::get_nominals) + 1;
}
static_assert(in_order_of_calls());

constexpr const CallRule& rule_of(Call call) { return call_rules[static_cast<std::size_t>(call)]; }

}  // namespace

std::string_view kind_of(const Family& family) {
  switch (family.causality) {
    case Causality::parameter:
      return family.variability == Variability::fixed ? "a fixed parameter" : "a tunable parameter";
    case Causality::calculated_parameter:
      return "a calculated parameter";
    case Causality::input:
      return "an input";
    case Causality::output:
      return "an output";
    case Causality::local:
      return family.variability == Variability::constant ? "a constant" : "a local variable";
    case Causality::independent:
      return "the independent variable";
  }
  return "";
}

bool is_legal(Call call, Phase phase) { return (rule_of(call).legal & bit(phase)) != 0; }

bool belongs_to(Call call, Interface interface) { return (rule_of(call).interfaces & bit(interface)) != 0; }

std::string legal_phases(Call call, Interface interface) {
  const unsigned of_the_other = interface == Interface::co_simulation ? at_event | continuous : stepping;
  std::string text;
  for (int phase = 0; phase < phases; ++phase) {
    if ((rule_of(call).legal & ~of_the_other & bit(static_cast<Phase>(phase))) == 0) continue;
    text += (text.empty() ? "" : " or ") + std::string(phase_names[phase]);
  }
  return text.empty() ? "no state" : text;
}

bool may_be_set(const Family& family, Phase phase) {
  for (const VariableRule& rule : variable_rules) {
    if (rule.causality == family.causality && rule.variability == family.variability) {
      return (rule.settable & bit(phase)) != 0;
    }
  }
  return false;
}

std::string why_not_settable(const Family& family, Phase phase) {
  std::string text = "is " + std::string(kind_of(family));
  if (may_be_set(family, Phase::instantiated)) {
    text += ", which cannot be set in the state " + std::string(name_of(phase));
  } else {
    text += " and cannot be set";
  }
  return text;
}

std::string_view name_of(Phase phase) { return phase_names[static_cast<std::size_t>(phase)]; }

std::string_view name_of(Interface interface) {
  return interface == Interface::co_simulation ? "co-simulation" : "model exchange";
}

}  // namespace mixed_order_game
