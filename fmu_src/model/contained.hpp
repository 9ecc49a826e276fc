// What every entry point of any version of FMI runs in: it keeps every exception inside, tells the reason, and keeps
// the host's floating-point environment out of the calculation and untouched, for its logger too.
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

#include "instance.hpp"
#include "logger.hpp"

namespace mixed_order_game {

/// An instance as an entry point sees it.
struct Component {
  Component(Logger with_logger, Model model, Interface interface)
      : logger(std::move(with_logger)), instance(std::move(model), interface) {}

  Logger logger;
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
Outcome contained(const Logger& logger, const char* function, Action action) noexcept {
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

}  // namespace mixed_order_game
