#include "expression/unroll.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

namespace mixed_order_game {

namespace {

struct Function {
  std::string_view name;
  Operation operation;
  std::size_t arguments;
};
constexpr std::array functions{
    Function{"sqrt", Operation::sqrt, 1},   Function{"exp", Operation::exp, 1},
    Function{"expm1", Operation::expm1, 1}, Function{"log", Operation::log, 1},
    Function{"log1p", Operation::log1p, 1}, Function{"sin", Operation::sin, 1},
    Function{"cos", Operation::cos, 1},     Function{"tan", Operation::tan, 1},
    Function{"asin", Operation::asin, 1},   Function{"acos", Operation::acos, 1},
    Function{"atan", Operation::atan, 1},   Function{"atan2", Operation::atan2, 2},
    Function{"sinh", Operation::sinh, 1},   Function{"cosh", Operation::cosh, 1},
    Function{"tanh", Operation::tanh, 1},   Function{"erf", Operation::erf, 1},
    Function{"hypot", Operation::hypot, 2},
};
constexpr std::array<std::string_view, 11> switching{"abs", "min", "max",    "sign",  "floor", "mod",
                                                     "if",  "sum", "square", "pulse", "noise"};
constexpr std::array<std::string_view, 15> words{"x",  "v",  "t",   "i",   "l",   "N",  "D",   "order",
                                                 "pi", "or", "and", "not", "for", "in", "prod"};
constexpr long most_repetitions = 10'000'000;  // of the bodies of sums, all of an expression together

std::string quoted(const std::string& name) {
  std::string text = "\"";
  return text.append(name, 0, 40).append("\"");
}

class Unrolling {
 public:
  Unrolling(const Place& place, ExpressionGraph& graph) : place_(place), shape_(*place.shape), graph_(graph) {}

  int number(const Syntax& syntax);

 private:
  using Kind = Syntax::Kind;

  [[noreturn]] static void fail(const Syntax& at_syntax, const std::string& message) {
    throw ExpressionError(at_syntax.position, message);
  }

  // indices
  std::optional<long> index_named(const std::string& name) const;
  bool is_index(const Syntax& syntax) const;
  long index(const Syntax& syntax) const;
  bool is_index_condition(const Syntax& syntax) const;
  bool holds(const Syntax& syntax) const;
  int index_within(const Syntax& syntax, int size, const std::string& of) const;

  int name(const Syntax& syntax);
  int call(const Syntax& syntax);
  int reduction(const Syntax& syntax);
  int entry(const Syntax& syntax) const;

  const Place& place_;
  const Shape& shape_;
  ExpressionGraph& graph_;
  std::vector<std::pair<std::string, long>> bound_;  // innermost last
  long repetitions_ = 0;
};

std::optional<long> Unrolling::index_named(const std::string& name) const {
  for (auto bound = bound_.rbegin(); bound != bound_.rend(); ++bound) {
    if (bound->first == name) return bound->second;
  }
  if (name == "i") return place_.player + 1;
  if (name == "l" && place_.coordinate >= 0) return place_.coordinate + 1;
  if (name == "N") return shape_.players;
  if (name == "D") return shape_.dimension;
  return std::nullopt;
}

bool Unrolling::is_index(const Syntax& syntax) const {
  const auto all_indices = [&] {
    return std::all_of(syntax.children.begin(), syntax.children.end(),
                       [&](const Syntax& child) { return is_index(child); });
  };
  switch (syntax.kind) {
    case Kind::number:
      return syntax.value == std::floor(syntax.value) && syntax.value <= 1e9;
    case Kind::name:
      if (syntax.children.empty()) return index_named(syntax.name).has_value();
      return syntax.name == "order" && syntax.children.size() == 1;
    case Kind::negative:
      return all_indices();
    case Kind::arithmetic:
      return syntax.name.find_first_of("/^") == std::string::npos && all_indices();
    case Kind::call:
      return (syntax.name == "mod" || syntax.name == "min" || syntax.name == "max") && all_indices();
    default:
      return false;
  }
}

long Unrolling::index(const Syntax& syntax) const {
  constexpr long largest = 1'000'000'000;
  const auto bounded = [&](long value) {
    if (value > largest || value < -largest) fail(syntax, "the index is out of range");
    return value;
  };
  if (!is_index(syntax)) {
    fail(syntax, "an index is expected here: + - * mod min max of i, l, N, D, order[j], bound names and integers");
  }
  switch (syntax.kind) {
    case Kind::number:
      return static_cast<long>(syntax.value);
    case Kind::name:
      if (syntax.children.empty()) return *index_named(syntax.name);
      return shape_.order[at(index_within(syntax.children[0], shape_.players, "order"))];
    case Kind::negative:
      return -index(syntax.children[0]);
    case Kind::arithmetic: {
      long value = index(syntax.children[0]);
      for (std::size_t k = 0; k < syntax.name.size(); ++k) {
        const long next = index(syntax.children[k + 1]);
        value = bounded(syntax.name[k] == '+' ? value + next : syntax.name[k] == '-' ? value - next : value * next);
      }
      return value;
    }
    default:
      break;
  }
  if (syntax.children.size() != 2) fail(syntax, syntax.name + " takes two indices");
  const long a = index(syntax.children[0]);
  const long b = index(syntax.children[1]);
  if (syntax.name == "min") return std::min(a, b);
  if (syntax.name == "max") return std::max(a, b);
  if (b <= 0) fail(syntax.children[1], "mod(a, b) has b = " + std::to_string(b) + ", expected a positive b");
  return ((a % b) + b) % b;
}

bool Unrolling::is_index_condition(const Syntax& syntax) const {
  if (syntax.kind != Kind::comparison && syntax.kind != Kind::logical) return false;
  return std::all_of(syntax.children.begin(), syntax.children.end(), [&](const Syntax& child) {
    return syntax.kind == Kind::comparison ? is_index(child) : is_index_condition(child);
  });
}

bool Unrolling::holds(const Syntax& syntax) const {
  if (syntax.kind == Kind::logical) {
    if (syntax.name == "not") return !holds(syntax.children[0]);
    const auto child_holds = [&](const Syntax& child) { return holds(child); };
    return syntax.name == "and" ? std::all_of(syntax.children.begin(), syntax.children.end(), child_holds)
                                : std::any_of(syntax.children.begin(), syntax.children.end(), child_holds);
  }
  const long a = index(syntax.children[0]);
  const long b = index(syntax.children[1]);
  if (syntax.name == "<") return a < b;
  if (syntax.name == "<=") return a <= b;
  if (syntax.name == ">") return a > b;
  if (syntax.name == ">=") return a >= b;
  return syntax.name == "==" ? a == b : a != b;
}

/// From zero.
int Unrolling::index_within(const Syntax& syntax, int size, const std::string& of) const {
  const long value = index(syntax);
  if (value < 1 || value > size) {
    fail(syntax, "the index of " + of + " is " + std::to_string(value) + ", expected 1 to " + std::to_string(size));
  }
  return static_cast<int>(value - 1);
}

/// The entry that x[j,l] or v[j,l] names.
int Unrolling::entry(const Syntax& syntax) const {
  const std::size_t given = syntax.children.size();
  if (given != 2 && !(given == 1 && shape_.dimension == 1)) {
    fail(syntax, syntax.name + " has " + std::to_string(given) + " indices, expected " + syntax.name +
                     (shape_.dimension == 1 ? "[j] or " + syntax.name + "[j,l]" : "[j,l]"));
  }
  const int j = index_within(syntax.children[0], shape_.players, syntax.name);
  const int l = given == 2 ? index_within(syntax.children[1], shape_.dimension, syntax.name) : 0;
  if (syntax.name == "v" && !shape_.is_second_order(j)) {
    fail(syntax, "player " + std::to_string(j + 1) + " has no velocity, as its order is 1");
  }
  return shape_.entry(j, l);
}

int Unrolling::name(const Syntax& syntax) {
  const std::string& name = syntax.name;
  if (is_index(syntax)) return graph_.number(static_cast<Real>(index(syntax)));
  if (name == "pi" && syntax.children.empty()) return graph_.number(std::numbers::pi);
  const auto refuse_for = [&](const char* wanted) {
    fail(syntax, name + " stands there, which " + wanted + " may depend on");
  };
  if (name == "x") {
    if (place_.purpose == Purpose::disturbance) refuse_for("costs and dynamics");
    return graph_.leaf({LeafKind::action, entry(syntax)});
  }
  if (name == "v") {
    if (place_.purpose != Purpose::dynamics) refuse_for("dynamics alone");
    return graph_.leaf({LeafKind::velocity, entry(syntax)});
  }
  if (name == "t" && syntax.children.empty()) {
    if (place_.purpose != Purpose::disturbance) refuse_for("disturbances alone");
    return graph_.leaf({LeafKind::time, 0});
  }
  const NamedParameter* parameter = place_.parameters->find(name);
  if (parameter == nullptr) {
    std::string known = "x, v, t, i, l, N, D, order, pi";
    for (const NamedParameter& other : place_.parameters->declared) known += ", " + other.name;
    if (known.size() > 200) known = known.substr(0, known.rfind(',', 200)) + ", ...";
    fail(syntax, quoted(name) + " is no name here, expected one of " + known);
  }
  if (syntax.children.size() != parameter->size.size()) {
    fail(syntax, name + " has " + std::to_string(syntax.children.size()) + " indices, expected " +
                     std::to_string(parameter->size.size()));
  }
  int slot = 0;
  for (std::size_t k = 0; k < parameter->size.size(); ++k) {
    slot = slot * parameter->size[k] + index_within(syntax.children[k], parameter->size[k], name);
  }
  slot += parameter->first;
  return parameter->fixed ? graph_.number(place_.parameters->values[at(slot)])
                          : graph_.leaf({LeafKind::parameter, slot});
}

int Unrolling::call(const Syntax& syntax) {
  if (is_index(syntax)) return graph_.number(static_cast<Real>(index(syntax)));
  const auto* function =
      std::find_if(functions.begin(), functions.end(), [&](const Function& one) { return one.name == syntax.name; });
  if (function != functions.end()) {
    if (syntax.children.size() != function->arguments) {
      fail(syntax, syntax.name + " has " + std::to_string(syntax.children.size()) + " arguments, expected " +
                       std::to_string(function->arguments));
    }
    const int a = number(syntax.children[0]);
    return graph_.make(function->operation, a, function->arguments == 2 ? number(syntax.children[1]) : -1);
  }
  if (syntax.name == "if") {
    if (syntax.children.size() != 3) fail(syntax, "if takes a condition and two values");
    if (is_index_condition(syntax.children[0])) return number(syntax.children[holds(syntax.children[0]) ? 1 : 2]);
  }
  if (std::find(switching.begin(), switching.end(), syntax.name) != switching.end()) {
    fail(syntax, syntax.name + " of values that change in a run switches, which is not served; expected a smooth" +
                     " expression, such as tanh(s / width) for sign(s) or sqrt(s^2 + width^2) for abs(s)");
  }
  std::string known;
  for (const Function& one : functions) known += (known.empty() ? "" : ", ") + std::string(one.name);
  fail(syntax, quoted(syntax.name) + " is no function, expected one of " + known + ", if, sum, prod");
}

int Unrolling::reduction(const Syntax& syntax) {
  const bool is_sum = syntax.name == "sum";
  const long first = index(syntax.children[1]);
  const long last = index(syntax.children[2]);
  int total = graph_.number(is_sum ? 0.0 : 1.0);
  bound_.emplace_back(syntax.bound, 0);
  // the player's own term comes first, so that sums over players have the same structure for each of them
  const long own = place_.player + 1;
  const bool has_own = own >= first && own <= last;
  for (long term = first; term <= last; ++term) {
    const long k = !has_own || term > own ? term : term == first ? own : term - 1;
    if (++repetitions_ > most_repetitions) fail(syntax, "the sums unroll to too many terms");
    bound_.back().second = k;
    if (syntax.children.size() == 4) {
      if (!is_index_condition(syntax.children[3])) {
        fail(syntax.children[3], "a condition on indices is expected after \"if\" in a " + syntax.name);
      }
      if (!holds(syntax.children[3])) continue;
    }
    total = graph_.make(is_sum ? Operation::add : Operation::multiply, total, number(syntax.children[0]));
  }
  bound_.pop_back();
  return total;
}

int Unrolling::number(const Syntax& syntax) {
  switch (syntax.kind) {
    case Kind::number:
      return graph_.number(syntax.value);
    case Kind::name:
      return name(syntax);
    case Kind::call:
      return call(syntax);
    case Kind::reduction:
      return reduction(syntax);
    case Kind::negative:
      return graph_.make(Operation::negative, number(syntax.children[0]));
    case Kind::arithmetic: {
      int value = number(syntax.children[0]);
      for (std::size_t k = 0; k < syntax.name.size(); ++k) {
        const int next = number(syntax.children[k + 1]);
        const char sign = syntax.name[k];
        value = graph_.make(sign == '+'   ? Operation::add
                            : sign == '-' ? Operation::subtract
                            : sign == '*' ? Operation::multiply
                            : sign == '/' ? Operation::divide
                                          : Operation::power,
                            value, next);
      }
      return value;
    }
    case Kind::comparison:
    case Kind::logical:
      break;
  }
  fail(syntax, "a condition stands where a number is expected");
}

}  // namespace

int unroll(const Syntax& syntax, const Place& place, ExpressionGraph& graph) {
  return Unrolling(place, graph).number(syntax);
}

bool is_reserved_name(std::string_view name) {
  return std::find(words.begin(), words.end(), name) != words.end() ||
         std::find(switching.begin(), switching.end(), name) != switching.end() ||
         std::any_of(functions.begin(), functions.end(), [&](const Function& one) { return one.name == name; });
}

}  // namespace mixed_order_game
