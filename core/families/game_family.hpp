// What costs, unknown dynamics and disturbances have in common: coefficients that they declare.
#pragma once

#include "expression/switching.hpp"
#include "families/coefficients.hpp"

namespace mixed_order_game {

class GameFamily {
 public:
  explicit GameFamily(Coefficients declared) : coefficients(std::move(declared)) {}
  virtual ~GameFamily() = default;

  Coefficients coefficients;

  /// Rebuilds what is derived from coefficients; called after any of them changed.
  virtual void refresh() = 0;

  /// The switches of its expressions.
  [[nodiscard]] virtual const Switching& switching() const {
    static const Switching none;
    return none;
  }

 protected:
  GameFamily(const GameFamily&) = default;
  GameFamily(GameFamily&&) = default;
  GameFamily& operator=(const GameFamily&) = default;
  GameFamily& operator=(GameFamily&&) = default;
};

}  // namespace mixed_order_game
