// The functions of FMI 2.0: translate arguments and status, nothing else.
#include <fmi2Functions.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "guarded.hpp"
#include "resource_location.hpp"

using namespace mixed_order_game;

namespace {

fmi2Status status(Outcome outcome) {
  switch (outcome) {
    case Outcome::done:
      return fmi2OK;
    case Outcome::discarded:
      return fmi2Discard;
    case Outcome::refused:
      return fmi2Error;
  }
  return fmi2Error;
}

std::string text_or(const char* text, const char* otherwise) {
  return text != nullptr && *text != '\0' ? text : otherwise;
}

/// An array argument, which must not be null unless it is empty.
template <typename Value>
std::span<Value> array(Value* values, std::size_t count, const char* name) {
  if (values == nullptr && count != 0) throw Error(std::string("the array ") + name + " is null");
  return {values, values == nullptr ? 0 : count};
}

template <typename Value>
Value& required(Value* value, const char* name) {
  if (value == nullptr) throw Error(std::string("the argument ") + name + " is null");
  return *value;
}

Logger make_logger(const fmi2CallbackFunctions* callbacks, const std::string& instance_name, bool on) {
  if (callbacks == nullptr || callbacks->logger == nullptr) return {nullptr, on};
  return {[logger = callbacks->logger, environment = callbacks->componentEnvironment, instance_name](
              Severity severity, const char* category, const char* message) {
            constexpr fmi2Status statuses[] = {fmi2OK, fmi2Warning, fmi2Discard, fmi2Error};
            logger(environment, instance_name.c_str(), statuses[static_cast<int>(severity)], category, message);
          },
          on};
}

template <typename Value>
fmi2Status get_values(fmi2Component c, const char* function, Type type, const fmi2ValueReference vr[], size_t nvr,
                      Value value[]) {
  return status(guarded(c, Call::get_values, function, [&](Component& component) {
    const auto references = array(vr, nvr, "vr");
    const auto values = array(value, nvr, "value");
    std::vector<Real> numbers(nvr);
    component.instance.get(type, references, numbers.data());
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = static_cast<Value>(numbers[k]);
  }));
}

template <typename Value>
fmi2Status set_values(fmi2Component c, const char* function, Type type, const fmi2ValueReference vr[], size_t nvr,
                      const Value value[]) {
  return status(guarded(c, Call::set_discrete_values, function, [&](Component& component) {
    const auto references = array(vr, nvr, "vr");
    const auto values = array(value, nvr, "value");
    std::vector<Real> numbers(values.begin(), values.end());
    component.instance.set(type, references, numbers.data());
  }));
}

void no_strings(size_t nvr) {
  if (nvr != 0) throw Error("the model has no variables of type String");
}

Snapshot& known_state(Component& component, fmi2FMUstate state) {
  const auto found = component.saved_states.find(state);
  if (found == component.saved_states.end()) {
    throw Error("the FMU state was not made by this instance, or has been freed");
  }
  return *found->second;
}

/// Stores a snapshot in a handle: in the one it holds already, or in a new one.
void store(Component& component, fmi2FMUstate& handle, Snapshot snapshot) {
  if (handle != nullptr) {
    known_state(component, handle) = std::move(snapshot);
    return;
  }
  auto saved = std::make_unique<Snapshot>(std::move(snapshot));
  Snapshot* const address = saved.get();
  component.saved_states.emplace(address, std::move(saved));
  handle = address;
}

}  // namespace

extern "C" {

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char* fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions* functions,
                              fmi2Boolean /*visible*/, fmi2Boolean loggingOn) {
  fmi2Component made = nullptr;
  try {
    const Logger logger = make_logger(functions, text_or(instanceName, model_identifier), loggingOn != fmi2False);
    contained(logger, "fmi2Instantiate", [&] {
      const std::string path = path_of(text_or(fmuResourceLocation, "")) + "/game.toml";
      const std::string toml = content_of(path);
      const auto model = [&] {
        try {
          return Model(toml);
        } catch (const GameError& error) {
          throw Error(path + ": " + error.what());
        }
      }();
      if (const std::string guid = text_or(fmuGUID, ""); guid != model.guid) {
        throw Error("the GUID is '" + guid + "', expected " + model.guid +
                    ": modelDescription.xml and the game definition do not belong together");
      }
      const Interface interface = fmuType == fmi2CoSimulation ? Interface::co_simulation : Interface::model_exchange;
      if (interface == Interface::model_exchange && !model.offers_model_exchange()) {
        throw Error(
            "the game exposes outputs only, and model exchange needs all states: build it with expose = \"all\"");
      }
      made = std::make_unique<Component>(logger, model, interface).release();
    });
  } catch (...) {
    made = nullptr;
  }
  return made;
}

void fmi2FreeInstance(fmi2Component c) { delete static_cast<Component*>(c); }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
  return status(guarded(c, Call::set_debug_logging, "fmi2SetDebugLogging", [&](Component& component) {
    if (!component.logger.choose(loggingOn != fmi2False, array(categories, nCategories, "categories"))) {
      throw Error("a log category is unknown, expected those of modelDescription.xml");
    }
  }));
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
  return status(guarded(c, Call::setup_experiment, "fmi2SetupExperiment", [&](Component& component) {
    Experiment experiment;
    experiment.start_time = startTime;
    if (toleranceDefined != fmi2False) experiment.tolerance = tolerance;
    if (stopTimeDefined != fmi2False) experiment.stop_time = stopTime;
    component.instance.setup_experiment(experiment);
  }));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  return status(guarded(c, Call::enter_initialization, "fmi2EnterInitializationMode",
                        [](Component& component) { component.instance.enter_initialization(); }));
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  return status(guarded(
      c, Call::exit_initialization, "fmi2ExitInitializationMode",
      [](Component& component) { component.instance.exit_initialization(); },
      [](const Component& component) { return "the run begins at t = " + text_of(component.instance.time()); }));
}

fmi2Status fmi2Terminate(fmi2Component c) {
  return status(guarded(
      c, Call::terminate, "fmi2Terminate", [](Component& component) { component.instance.terminate(); },
      [](const Component& component) {
        const Statistics work = component.instance.statistics();
        std::string text = "the run ended at t = " + text_of(component.instance.time()) + " after ";
        if (component.instance.interface() == Interface::co_simulation) {
          text += std::to_string(work.steps) + " steps, " + std::to_string(work.rate_evaluations) +
                  " evaluations of the rates and ";
        }
        return text + std::to_string(work.events) + " events";
      }));
}

fmi2Status fmi2Reset(fmi2Component c) {
  return status(guarded(c, Call::reset, "fmi2Reset", [](Component& component) {
    component.instance.reset();
    component.last_step_failed = false;
  }));
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
  return status(guarded(c, Call::get_values, "fmi2GetReal", [&](Component& component) {
    const auto references = array(vr, nvr, "vr");
    component.instance.get(Type::real, references, array(value, nvr, "value").data());
  }));
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[]) {
  return get_values(c, "fmi2GetInteger", Type::integer, vr, nvr, value);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[]) {
  return get_values(c, "fmi2GetBoolean", Type::boolean, vr, nvr, value);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference /*vr*/[], size_t nvr, fmi2String /*value*/[]) {
  return status(guarded(c, Call::get_values, "fmi2GetString", [&](Component&) { no_strings(nvr); }));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
  return status(guarded(c, Call::set_reals, "fmi2SetReal", [&](Component& component) {
    const auto references = array(vr, nvr, "vr");
    component.instance.set(Type::real, references, array(value, nvr, "value").data());
  }));
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[]) {
  return set_values(c, "fmi2SetInteger", Type::integer, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[]) {
  return set_values(c, "fmi2SetBoolean", Type::boolean, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference /*vr*/[], size_t nvr, const fmi2String /*value*/[]) {
  return status(guarded(c, Call::set_discrete_values, "fmi2SetString", [&](Component&) { no_strings(nvr); }));
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate* FMUstate) {
  return status(guarded(c, Call::get_state, "fmi2GetFMUstate", [&](Component& component) {
    fmi2FMUstate& handle = required(FMUstate, "FMUstate");
    store(component, handle, component.instance.save());
  }));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
  bool repeated = true;
  return status(guarded(
      c, Call::set_state, "fmi2SetFMUstate",
      [&](Component& component) {
        repeated = component.instance.restore(known_state(component, FMUstate));
        component.last_step_failed = false;
      },
      [&](const Component&) {
        return std::string(repeated ? "" : "the state comes from other arithmetic: the integrator restarts from it");
      }));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate* FMUstate) {
  return status(guarded(c, Call::free_state, "fmi2FreeFMUstate", [&](Component& component) {
    if (FMUstate == nullptr || *FMUstate == nullptr) return;
    known_state(component, *FMUstate);
    component.saved_states.erase(*FMUstate);
    *FMUstate = nullptr;
  }));
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t* size) {
  return status(guarded(c, Call::serialize_state, "fmi2SerializedFMUstateSize", [&](Component& component) {
    required(size, "size") = serialized_size(known_state(component, FMUstate), component.instance.model().guid);
  }));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size) {
  return status(guarded(c, Call::serialize_state, "fmi2SerializeFMUstate", [&](Component& component) {
    const Snapshot& snapshot = known_state(component, FMUstate);
    const std::vector<char> bytes = to_bytes(snapshot, component.instance.model().guid);
    const auto target = array(serializedState, size, "serializedState");
    if (size < bytes.size()) {
      throw Error("the array serializedState has " + std::to_string(size) + " bytes, expected " +
                  std::to_string(bytes.size()));
    }
    std::copy(bytes.begin(), bytes.end(), target.begin());
  }));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate* FMUstate) {
  return status(guarded(c, Call::serialize_state, "fmi2DeSerializeFMUstate", [&](Component& component) {
    fmi2FMUstate& handle = required(FMUstate, "FMUstate");
    store(component, handle, component.instance.read(array(serializedState, size, "serializedState")));
  }));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
  return status(guarded(c, Call::get_directional_derivative, "fmi2GetDirectionalDerivative", [&](Component& component) {
    component.instance.get_directional_derivative(
        array(vUnknown_ref, nUnknown, "vUnknown_ref"), array(vKnown_ref, nKnown, "vKnown_ref"),
        array(dvKnown, nKnown, "dvKnown").data(), array(dvUnknown, nUnknown, "dvUnknown").data());
  }));
}

// Co-simulation

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  return status(guarded(c, Call::set_input_derivatives, "fmi2SetRealInputDerivatives", [&](Component& component) {
    const auto references = array(vr, nvr, "vr");
    component.instance.set_input_derivatives(references, array(order, nvr, "order").data(),
                                             array(value, nvr, "value").data());
  }));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
  return status(guarded(c, Call::get_output_derivatives, "fmi2GetRealOutputDerivatives", [&](Component& component) {
    const auto references = array(vr, nvr, "vr");
    component.instance.get_output_derivatives(references, array(order, nvr, "order").data(),
                                              array(value, nvr, "value").data());
  }));
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean /*noSetFMUStatePriorToCurrentPoint*/) {
  const fmi2Status result = status(guarded(c, Call::do_step, "fmi2DoStep", [&](Component& component) {
    component.instance.do_step(currentCommunicationPoint, communicationStepSize);
  }));
  if (c != nullptr) static_cast<Component*>(c)->last_step_failed = result != fmi2OK;
  return result;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
  return status(guarded(c, Call::cancel_step, "fmi2CancelStep", [](Component&) {}));
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status* value) {
  return status(guarded(c, Call::get_status, "fmi2GetStatus", [&](Component& component) {
    if (s != fmi2DoStepStatus) throw Error("only fmi2DoStepStatus has a value of type fmi2Status");
    required(value, "value") = component.last_step_failed ? fmi2Error : fmi2OK;
  }));
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real* value) {
  return status(guarded(c, Call::get_status, "fmi2GetRealStatus", [&](Component& component) {
    if (s != fmi2LastSuccessfulTime) throw Error("only fmi2LastSuccessfulTime has a value of type fmi2Real");
    required(value, "value") = component.instance.time();
  }));
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind /*s*/, fmi2Integer* /*value*/) {
  return status(guarded(c, Call::get_status, "fmi2GetIntegerStatus",
                        [](Component&) { throw Error("no status has a value of type fmi2Integer"); }));
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean* value) {
  return status(guarded(c, Call::get_status, "fmi2GetBooleanStatus", [&](Component&) {
    if (s != fmi2Terminated) throw Error("only fmi2Terminated has a value of type fmi2Boolean");
    required(value, "value") = fmi2False;  // the model never asks to end a run
  }));
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String* value) {
  return status(guarded(c, Call::get_status, "fmi2GetStringStatus", [&](Component&) {
    if (s != fmi2PendingStatus) throw Error("only fmi2PendingStatus has a value of type fmi2String");
    required(value, "value") = "";  // steps are never pending
  }));
}

// Model exchange

fmi2Status fmi2EnterEventMode(fmi2Component c) {
  return status(guarded(c, Call::enter_event_mode, "fmi2EnterEventMode",
                        [](Component& component) { component.instance.enter_event_mode(); }));
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo* eventInfo) {
  return status(guarded(c, Call::new_discrete_states, "fmi2NewDiscreteStates", [&](Component& component) {
    fmi2EventInfo& info = required(eventInfo, "eventInfo");
    const bool moved = component.instance.new_discrete_states();
    info.newDiscreteStatesNeeded = fmi2False;
    info.terminateSimulation = fmi2False;
    info.nominalsOfContinuousStatesChanged = fmi2False;
    info.valuesOfContinuousStatesChanged = moved ? fmi2True : fmi2False;
    const Real next = component.instance.next_event();
    info.nextEventTimeDefined = std::isfinite(next) ? fmi2True : fmi2False;
    info.nextEventTime = std::isfinite(next) ? next : 0.0;
  }));
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
  return status(guarded(c, Call::enter_continuous_time_mode, "fmi2EnterContinuousTimeMode",
                        [](Component& component) { component.instance.enter_continuous_time_mode(); }));
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean /*noSetFMUStatePriorToCurrentPoint*/,
                                       fmi2Boolean* enterEventMode, fmi2Boolean* terminateSimulation) {
  return status(guarded(c, Call::completed_integrator_step, "fmi2CompletedIntegratorStep", [&](Component& component) {
    fmi2Boolean& enter = required(enterEventMode, "enterEventMode");
    fmi2Boolean& terminate = required(terminateSimulation, "terminateSimulation");
    enter = component.instance.completed_integrator_step() ? fmi2True : fmi2False;
    terminate = fmi2False;
  }));
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
  return status(
      guarded(c, Call::set_time, "fmi2SetTime", [&](Component& component) { component.instance.set_time(time); }));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
  return status(guarded(c, Call::set_continuous_states, "fmi2SetContinuousStates",
                        [&](Component& component) { component.instance.set_continuous_states(array(x, nx, "x")); }));
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
  return status(guarded(c, Call::get_derivatives, "fmi2GetDerivatives", [&](Component& component) {
    component.instance.get_derivatives(array(derivatives, nx, "derivatives"));
  }));
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
  return status(guarded(c, Call::get_event_indicators, "fmi2GetEventIndicators", [&](Component& component) {
    component.instance.get_event_indicators(array(eventIndicators, ni, "eventIndicators"));
  }));
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
  return status(guarded(c, Call::get_continuous_states, "fmi2GetContinuousStates",
                        [&](Component& component) { component.instance.get_continuous_states(array(x, nx, "x")); }));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
  return status(guarded(c, Call::get_nominals, "fmi2GetNominalsOfContinuousStates", [&](Component& component) {
    component.instance.get_nominals(array(x_nominal, nx, "x_nominal"));
  }));
}

}  // extern "C"
