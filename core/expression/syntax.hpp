// The language of expressions: from a text to its syntax tree.
//
//   expression  = conjunction { "or" conjunction }        conjunction = negation { "and" negation }
//   negation    = { "not" } comparison                    comparison  = sum [ ("<" | "<=" | ">" | ">=" | "==" | "!=")
//   sum ] sum         = product { ("+" | "-") product }         product     = signed { ("*" | "/") signed } signed = {
//   "-" } power                           power       = primary [ "^" signed ] primary     = number | "(" expression
//   ")" | name [ "[" list "]" ] | name "(" list ")"
//               | ("sum" | "prod") "(" expression "for" name "in" sum ".." sum [ "if" expression ] ")"
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "types.hpp"

namespace mixed_order_game {

/// Where and why a text is no expression, or has no meaning in its game.
class ExpressionError : public std::runtime_error {
 public:
  ExpressionError(std::size_t at, const std::string& message) : std::runtime_error(message), position(at) {}
  std::size_t position;  ///< in the text, from zero
};

struct Syntax {
  enum class Kind {
    number,      ///< value
    name,        ///< name, with its indices as children
    call,        ///< name, with its arguments as children
    negative,    ///< minus one child
    arithmetic,  ///< name holds the operators + - * / ^ between the children, to be applied from the left
    comparison,  ///< name < <= > >= == !=, two children
    logical,     ///< name and, or (two children or more), not (one)
    reduction,   ///< name sum or prod; children: body, first, last and, if there is one, the condition
  };

  Kind kind = Kind::number;
  std::string name = {};
  std::string bound = {};  ///< of a reduction: its index
  Real value = 0.0;
  std::size_t position = 0;
  std::vector<Syntax> children = {};
  std::string text = {};  ///< of a call or comparison: as it is written
};

/// Longest text, and deepest nesting of brackets, powers and functions in it.
inline constexpr std::size_t longest_expression = 20'000;
inline constexpr int deepest_expression = 100;

/// Throws ExpressionError that says what stands there and what was expected.
Syntax parse_expression(std::string_view text);

/// What stands at a position of a text, for messages: the rest of it, shortened.
std::string shown_from(std::string_view text, std::size_t position);

}  // namespace mixed_order_game
