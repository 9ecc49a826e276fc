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

// The tables of calling sequences in sections 3.2.3 and 4.2.4 of FMI 2.0.5, with their notes. "beyond" is what is
// allowed besides, on purpose. Its states stepInProgress, stepFailed and stepCanceled are never reached: no step is
// asynchronous or ends in fmi2Discard.
struct CallRule {
  Call call;
  unsigned standard;
  unsigned beyond = 0;
  unsigned interfaces = both;
};
constexpr CallRule call_rules[] = {
    {Call::set_debug_logging, always},
    {Call::setup_experiment, fresh},
    {Call::enter_initialization, fresh},
    {Call::exit_initialization, initializing},
    // many importers terminate whatever happened before
    {Call::terminate, running, failed},
    {Call::reset, always},
    // importers look at start values; likewise any variable can be read in initialization mode, not only outputs and
    // initial unknowns (note 2), and by co-simulation between a setting call and the next step
    {Call::get_values, initializing | running | ended | failed, fresh},
    {Call::set_reals, fresh | initializing | running},
    {Call::set_discrete_values, fresh | initializing | stepping | at_event},
    // not in the error state, where the standard wants something to debug: a run can never go on from there
    {Call::get_state, fresh | initializing | running | ended},
    {Call::set_state, always},
    {Call::free_state, always},
    {Call::serialize_state, always},
    {Call::get_directional_derivative, initializing | running | ended | failed},
    {Call::set_input_derivatives, fresh | initializing | stepping, 0, co_simulation},
    {Call::get_output_derivatives, stepping | ended | failed, 0, co_simulation},
    {Call::do_step, stepping, 0, co_simulation},
    {Call::cancel_step, 0, 0, co_simulation},
    // how far the run came is asked after a step that failed
    {Call::get_status, stepping | ended, failed, co_simulation},
    {Call::enter_event_mode, at_event | continuous, 0, model_exchange},
    {Call::new_discrete_states, at_event, 0, model_exchange},
    {Call::enter_continuous_time_mode, at_event, 0, model_exchange},
    {Call::completed_integrator_step, continuous, 0, model_exchange},
    // in event mode for models without continuous states only (note 8); importers that never leave it set time there
    {Call::set_time, continuous, at_event, model_exchange},
    {Call::set_continuous_states, continuous, 0, model_exchange},
    {Call::get_continuous_states, initializing | at_event | continuous | ended, 0, model_exchange},
    {Call::get_derivatives, initializing | at_event | continuous | ended, 0, model_exchange},
    {Call::get_event_indicators, initializing | at_event | continuous | ended, 0, model_exchange},
    {Call::get_nominals, always, 0, model_exchange},
};

// Notes 1 and 3 to 6: which variables the calls that set values may name.
struct VariableRule {
  Causality causality;
  Variability variability;
  unsigned standard;
  unsigned beyond = 0;
};
constexpr VariableRule variable_rules[] = {
    {Causality::parameter, Variability::fixed, fresh | initializing},
    {Causality::parameter, Variability::tunable, fresh | initializing | stepping | at_event},
    // importers set all start values at once
    {Causality::input, Variability::continuous, initializing | running, fresh},
};
// By model exchange the importer holds the states (note 5, since 2.0.1); one that never leaves event mode sets them
// there, beyond the standard.
constexpr unsigned states_settable = continuous | at_event;

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

/// The phases in which a variable of this family may be set.
unsigned settable(const Family& family) {
  if (family.state >= 0) return states_settable;
  for (const VariableRule& rule : variable_rules) {
    if (rule.causality == family.causality && rule.variability == family.variability) {
      return rule.standard | rule.beyond;
    }
  }
  return 0;
}

/// The phases that an instance can be in; only an integration of its own can fail.
constexpr unsigned phases_of(Interface interface) {
  return interface == Interface::co_simulation ? always & ~(at_event | continuous) : always & ~(stepping | failed);
}

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

bool is_legal(Call call, Phase phase) {
  const CallRule& rule = rule_of(call);
  return ((rule.standard | rule.beyond) & bit(phase)) != 0;
}

bool belongs_to(Call call, Interface interface) { return (rule_of(call).interfaces & bit(interface)) != 0; }

std::string legal_phases(Call call, Interface interface) {
  std::string text;
  for (int phase = 0; phase < phases; ++phase) {
    const auto one = static_cast<Phase>(phase);
    if (!is_legal(call, one) || (phases_of(interface) & bit(one)) == 0) continue;
    text += (text.empty() ? "" : " or ") + std::string(phase_names[phase]);
  }
  return text.empty() ? "no state" : text;
}

bool may_be_set(const Family& family, Phase phase) { return (settable(family) & bit(phase)) != 0; }

std::string why_not_settable(const Family& family, Phase phase, Interface interface) {
  const bool some_time = (settable(family) & phases_of(interface)) != 0;
  const std::string_view kind = some_time && family.state >= 0 ? "a state" : kind_of(family);
  std::string text = "is " + std::string(kind);
  if (some_time) {
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
