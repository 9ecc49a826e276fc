// The exceptions of the core. Each message is one sentence that names the entry, its value and what was expected.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>

namespace mixed_order_game {

class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A game definition or a set of parameters that does not describe a valid game.
class GameError : public Error {
 public:
  /// `entry` is the path of the entry that the message is about, such as player[2].cost, empty for the whole game. Line
  /// and column in the game file count from one and are 0 where they are those of the entry.
  explicit GameError(const std::string& message, std::string entry = {})
      : Error(message), sentence_(message), entry_(std::move(entry)) {}
  /// The message has the place in it; the sentence is the same without, for those who show the place themselves.
  GameError(const std::string& message, std::string sentence, std::string entry, std::size_t line, std::size_t column)
      : Error(message), sentence_(std::move(sentence)), entry_(std::move(entry)), line_(line), column_(column) {}

  [[nodiscard]] const std::string& sentence() const { return sentence_; }

  [[nodiscard]] const std::string& entry() const { return entry_; }
  [[nodiscard]] std::size_t line() const { return line_; }
  [[nodiscard]] std::size_t column() const { return column_; }

 private:
  std::string sentence_;
  std::string entry_;
  std::size_t line_ = 0;
  std::size_t column_ = 0;
};

/// The integrator could not reach the requested time.
class IntegrationError : public Error {
 public:
  using Error::Error;
};

}  // namespace mixed_order_game
