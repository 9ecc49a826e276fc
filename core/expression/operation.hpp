// The operations of expressions, on real numbers.
#pragma once

#include <cstdint>

namespace mixed_order_game {

enum class Operation : std::uint8_t {
  number,
  leaf,
  add,
  subtract,
  multiply,
  divide,
  negative,
  power,      ///< a^b
  power_log,  ///< a^b log(a), and 0 at a = 0: the derivative of a^b along b
  sqrt,
  exp,
  expm1,
  log,
  log1p,
  sin,
  cos,
  tan,
  asin,
  acos,
  atan,
  atan2,
  sinh,
  cosh,
  tanh,
  erf,
  hypot,
};

/// One step of a tape: row = operation of rows a and b.
struct TapeInstruction {
  Operation operation;
  int row;
  int a;
  int b;
};

}  // namespace mixed_order_game
