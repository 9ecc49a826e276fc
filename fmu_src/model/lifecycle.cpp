#include "lifecycle.hpp"

#include <iterator>

namespace mixed_order_game {

namespace {

using namespace phase_set;

// Which variables the calls that set values may name: notes 1 and 3 to 6 to the tables of calling sequences in sections
// 3.2.3 and 4.2.4 of FMI 2.0.5.
struct VariableRule {
  Causality causality;
  Variability variability;
  PhaseSet standard;
  PhaseSet beyond = 0;  ///< what is allowed besides, on purpose
};
constexpr VariableRule variable_rules[] = {
    {Causality::parameter, Variability::fixed, fresh | initializing},
    {Causality::parameter, Variability::tunable, fresh | initializing | stepping | at_event},
    // importers set all start values at once
    {Causality::input, Variability::continuous, initializing | running, fresh},
};
// By model exchange the importer holds the states (note 5, since 2.0.1); one that never leaves event mode sets them
// there, beyond the standard.
constexpr PhaseSet states_settable = continuous | at_event;

constexpr std::string_view phase_names[] = {"instantiated", "initialization mode",  "step complete",
                                            "event mode",   "continuous-time mode", "terminated",
                                            "error"};
static_assert(std::size(phase_names) == phases);

/// The phases in which a variable of this family may be set.
PhaseSet settable(const Family& family) {
  if (family.is_state) return states_settable;
  for (const VariableRule& rule : variable_rules) {
    if (rule.causality == family.causality && rule.variability == family.variability) {
      return rule.standard | rule.beyond;
    }
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

bool may_be_set(const Family& family, Phase phase) { return (settable(family) & bit(phase)) != 0; }

std::string why_not_settable(const Family& family, Phase phase, Interface interface) {
  const bool some_time = (settable(family) & of(interface)) != 0;
  const std::string_view kind = some_time && family.is_state ? "a state" : kind_of(family);
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
