#include "lifecycle.hpp"

#include <iterator>

namespace mixed_order_game {

namespace {

constexpr unsigned bit(Phase phase) { return 1U << static_cast<unsigned>(phase); }

constexpr unsigned fresh = bit(Phase::instantiated);
constexpr unsigned initializing = bit(Phase::initialization);
constexpr unsigned running = bit(Phase::step_complete);
constexpr unsigned ended = bit(Phase::terminated);
constexpr unsigned failed = bit(Phase::error);
constexpr unsigned always = fresh | initializing | running | ended | failed;

// The standard's table for co-simulation. Allowed beyond it, because importers rely on it and nothing is lost:
// reading any variable before initialization ends, setting inputs and reading or restoring states right after
// instantiation, and all that still makes sense after a failed integration.
struct CallRule {
  Call call;
  unsigned legal;
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
    {Call::set_input_derivatives, fresh | initializing | running},
    {Call::get_output_derivatives, running | ended | failed},
    {Call::do_step, running},
    {Call::cancel_step, 0},  // only while an asynchronous step runs, and there are none
    {Call::get_status, always},
    {Call::model_exchange, 0},
};

struct VariableRule {
  Causality causality;
  Variability variability;
  unsigned settable;
};
constexpr VariableRule variable_rules[] = {
    {Causality::parameter, Variability::fixed, fresh | initializing},
    {Causality::parameter, Variability::tunable, fresh | initializing | running},
    {Causality::input, Variability::continuous, fresh | initializing | running},
};

constexpr std::string_view phase_names[] = {"instantiated", "initialization mode", "step complete", "terminated",
                                            "error"};
static_assert(std::size(phase_names) == phases);
static_assert(std::size(call_rules) == static_cast<std::size_t>(Call::model_exchange) + 1);

unsigned legal_in(Call call) {
  for (const CallRule& rule : call_rules) {
    if (rule.call == call) return rule.legal;
  }
  return 0;
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

bool is_legal(Call call, Phase phase) { return (legal_in(call) & bit(phase)) != 0; }

std::string legal_phases(Call call) {
  std::string text;
  for (int phase = 0; phase < phases; ++phase) {
    if (!is_legal(call, static_cast<Phase>(phase))) continue;
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

}  // namespace mixed_order_game
