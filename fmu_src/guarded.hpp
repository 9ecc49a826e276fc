// The one wrapper around every entry point: checks the instance and that the call is legal now, keeps every exception
// inside, tells the reason, and keeps the host's floating-point environment out of the calculation and untouched, for
// its logger too.
#pragma once

#if defined(__x86_64__)
// All arithmetic is in SSE registers, but the C library reads the rounding of decimal numbers from the x87 control
// word. Both words are a quarter of a microsecond cheaper than the whole environment that the standard library saves.
#include <xmmintrin.h>
#define MIXED_ORDER_GAME_SSE
#else
#include <cfenv>
#endif

#include <exception>
#include <memory>
#include <new>
#include <string>
#include <unordered_map>
#include <utility>

#include "fmi_logger.hpp"
#include "instance.hpp"

namespace mixed_order_game {

/// An instance as an entry point sees it.
struct Component {
  Component(FmiLogger with_logger, Model model, Interface interface)
      : logger(std::move(with_logger)), instance(std::move(model), interface) {}

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
#ifdef MIXED_ORDER_GAME_SSE
    // reading is cheap, writing is not
    asm volatile("fnstcw %0" : "=m"(host_x87_));
    if (host_x87_ != default_x87) asm volatile("fldcw %0" : : "m"(default_x87));
    if ((host_ & ~flags) != default_control) _mm_setcsr(default_control);
#else
    std::fegetenv(&host_);
    std::fesetenv(FE_DFL_ENV);
#endif
  }
  ~FloatingPointEnvironment() {
#ifdef MIXED_ORDER_GAME_SSE
    if (_mm_getcsr() != host_) _mm_setcsr(host_);
    if (host_x87_ != default_x87) asm volatile("fldcw %0" : : "m"(host_x87_));
#else
    std::fesetenv(&host_);
#endif
  }
  FloatingPointEnvironment(const FloatingPointEnvironment&) = delete;
  FloatingPointEnvironment& operator=(const FloatingPointEnvironment&) = delete;

 private:
#ifdef MIXED_ORDER_GAME_SSE
  static constexpr unsigned flags = 0x3f;                // of exceptions that have occurred: they change no result
  static constexpr unsigned default_control = 0x1f80;    // all exceptions masked, to nearest, no flush to zero
  static constexpr unsigned short default_x87 = 0x037f;  // the same, with extended precision
  unsigned host_ = _mm_getcsr();
  unsigned short host_x87_ = 0;
#else
  std::fenv_t host_{};
#endif
};

enum class Outcome { done, discarded, refused };

/// Runs action(). Whatever it throws is told to the logger.
template <typename Action>
Outcome contained(const FmiLogger& logger, const char* function, Action action) noexcept {
  Outcome outcome = Outcome::refused;
  std::string reason;
  try {
    const FloatingPointEnvironment environment;
    try {
      action();
      return Outcome::done;
    } catch (const NotComputable& error) {
      outcome = Outcome::discarded;
      reason = std::string(function) + ": " + error.what();
    } catch (const std::bad_alloc&) {
      reason = std::string(function) + ": there is not enough memory";
    } catch (const std::exception& error) {
      reason = std::string(function) + ": " + error.what();
    } catch (...) {
      reason = std::string(function) + ": an unknown error occurred";
    }
  } catch (...) {  // not even the message could be made
  }
  if (outcome == Outcome::discarded) {
    logger.discard(reason);
  } else {
    logger.error(reason);
  }
  return outcome;
}

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
