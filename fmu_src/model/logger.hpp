// Messages for the importer: with a category, formatted, and free of the characters that its logger could interpret.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace mixed_order_game {

enum class Severity { ok, warning, discard, error };

struct LogCategory {
  const char* name;
  const char* description;
};

/// Declared in modelDescription.xml.
inline constexpr std::array<LogCategory, 4> log_categories{{
    {"logStatusError", "Calls that were refused and integrations that failed, with the reason"},
    {"logStatusDiscard", "Times and states at which the model has no finite values, with the variable"},
    {"logEvents", "Course of the run: initialization, integration statistics at its end"},
    {"logAll", "All messages"},
}};
inline constexpr const char* error_category = log_categories[0].name;
inline constexpr const char* discard_category = log_categories[1].name;
inline constexpr const char* event_category = log_categories[2].name;

/// The text with '%' and '#' replaced, which importers take for formats and value references, and control characters
/// turned into blanks.
std::string harmless(std::string_view text);

class Logger {
 public:
  using Sink = std::function<void(Severity, const char* category, const char* message)>;

  /// An empty sink is fine: nothing is said then.
  Logger(Sink sink, bool on) : sink_(std::move(sink)), events_on_(on) {}

  // A message that is empty, or for which there is no memory, says that memory is short.

  /// Errors are always told.
  void error(std::string_view message) const noexcept;
  void event(std::string_view message) const noexcept;
  /// An integrator tries again with a shorter step, so that this is told together with events.
  void discard(std::string_view message) const noexcept;
  [[nodiscard]] bool tells_events() const { return events_on_ && sink_ != nullptr; }

  /// No categories mean all. False, and nothing changes, when one of them is unknown.
  bool choose(bool on, std::span<const char* const> categories);

 private:
  void tell(Severity severity, const char* category, std::string_view message) const noexcept;

  Sink sink_;
  bool events_on_;
};

}  // namespace mixed_order_game
