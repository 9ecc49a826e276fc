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
constexpr std::array<std::string_view, 10> switching{"abs", "min", "max",    "sign",  "floor",
                                                     "mod", "if",  "square", "pulse", "noise"};
constexpr std::array<std::string_view, 16> words{"x",  "v",  "t",   "i",   "l",   "N",  "D",    "order",
                                                 "pi", "or", "and", "not", "for", "in", "prod", "sum"};
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

  /// A condition as nodes that are 1 where it holds and 0 elsewhere: as it is held between events, and as it is where
  /// the expression is evaluated.
  struct Truth {
    int held;
    int there;
  };
  Truth truth(const Syntax& syntax);
  Truth comparison(const Syntax& syntax);
  /// Nodes a and b, or what they are made of, where a truth holds and elsewhere.
  int choice(const Truth& truth, int a, int b);
  template <typename A, typename B>
  int branches(const Syntax& condition, A a, B b);

  Truth switched(SwitchKind kind, Operation there, int value, const Syntax& syntax);
  int count(int value, int step, const Syntax& syntax);
  bool is_timed(int value);
  void require_arguments(const Syntax& syntax, std::size_t expected) const;
  /// A value that does not change in a run, and what it must be when it is set.
  int of_parameters(const Syntax& of, std::size_t argument, const char* name);
  int of_parameters(const Syntax& of, std::size_t argument, const char* name, Requirement::Kind kind);

  int name(const Syntax& syntax);
  int call(const Syntax& syntax);
  int switching_call(const Syntax& syntax);
  int extremum(const Syntax& syntax);
  int wave(const Syntax& syntax);
  int reduction(const Syntax& syntax);
  int entry(const Syntax& syntax) const;

  const Place& place_;
  const Shape& shape_;
  ExpressionGraph& graph_;
  std::vector<std::pair<std::string, long>> bound_;  // innermost last
  long repetitions_ = 0;
  int guard_ = -1;  // 1 where the branch is taken that is being unrolled
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

Unrolling::Truth Unrolling::truth(const Syntax& syntax) {
  const auto both = [&](bool holds) {
    const int node = graph_.number(holds ? 1.0 : 0.0);
    return Truth{node, node};
  };
  if (is_index_condition(syntax)) return both(holds(syntax));
  if (syntax.kind == Kind::comparison) return comparison(syntax);
  if (syntax.kind != Kind::logical) fail(syntax, "a number stands where a condition is expected");
  if (syntax.name == "not") {
    const Truth inner = truth(syntax.children[0]);
    const auto opposite = [&](int node) { return graph_.make(Operation::subtract, graph_.number(1.0), node); };
    return {opposite(inner.held), opposite(inner.there)};
  }
  // what is decided by indices ends it before the rest is looked at
  const bool is_and = syntax.name == "and";
  const auto joined = [&](int a, int b) { return graph_.make(is_and ? Operation::multiply : Operation::max, a, b); };
  Truth all = both(is_and);
  for (const Syntax& child : syntax.children) {
    const Truth one = truth(child);
    if (graph_.is_number(one.held, is_and ? 0.0 : 1.0)) return one;
    if (graph_.is_number(one.held)) continue;
    all = graph_.is_number(all.held) ? one : Truth{joined(all.held, one.held), joined(all.there, one.there)};
  }
  return all;
}

Unrolling::Truth Unrolling::comparison(const Syntax& syntax) {
  if (syntax.name == "==" || syntax.name == "!=") {
    fail(syntax, syntax.name + " stands between values that change in a run, expected < <= > >=, or indices");
  }
  const int a = number(syntax.children[0]);
  const int b = number(syntax.children[1]);
  // of a < b and b > a, and of a < b and a >= b, one switch is made
  const bool turned = b < a;
  const int difference = graph_.make(Operation::subtract, turned ? b : a, turned ? a : b);
  const bool strict = syntax.name.size() == 1;
  const bool is_greater = (syntax.name[0] == '>') != turned;
  const auto opposite = [&](int node) { return graph_.make(Operation::subtract, graph_.number(1.0), node); };
  if (is_greater == strict) {
    const Truth positive = switched(SwitchKind::positive, Operation::positive, difference, syntax);
    return is_greater ? positive : Truth{opposite(positive.held), opposite(positive.there)};
  }
  const Truth not_negative = switched(SwitchKind::not_negative, Operation::not_negative, difference, syntax);
  return is_greater ? not_negative : Truth{opposite(not_negative.held), opposite(not_negative.there)};
}

/// Whether a node is affine in time while switches hold.
bool Unrolling::is_timed(int value) {
  if (place_.purpose != Purpose::disturbance) return false;
  const auto derivatives = graph_.derivatives(value);
  return std::none_of(derivatives.begin(), derivatives.end(), [&](const auto& along) {
    return along.first.kind == LeafKind::time && graph_.varies(along.second);
  });
}

Unrolling::Truth Unrolling::switched(SwitchKind kind, Operation there, int value, const Syntax& syntax) {
  const int at_point = graph_.make(there, value);
  if (!graph_.varies(value)) return {at_point, at_point};
  const int held =
      graph_.held({.kind = kind, .value = value, .guard = guard_, .is_timed = is_timed(value), .text = syntax.text});
  return {held, at_point};
}

/// The largest integer k with k step <= value.
int Unrolling::count(int value, int step, const Syntax& syntax) {
  if (!graph_.varies(value)) return graph_.make(Operation::floor, graph_.make(Operation::divide, value, step));
  return graph_.held({.kind = SwitchKind::count,
                      .value = value,
                      .step = step,
                      .guard = guard_,
                      .is_timed = is_timed(value),
                      .text = syntax.text});
}

int Unrolling::choice(const Truth& truth, int a, int b) {
  const auto chosen = [&](int c) {
    const int opposite = graph_.make(Operation::subtract, graph_.number(1.0), c);
    return graph_.make(Operation::add, graph_.make(Operation::choose, c, a),
                       graph_.make(Operation::choose, opposite, b));
  };
  if (a == b) return a;
  if (truth.held == truth.there || !(graph_.may_be_undefined(a) || graph_.may_be_undefined(b))) {
    return chosen(truth.held);
  }
  // a held branch without a finite value gives way to the one that its condition chooses there
  const int usable = graph_.make(Operation::usable, chosen(truth.held));
  const int unusable = graph_.make(Operation::subtract, graph_.number(1.0), usable);
  return chosen(graph_.make(Operation::add, graph_.make(Operation::choose, usable, truth.held),
                            graph_.make(Operation::choose, unusable, truth.there)));
}

template <typename A, typename B>
int Unrolling::branches(const Syntax& condition, A a, B b) {
  const Truth decided = truth(condition);
  if (graph_.is_number(decided.held)) return graph_.is_number(decided.held, 0.0) ? b() : a();
  const int outer = guard_;
  const auto guarded = [&](int holds, auto branch) {
    guard_ = outer < 0 ? holds : graph_.make(Operation::multiply, outer, holds);
    const int node = branch();
    guard_ = outer;
    return node;
  };
  const int first = guarded(decided.held, a);
  const int second = guarded(graph_.make(Operation::subtract, graph_.number(1.0), decided.held), b);
  return choice(decided, first, second);
}

void Unrolling::require_arguments(const Syntax& syntax, std::size_t expected) const {
  if (syntax.children.size() == expected) return;
  fail(syntax, syntax.name + " has " + std::to_string(syntax.children.size()) + " arguments, expected " +
                   std::to_string(expected));
}

int Unrolling::of_parameters(const Syntax& of, std::size_t argument, const char* name) {
  const int node = number(of.children[argument]);
  if (!graph_.has_only_parameters(node)) {
    fail(of.children[argument], std::string("the ") + name + " of " + of.name +
                                    " changes in a run, expected an expression of parameters and indices");
  }
  return node;
}

int Unrolling::of_parameters(const Syntax& of, std::size_t argument, const char* name, Requirement::Kind kind) {
  const int node = of_parameters(of, argument, name);
  graph_.requirements.push_back({kind, node, std::string("the ") + name + " of \"" + of.text + "\""});
  return node;
}

/// The greater or lesser of two values, or the magnitude of one.
int Unrolling::extremum(const Syntax& syntax) {
  const bool is_abs = syntax.name == "abs";
  require_arguments(syntax, is_abs ? 1 : 2);
  const int a = number(syntax.children[0]);
  const int b = is_abs ? graph_.make(Operation::negative, a) : number(syntax.children[1]);
  const int difference = is_abs                 ? a
                         : syntax.name == "max" ? graph_.make(Operation::subtract, a, b)
                                                : graph_.make(Operation::subtract, b, a);
  const auto there = [&] {
    const Operation operation = is_abs ? Operation::abs : syntax.name == "max" ? Operation::max : Operation::min;
    return graph_.make(operation, a, is_abs ? -1 : b);
  };
  if (!graph_.varies(difference)) return there();
  // gradients jump where costs bend
  if (place_.purpose == Purpose::cost) {
    return choice(switched(SwitchKind::not_negative, Operation::not_negative, difference, syntax), a, b);
  }
  graph_.held(
      {.kind = SwitchKind::not_negative, .value = difference, .guard = guard_, .is_bend = true, .text = syntax.text});
  return there();
}

/// square, pulse and noise.
int Unrolling::wave(const Syntax& syntax) {
  if (place_.purpose != Purpose::disturbance) {
    fail(syntax, syntax.name + " stands there, which disturbances alone may depend on");
  }
  const int t = graph_.leaf({LeafKind::time, 0});
  if (syntax.name == "noise") {
    require_arguments(syntax, 2);
    const int seed = of_parameters(syntax, 0, "seed", Requirement::Kind::seed);
    const int hold = of_parameters(syntax, 1, "holding time", Requirement::Kind::positive);
    return graph_.make(Operation::noise, seed, count(t, hold, syntax));
  }
  require_arguments(syntax, syntax.name == "square" ? 2 : 3);
  const int since = number(syntax.children[0]);
  const auto derivatives = graph_.derivatives(since);
  const bool counts_time = std::any_of(derivatives.begin(), derivatives.end(), [&](const auto& along) {
    return along.first.kind == LeafKind::time && graph_.is_number(along.second, 1.0);
  });
  if (!counts_time || graph_.holds(since)) {
    fail(syntax.children[0],
         "the first argument of " + syntax.name + " is not t plus or minus an expression of parameters and indices");
  }
  if (syntax.name == "square") {
    const int period = of_parameters(syntax, 1, "period", Requirement::Kind::positive);
    return graph_.make(Operation::alternating,
                       count(since, graph_.make(Operation::multiply, graph_.number(0.5), period), syntax));
  }
  const int start = of_parameters(syntax, 1, "start");
  const int end = graph_.make(Operation::add, start, of_parameters(syntax, 2, "width"));
  const auto has_passed = [&](int time) {
    return switched(SwitchKind::not_negative, Operation::not_negative, graph_.make(Operation::subtract, since, time),
                    syntax)
        .held;
  };
  const int before_end = graph_.make(Operation::subtract, graph_.number(1.0), has_passed(end));
  return graph_.make(Operation::multiply, has_passed(start), before_end);
}

int Unrolling::switching_call(const Syntax& syntax) {
  const std::string& name = syntax.name;
  if (name == "if") {
    if (syntax.children.size() != 3) fail(syntax, "if takes a condition and two values");
    return branches(
        syntax.children[0], [&] { return number(syntax.children[1]); }, [&] { return number(syntax.children[2]); });
  }
  if (name == "abs" || name == "min" || name == "max") return extremum(syntax);
  if (name == "square" || name == "pulse" || name == "noise") return wave(syntax);
  if (name == "mod") {  // a - b floor(a / b)
    require_arguments(syntax, 2);
    const int a = number(syntax.children[0]);
    const int b = of_parameters(syntax, 1, "second argument", Requirement::Kind::positive);
    return graph_.make(Operation::subtract, a, graph_.make(Operation::multiply, b, count(a, b, syntax)));
  }
  require_arguments(syntax, 1);
  const int a = number(syntax.children[0]);
  if (name == "floor") return count(a, graph_.number(1.0), syntax);
  return switched(SwitchKind::sign, Operation::sign, a, syntax).held;
}

int Unrolling::call(const Syntax& syntax) {
  if (is_index(syntax)) return graph_.number(static_cast<Real>(index(syntax)));
  const auto* function =
      std::find_if(functions.begin(), functions.end(), [&](const Function& one) { return one.name == syntax.name; });
  if (function != functions.end()) {
    require_arguments(syntax, function->arguments);
    const int a = number(syntax.children[0]);
    return graph_.make(function->operation, a, function->arguments == 2 ? number(syntax.children[1]) : -1);
  }
  if (std::find(switching.begin(), switching.end(), syntax.name) != switching.end()) return switching_call(syntax);
  std::string known;
  for (const Function& one : functions) known += std::string(one.name) + ", ";
  for (const std::string_view one : switching) known += std::string(one) + ", ";
  fail(syntax, quoted(syntax.name) + " is no function, expected one of " + known + "sum, prod");
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
    const auto body = [&] { return number(syntax.children[0]); };
    const auto nothing = [&] { return graph_.number(is_sum ? 0.0 : 1.0); };
    total = graph_.make(is_sum ? Operation::add : Operation::multiply, total,
                        syntax.children.size() == 4 ? branches(syntax.children[3], body, nothing) : body());
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
