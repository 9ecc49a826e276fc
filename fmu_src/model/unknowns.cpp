#include "unknowns.hpp"

#include "lifecycle.hpp"

namespace mixed_order_game {

namespace {

bool states_are_variables(const Model& model) { return model.game.expose == Expose::all; }

std::string_view when(Equations equations) {
  return equations == Equations::initial ? "in initialization mode" : "after initialization";
}

std::string is_not_of(const Model& model, int reference, const char* kind, Equations equations,
                      const std::string& expected) {
  return model.variables.name(reference) + " is " + std::string(kind_of(model.variables.family(reference))) +
         " and no " + kind + " of the equations that hold " + std::string(when(equations)) + ", expected " + expected;
}

}  // namespace

bool is_unknown(const Model& model, int reference, Equations equations) {
  const Family& family = model.variables.family(reference);
  if (family.causality == Causality::output || family.derivative_of >= 0) return true;
  if (equations == Equations::running) return false;
  return family.causality == Causality::calculated_parameter || (family.is_state && states_are_variables(model));
}

bool is_known(const Model& model, int reference, Equations equations) {
  const Family& family = model.variables.family(reference);
  if (family.causality == Causality::input || family.causality == Causality::independent) return true;
  return equations == Equations::initial ? family.causality == Causality::parameter
                                         : family.is_state && states_are_variables(model);
}

std::string why_no_unknown(const Model& model, int reference, Equations equations) {
  const char* expected = nullptr;
  if (equations == Equations::initial) {
    expected = states_are_variables(model) ? "an output, a calculated parameter, a state or its derivative"
                                           : "an output or a calculated parameter";
  } else {
    expected = states_are_variables(model) ? "an output or the derivative of a state" : "an output";
  }
  return is_not_of(model, reference, "unknown", equations, expected);
}

std::string why_no_known(const Model& model, int reference, Equations equations) {
  const char* expected = "an input, a parameter or time";
  if (equations == Equations::running) {
    expected = states_are_variables(model) ? "an input, a state or time" : "an input or time";
  }
  return is_not_of(model, reference, "known", equations, expected);
}

}  // namespace mixed_order_game
