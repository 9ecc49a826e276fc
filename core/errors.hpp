// The exceptions of the core. Each message is one sentence that names the entry, its value and what was expected.
#pragma once

#include <stdexcept>
#include <string>

namespace mixed_order_game {

class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A game definition or a set of parameters that does not describe a valid game.
class GameError : public Error {
 public:
  using Error::Error;
};

/// The integrator could not reach the requested time.
class IntegrationError : public Error {
 public:
  using Error::Error;
};

}  // namespace mixed_order_game
