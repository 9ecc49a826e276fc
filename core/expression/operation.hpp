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
  // where values switch
  abs,
  min,
  max,
  floor,
  sign_of,               ///< 1 where a >= 0, else -1: the derivative of |a|
  positive,              ///< 1 where a > 0, else 0
  not_negative,          ///< 1 where a >= 0, else 0
  sign,                  ///< -1, 0 or 1
  choose,                ///< b where a differs from 0, else 0 whatever b is
  multiply_unless_zero,  ///< a b, and 0 where a is 0 whatever b is
  usable,                ///< 1 where a is finite, else 0
  alternating,           ///< of an integer: 1 where it is even, -1 where it is odd
  noise,                 ///< number b of the normal sequence with seed a
};

/// One step of a tape: row = operation of rows a and b.
struct TapeInstruction {
  Operation operation;
  int row;
  int a;
  int b;
};

}  // namespace mixed_order_game
