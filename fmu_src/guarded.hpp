// The one wrapper around every entry point: checks the instance and that the call is legal now, keeps every exception
// inside, tells the reason, and keeps the host's floating-point environment out of the calculation and untouched.
#pragma once

#include <cfenv>
#include <exception>
#include <memory>
#include <string>
#include <unordered_map>
#include <utility>

#include "fmi_logger.hpp"
#include "instance.hpp"

namespace mixed_order_game {

/// An instance as an entry point sees it.
struct Component {
  Component(FmiLogger with_logger, Model model) : logger(std::move(with_logger)), instance(std::move(model)) {}

  FmiLogger logger;
  Instance instance;
  /// Saved states that the importer holds, so that a stale or foreign handle is refused.
  std::unordered_map<const void*, std::unique_ptr<Snapshot>> saved_states;
  bool last_step_failed = false;
};

/// Default rounding and no traps while it lives; the host's settings and flags afterwards.
class FloatingPointEnvironment {
 public:
  FloatingPointEnvironment() {
    std::fegetenv(&host_);
    std::fesetenv(FE_DFL_ENV);
  }
  ~FloatingPointEnvironment() { std::fesetenv(&host_); }
  FloatingPointEnvironment(const FloatingPointEnvironment&) = delete;
  FloatingPointEnvironment& operator=(const FloatingPointEnvironment&) = delete;

 private:
  std::fenv_t host_{};
};

/// Runs action(); true when it returned. Whatever it throws is told to the logger.
template <typename Action>
bool contained(const FmiLogger& logger, const char* function, Action action) noexcept {
  const FloatingPointEnvironment environment;
  try {
    try {
      action();
      return true;
    } catch (const std::exception& error) {
      logger.error(std::string(function) + ": " + error.what());
    } catch (...) {
      logger.error(std::string(function) + ": an unknown error occurred");
    }
  } catch (...) {  // not even the message could be made
  }
  return false;
}

/// Runs action(component) when the call is legal; true when it returned.
template <typename Action>
bool guarded(void* handle, Call call, const char* function, Action action) noexcept {
  if (handle == nullptr) return false;
  auto& component = *static_cast<Component*>(handle);
  return contained(component.logger, function, [&] {
    const Phase phase = component.instance.phase();
    if (call == Call::model_exchange) throw Error("belongs to model exchange, and this is a co-simulation slave");
    if (!is_legal(call, phase)) {
      throw Error("not allowed in the state " + std::string(name_of(phase)) + ", only in " + legal_phases(call));
    }
    action(component);
  });
}

}  // namespace mixed_order_game
