#include "expression/syntax.hpp"

#include <charconv>
#include <cmath>
#include <tao/pegtl.hpp>
#include <tao/pegtl/contrib/parse_tree.hpp>

namespace mixed_order_game {

namespace {

namespace peg = TAO_PEGTL_NAMESPACE;

namespace grammar {

using namespace peg;  // NOLINT(google-build-using-namespace): the names of rules

// NOLINTBEGIN(readability-identifier-naming): rules are named as the library's own
// clang-format off
template <typename Rule> struct token : seq<Rule, star<space>> {};
template <char... Characters> struct symbol : token<string<Characters...>> {};
template <typename Word> struct keyword : token<seq<Word, not_at<identifier_other>>> {};

struct word_and : TAO_PEGTL_KEYWORD("and") {};
struct word_or : TAO_PEGTL_KEYWORD("or") {};
struct word_not : TAO_PEGTL_KEYWORD("not") {};
struct word_for : TAO_PEGTL_KEYWORD("for") {};
struct word_in : TAO_PEGTL_KEYWORD("in") {};
struct word_if : TAO_PEGTL_KEYWORD("if") {};
struct word_sum : TAO_PEGTL_KEYWORD("sum") {};
struct word_prod : TAO_PEGTL_KEYWORD("prod") {};
struct reserved : sor<word_and, word_or, word_not, word_for, word_in> {};

struct expression;
struct sum;
struct power;

struct exponent_part : seq<one<'e', 'E'>, opt<one<'+', '-'>>, plus<digit>> {};
struct number_text : seq<plus<digit>, opt<one<'.'>, plus<digit>>, opt<exponent_part>, not_at<identifier_other>> {};
struct number : number_text {};
struct name : seq<not_at<reserved>, identifier> {};

struct open : symbol<'('> {};
struct close : symbol<')'> {};
struct bar : symbol<','> {};
struct dots : symbol<'.', '.'> {};
struct first : seq<sum> {};
struct last : seq<sum> {};
struct filter : seq<expression> {};
struct bound : seq<name> {};
struct reducer : sor<word_sum, word_prod> {};
struct reduction
    : if_must<seq<token<reducer>, open>, expression, token<word_for>, token<bound>, token<word_in>, first, dots, last,
              opt<if_must<token<word_if>, filter>>, close> {};
struct arguments : list_must<expression, bar> {};
struct indices : list_must<sum, bar> {};
struct called : seq<name> {};
struct call : if_must<seq<token<called>, open>, arguments, close> {};
struct reference : seq<token<name>, opt<if_must<symbol<'['>, indices, symbol<']'>>>> {};
struct parenthesized : if_must<open, expression, close> {};
struct primary : sor<token<number>, parenthesized, reduction, call, reference> {};
struct minus : one<'-'> {};
struct exponent : must<seq<star<token<minus>>, power>> {};
struct power : seq<primary, opt<symbol<'^'>, exponent>> {};
struct signed_power : seq<star<token<minus>>, power> {};
struct times : one<'*', '/'> {};
struct plus_minus : seq<one<'+', '-'>> {};
struct product : seq<signed_power, star<if_must<token<times>, signed_power>>> {};
struct sum : seq<product, star<if_must<token<plus_minus>, product>>> {};
struct compared : sor<string<'<', '='>, string<'>', '='>, string<'=', '='>, string<'!', '='>, one<'<', '>'>> {};
struct comparison : seq<sum, opt<if_must<token<compared>, sum>>> {};
struct negation : seq<star<token<word_not>>, comparison> {};
struct conjunction : seq<negation, star<if_must<token<word_and>, negation>>> {};
struct expression : seq<conjunction, star<if_must<token<word_or>, conjunction>>> {};
struct whole : must<star<space>, expression, eof> {};
// clang-format on
// NOLINTEND(readability-identifier-naming)

template <typename Rule>
inline constexpr const char* expected = nullptr;
template <>
inline constexpr const char* expected<expression> = "a value";
template <>
inline constexpr const char* expected<arguments> = "a value";
template <>
inline constexpr const char* expected<indices> = "an index";
template <>
inline constexpr const char* expected<sum> = "a value";
template <>
inline constexpr const char* expected<product> = "a value";
template <>
inline constexpr const char* expected<signed_power> = "a value";
template <>
inline constexpr const char* expected<negation> = "a condition";
template <>
inline constexpr const char* expected<conjunction> = "a condition";
template <>
inline constexpr const char* expected<filter> = "a condition";
template <>
inline constexpr const char* expected<first> = "the first index";
template <>
inline constexpr const char* expected<last> = "the last index";
template <>
inline constexpr const char* expected<token<bound>> = "the name of an index";
template <>
inline constexpr const char* expected<token<word_for>> = "\"for\" or an operator";
template <>
inline constexpr const char* expected<token<word_in>> = "\"in\"";
template <>
inline constexpr const char* expected<dots> = "\"..\"";
template <>
inline constexpr const char* expected<close> = "\")\" or an operator";
template <>
inline constexpr const char* expected<symbol<']'>> = "\"]\" or an operator";
template <>
inline constexpr const char* expected<eof> = "an operator or the end";
template <>
inline constexpr const char* expected<star<space>> = "a value";
template <>
inline constexpr const char* expected<seq<star<token<minus>>, power>> = "a value";

struct Messages {
  template <typename Rule>
  static constexpr const char* message = expected<Rule>;
};
template <typename Rule>
using Control = must_if<Messages, normal, false>::control<Rule>;

template <typename Rule>
using Kept = parse_tree::selector<
    Rule,
    parse_tree::store_content::on<number, name, minus, times, plus_minus, compared, word_not, word_and, word_or,
                                  reducer, bound, called, first, last, filter, call, comparison>,
    parse_tree::remove_content::on<reduction, reference, power, exponent, signed_power, product, sum, negation,
                                   conjunction, expression>>;

}  // namespace grammar

using Node = peg::parse_tree::node;

std::size_t position_of(const Node& node) { return node.begin().byte; }

Syntax tree_of(const Node& node);

/// A piece of the text in one line, without spaces at its end, and shortened.
std::string text_of(const Node& node) {
  constexpr std::size_t longest = 80;
  std::string text;
  for (const char c : node.string_view()) {
    const bool is_space = static_cast<unsigned char>(c) <= 0x20;
    if (!is_space || (!text.empty() && text.back() != ' ')) text += is_space ? ' ' : c;
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  if (text.size() > longest) text = text.substr(0, longest - 3) + "...";
  return text;
}

/// From operands and operators in turn; sums and products stay flat, however long they are.
Syntax chain_of(const Node& node, Syntax::Kind kind) {
  if (node.children.size() == 1) return tree_of(*node.children[0]);
  Syntax chain{.kind = kind, .position = position_of(*node.children[1])};
  for (std::size_t k = 0; k < node.children.size(); ++k) {
    if (k % 2 == 0) {
      chain.children.push_back(tree_of(*node.children[k]));
    } else if (kind == Syntax::Kind::arithmetic) {
      chain.name += node.children[k]->string();
    } else {
      chain.name = node.children[k]->string();
    }
  }
  return chain;
}

/// Signs or "not", and what they stand before.
Syntax prefixed(const Node& node, Syntax::Kind kind, const std::string& name) {
  Syntax inner = tree_of(*node.children.back());
  for (std::size_t k = node.children.size() - 1; k-- > 0;) {
    Syntax outer{.kind = kind, .name = name, .position = position_of(*node.children[k])};
    outer.children.push_back(std::move(inner));
    inner = std::move(outer);
  }
  return inner;
}

Real number_of(const Node& node) {
  const std::string text = node.string();
  Real value = 0.0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  if (!std::isfinite(value) || (value == 0.0 && text.find_first_of("123456789") < text.find_first_of("eE"))) {
    throw ExpressionError(position_of(node), "the number " + text.substr(0, 40) + " is out of range");
  }
  return value;
}

Syntax tree_of(const Node& node) {
  using namespace grammar;
  using Kind = Syntax::Kind;
  if (node.is_type<number>()) {
    return {.kind = Kind::number, .value = number_of(node), .position = position_of(node)};
  }
  if (node.is_type<name>()) return {.kind = Kind::name, .name = node.string(), .position = position_of(node)};
  if (node.is_type<reference>() || node.is_type<call>()) {
    Syntax tree{.kind = node.is_type<call>() ? Kind::call : Kind::name,
                .name = node.children[0]->string(),
                .position = position_of(*node.children[0])};
    for (std::size_t k = 1; k < node.children.size(); ++k) tree.children.push_back(tree_of(*node.children[k]));
    if (node.is_type<call>()) tree.text = text_of(node);
    return tree;
  }
  if (node.is_type<reduction>()) {  // reducer, body, bound, first, last and perhaps a filter
    Syntax tree{.kind = Kind::reduction,
                .name = node.children[0]->string(),
                .bound = node.children[2]->string(),
                .position = position_of(node)};
    for (std::size_t k = 1; k < node.children.size(); ++k) {
      if (k != 2) tree.children.push_back(tree_of(*node.children[k]));
    }
    return tree;
  }
  if (node.is_type<signed_power>() || node.is_type<exponent>()) return prefixed(node, Kind::negative, "-");
  if (node.is_type<negation>()) return prefixed(node, Kind::logical, "not");
  if (node.is_type<power>() && node.children.size() == 2) {
    Syntax tree{.kind = Kind::arithmetic, .name = "^", .position = position_of(*node.children[1])};
    for (const auto& child : node.children) tree.children.push_back(tree_of(*child));
    return tree;
  }
  if (node.is_type<comparison>()) {
    Syntax tree = chain_of(node, Kind::comparison);
    if (tree.kind == Kind::comparison) tree.text = text_of(node);
    return tree;
  }
  if (node.is_type<conjunction>() || node.is_type<expression>()) return chain_of(node, Kind::logical);
  return chain_of(node, Kind::arithmetic);  // sums and products, and what stands for its only child
}

/// Refuses what would nest without end before any of it is read.
void require_shallow(std::string_view text) {
  if (text.size() > longest_expression) {
    throw ExpressionError(0, "the text has " + std::to_string(text.size()) + " characters, expected at most " +
                                 std::to_string(longest_expression));
  }
  int depth = 0;
  int powers = 0;
  for (std::size_t k = 0; k < text.size(); ++k) {
    if (text[k] == '(' || text[k] == '[') ++depth;
    if (text[k] == ')' || text[k] == ']') --depth;
    if (text[k] == '^') ++powers;
    if (depth > deepest_expression) {
      throw ExpressionError(k, "brackets are nested more than " + std::to_string(deepest_expression) + " deep");
    }
    if (text[k] == '+' || text[k] == ',') powers = 0;
    if (powers > deepest_expression) {
      throw ExpressionError(k, "powers are nested more than " + std::to_string(deepest_expression) + " deep");
    }
  }
}

}  // namespace

std::string shown_from(std::string_view text, std::size_t position) {
  constexpr std::size_t longest = 20;
  if (position >= text.size()) return "the end";
  std::string rest(text.substr(position, longest));
  for (char& c : rest) {
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  // no half of a character
  while (!rest.empty() && position + rest.size() < text.size() &&
         (static_cast<unsigned char>(text[position + rest.size()]) & 0xC0U) == 0x80U) {
    rest.pop_back();
  }
  return "\"" + rest + (position + rest.size() < text.size() ? "..." : "") + "\"";
}

Syntax parse_expression(std::string_view text) {
  require_shallow(text);
  try {
    peg::memory_input<> in(text.data(), text.size(), "");
    const auto root = peg::parse_tree::parse<grammar::whole, grammar::Kept, peg::nothing, grammar::Control>(in);
    return tree_of(*root->children.at(0));
  } catch (const peg::parse_error& error) {
    const std::size_t at_byte = error.positions().front().byte;
    throw ExpressionError(at_byte,
                          shown_from(text, at_byte) + " stands there, expected " + std::string(error.message()));
  }
}

}  // namespace mixed_order_game
