// The one wrapper around every entry point of FMI 2.0: checks the instance and that the call is legal now.
#pragma once

#include <string>
#include <utility>

#include "contained.hpp"
#include "legal_calls.hpp"

namespace mixed_order_game {

/// Runs action(component) when the call is legal.
template <typename Action>
Outcome guarded(void* handle, Call call, const char* function, Action action) noexcept {
  if (handle == nullptr) return Outcome::refused;
  auto& component = *static_cast<Component*>(handle);
  return contained(component.logger, function, [&] {
    const Phase phase = component.instance.phase();
    const Interface interface = component.instance.interface();
    if (!belongs_to(call, interface)) {
      const Interface other =
          interface == Interface::co_simulation ? Interface::model_exchange : Interface::co_simulation;
      throw Error("belongs to " + std::string(name_of(other)) + ", and this instance was made for " +
                  std::string(name_of(interface)));
    }
    if (!is_legal(call, phase)) {
      throw Error("not allowed in the state " + std::string(name_of(phase)) + ", only in " +
                  legal_phases(call, interface));
    }
    action(component);
  });
}

/// The same; when the call was done and events are told, the text that event(component) makes is one.
template <typename Action, typename Event>
Outcome guarded(void* handle, Call call, const char* function, Action action, Event event) noexcept {
  const Outcome outcome = guarded(handle, call, function, std::move(action));
  if (outcome != Outcome::done) return outcome;
  const auto& component = *static_cast<const Component*>(handle);
  if (!component.logger.tells_events()) return outcome;
  std::string text;
  try {
    text = event(component);
  } catch (...) {  // memory is short, but the call was done
  }
  if (!text.empty()) component.logger.event(text);
  return outcome;
}

}  // namespace mixed_order_game
