#include "logger.hpp"

#include <algorithm>

namespace mixed_order_game {

std::string harmless(std::string_view text) {
  std::string clean(text);
  for (char& character : clean) {
    if (character == '%' || character == '#') character = '_';
    if (static_cast<unsigned char>(character) < 0x20) character = ' ';
  }
  return clean;
}

void Logger::error(std::string_view message) const noexcept { tell(Severity::error, error_category, message); }

void Logger::event(std::string_view message) const noexcept {
  if (tells_events()) tell(Severity::ok, event_category, message);
}

void Logger::discard(std::string_view message) const noexcept {
  if (tells_events()) tell(Severity::discard, discard_category, message);
}

void Logger::tell(Severity severity, const char* category, std::string_view message) const noexcept {
  if (!sink_) return;
  std::string clean;
  try {
    clean = harmless(message);
  } catch (...) {  // memory is short
  }
  try {
    sink_(severity, category, clean.empty() ? "there is not enough memory" : clean.c_str());
  } catch (...) {  // nobody is left to be told
  }
}

bool Logger::choose(bool on, std::span<const char* const> categories) {
  bool events = categories.empty();
  for (const char* name : categories) {
    const auto known = [&](const LogCategory& category) {
      return name != nullptr && category.name == std::string_view(name);
    };
    if (std::none_of(log_categories.begin(), log_categories.end(), known)) return false;
    events = events || std::string_view(name) != error_category;
  }
  events_on_ = on ? events_on_ || events : events_on_ && !events;
  return true;
}

}  // namespace mixed_order_game
