#include "legal_calls.hpp"

#include <iterator>

namespace mixed_order_game {

namespace {

using namespace phase_set;

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

constexpr bool in_order_of_calls() {
  for (std::size_t k = 0; k < std::size(call_rules); ++k) {
    if (static_cast<std::size_t>(call_rules[k].call) != k) return false;
  }
  return std::size(call_rules) == static_cast<std::size_t>(Call::get_nominals) + 1;
}
static_assert(in_order_of_calls());

constexpr const CallRule& rule_of(Call call) { return call_rules[static_cast<std::size_t>(call)]; }

}  // namespace

bool is_legal(Call call, Phase phase) {
  const CallRule& rule = rule_of(call);
  return ((rule.standard | rule.beyond) & bit(phase)) != 0;
}

bool belongs_to(Call call, Interface interface) { return (rule_of(call).interfaces & bit(interface)) != 0; }

std::string legal_phases(Call call, Interface interface) {
  std::string text;
  for (int phase = 0; phase < phases; ++phase) {
    const auto one = static_cast<Phase>(phase);
    if (!is_legal(call, one) || (of(interface) & bit(one)) == 0) continue;
    text += (text.empty() ? "" : " or ") + std::string(name_of(one));
  }
  return text.empty() ? "no state" : text;
}

}  // namespace mixed_order_game
