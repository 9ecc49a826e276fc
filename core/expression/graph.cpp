#include "expression/graph.hpp"

#include <bit>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "errors.hpp"
#include "expression/noise.hpp"

namespace mixed_order_game {

Real apply(Operation operation, Real a, Real b) {
  switch (operation) {
    case Operation::number:
    case Operation::leaf:
      return a;
    case Operation::add:
      return a + b;
    case Operation::subtract:
      return a - b;
    case Operation::multiply:
      return a * b;
    case Operation::divide:
      return a / b;
    case Operation::negative:
      return -a;
    case Operation::power:
      return std::pow(a, b);
    case Operation::power_log:
      return a == 0.0 ? 0.0 : std::pow(a, b) * std::log(a);
    case Operation::sqrt:
      return std::sqrt(a);
    case Operation::exp:
      return std::exp(a);
    case Operation::expm1:
      return std::expm1(a);
    case Operation::log:
      return std::log(a);
    case Operation::log1p:
      return std::log1p(a);
    case Operation::sin:
      return std::sin(a);
    case Operation::cos:
      return std::cos(a);
    case Operation::tan:
      return std::tan(a);
    case Operation::asin:
      return std::asin(a);
    case Operation::acos:
      return std::acos(a);
    case Operation::atan:
      return std::atan(a);
    case Operation::atan2:
      return std::atan2(a, b);
    case Operation::sinh:
      return std::sinh(a);
    case Operation::cosh:
      return std::cosh(a);
    case Operation::tanh:
      return std::tanh(a);
    case Operation::erf:
      return std::erf(a);
    case Operation::hypot:
      return std::hypot(a, b);
    case Operation::abs:
      return std::fabs(a);
    case Operation::min:
      return b < a ? b : a;
    case Operation::max:
      return b > a ? b : a;
    case Operation::floor:
      return std::floor(a);
    case Operation::sign_of:
      return a >= 0.0 ? 1.0 : -1.0;
    case Operation::positive:
      return a > 0.0 ? 1.0 : 0.0;
    case Operation::not_negative:
      return a >= 0.0 ? 1.0 : 0.0;
    case Operation::sign:
      return a > 0.0 ? 1.0 : a < 0.0 ? -1.0 : 0.0;
    case Operation::choose:
      return a != 0.0 ? b : 0.0;
    case Operation::multiply_unless_zero:
      return a != 0.0 ? a * b : 0.0;
    case Operation::usable:
      return std::isfinite(a) ? 1.0 : 0.0;
    case Operation::alternating:
      return a == 2.0 * std::floor(0.5 * a) ? 1.0 : -1.0;
    case Operation::noise:
      return noise(a, b);
  }
  return a;
}

std::size_t ExpressionGraph::Hash::operator()(const Key& key) const {
  std::uint64_t hash = key.bits;
  for (const std::uint64_t part : {static_cast<std::uint64_t>(key.operation), static_cast<std::uint64_t>(key.a) << 20U,
                                   static_cast<std::uint64_t>(key.b) << 40U}) {
    hash = (hash ^ part) * 0x9E3779B97F4A7C15U;
    hash ^= hash >> 29U;
  }
  return hash;
}

int ExpressionGraph::find_or_add(const GraphNode& node) {
  const Key key{node.operation, node.a, node.b, std::bit_cast<std::uint64_t>(node.value)};
  const auto [found, is_new] = known_.try_emplace(key, size());
  if (is_new) {
    if (nodes_.size() >= most_nodes_) {
      throw GameError("the expressions unroll to more than " + std::to_string(most_nodes_) + " operations");
    }
    nodes_.push_back(node);
    traits_.push_back(traits_of(node));
  }
  return found->second;
}

std::uint8_t ExpressionGraph::traits_of(const GraphNode& node) const {
  std::uint8_t traits = 0;
  switch (node.operation) {
    case Operation::number:
      return 0;
    case Operation::leaf:
      switch (leaves_[at(node.a)].kind) {
        case LeafKind::parameter:
          return 0;
        case LeafKind::held:
          return holding;
        default:
          return varying;
      }
    case Operation::divide:
    case Operation::power:
    case Operation::power_log:
    case Operation::sqrt:
    case Operation::exp:
    case Operation::expm1:
    case Operation::log:
    case Operation::log1p:
    case Operation::tan:
    case Operation::asin:
    case Operation::acos:
    case Operation::sinh:
    case Operation::cosh:
      traits = undefined;
      break;
    default:
      break;
  }
  traits |= traits_[at(node.a)];
  if (node.b >= 0) traits |= traits_[at(node.b)];
  return traits;
}

int ExpressionGraph::number(Real value) { return find_or_add({.operation = Operation::number, .value = value}); }

int ExpressionGraph::leaf(Leaf leaf) {
  const auto found = leaf_nodes_.find(leaf);
  if (found != leaf_nodes_.end()) return found->second;
  leaves_.push_back(leaf);
  const int node = find_or_add({.operation = Operation::leaf, .a = static_cast<int>(leaves_.size()) - 1});
  leaf_nodes_.emplace(leaf, node);
  return node;
}

int ExpressionGraph::make(Operation operation, int a, int b) {
  const auto is_number = [&](int k) { return k < 0 || node(k).operation == Operation::number; };
  if (is_number(a) && is_number(b)) {
    // what is not finite stays, so that it is met where the expression is evaluated
    const Real value = apply(operation, node(a).value, b < 0 ? 0.0 : node(b).value);
    if (std::isfinite(value)) return number(value);
  }
  switch (operation) {
    case Operation::add:
      if (this->is_number(a, 0.0)) return b;
      if (this->is_number(b, 0.0)) return a;
      if (node(b).operation == Operation::negative) return make(Operation::subtract, a, node(b).a);
      break;
    case Operation::subtract:
      if (this->is_number(b, 0.0)) return a;
      if (this->is_number(a, 0.0)) return make(Operation::negative, b);
      if (a == b) return number(0.0);
      break;
    case Operation::multiply:
      if (this->is_number(a, 0.0) || this->is_number(b, 0.0)) return number(0.0);
      if (this->is_number(a, 1.0)) return b;
      if (this->is_number(b, 1.0)) return a;
      if (this->is_number(a, -1.0)) return make(Operation::negative, b);
      if (this->is_number(b, -1.0)) return make(Operation::negative, a);
      break;
    case Operation::multiply_unless_zero:
      if (this->is_number(a, 0.0) || this->is_number(b, 0.0)) return number(0.0);
      if (this->is_number(a)) return make(Operation::multiply, a, b);
      if (this->is_number(b, 1.0)) return a;
      break;
    case Operation::choose:
      if (this->is_number(b, 0.0)) return b;
      if (this->is_number(a)) return this->is_number(a, 0.0) ? number(0.0) : b;
      break;
    case Operation::divide:
      if (this->is_number(a, 0.0)) return a;
      if (this->is_number(b, 1.0)) return a;
      break;
    case Operation::negative:
      if (node(a).operation == Operation::negative) return node(a).a;
      break;
    case Operation::power:
      if (this->is_number(b, 0.0)) return number(1.0);
      if (this->is_number(b, 1.0)) return a;
      if (this->is_number(b, 2.0)) return make(Operation::multiply, a, a);
      if (this->is_number(b, 3.0)) return make(Operation::multiply, make(Operation::multiply, a, a), a);
      if (this->is_number(b, -1.0)) return make(Operation::divide, number(1.0), a);
      if (this->is_number(b, 0.5)) return make(Operation::sqrt, a);
      break;
    default:
      break;
  }
  return find_or_add({.operation = operation, .a = a, .b = b});
}

std::pair<int, int> ExpressionGraph::partials(int k) {
  const auto [operation, a, b, value] = node(k);
  const auto times = [&](int x, int y) { return make(Operation::multiply, x, y); };
  const auto over = [&](int x, int y) { return make(Operation::divide, x, y); };
  const auto minus = [&](int x, int y) { return make(Operation::subtract, x, y); };
  const auto plus = [&](int x, int y) { return make(Operation::add, x, y); };
  const auto negative = [&](int x) { return make(Operation::negative, x); };
  const int one = number(1.0);
  switch (operation) {
    case Operation::number:
    case Operation::leaf:
      return {-1, -1};
    case Operation::add:
      return {one, one};
    case Operation::subtract:
      return {one, number(-1.0)};
    case Operation::multiply:
      return {b, a};
    case Operation::divide:
      return {over(one, b), negative(over(k, b))};
    case Operation::negative:
      return {number(-1.0), -1};
    case Operation::power:
      return {times(b, make(Operation::power, a, minus(b, one))), make(Operation::power_log, a, b)};
    case Operation::power_log:  // b a^(b-1) log a + a^(b-1), and a^b log^2 a
      return {plus(times(b, make(Operation::power_log, a, minus(b, one))), make(Operation::power, a, minus(b, one))),
              times(k, make(Operation::log, a))};
    case Operation::sqrt:
      return {over(number(0.5), k), -1};
    case Operation::exp:
      return {k, -1};
    case Operation::expm1:
      return {plus(k, one), -1};
    case Operation::log:
      return {over(one, a), -1};
    case Operation::log1p:
      return {over(one, plus(one, a)), -1};
    case Operation::sin:
      return {make(Operation::cos, a), -1};
    case Operation::cos:
      return {negative(make(Operation::sin, a)), -1};
    case Operation::tan:
      return {plus(one, times(k, k)), -1};
    case Operation::asin:
      return {over(one, make(Operation::sqrt, minus(one, times(a, a)))), -1};
    case Operation::acos:
      return {over(number(-1.0), make(Operation::sqrt, minus(one, times(a, a)))), -1};
    case Operation::atan:
      return {over(one, plus(one, times(a, a))), -1};
    case Operation::atan2: {  // of y and x
      const int squares = plus(times(a, a), times(b, b));
      return {over(b, squares), negative(over(a, squares))};
    }
    case Operation::sinh:
      return {make(Operation::cosh, a), -1};
    case Operation::cosh:
      return {make(Operation::sinh, a), -1};
    case Operation::tanh:
      return {minus(one, times(k, k)), -1};
    case Operation::erf:
      return {times(number(2.0 * std::numbers::inv_sqrtpi), make(Operation::exp, negative(times(a, a)))), -1};
    case Operation::hypot:
      return {over(a, k), over(b, k)};
    case Operation::abs:
      return {make(Operation::sign_of, a), -1};
    case Operation::max: {  // factors that choose
      const int first = make(Operation::not_negative, minus(a, b));
      return {first, minus(one, first)};
    }
    case Operation::min: {
      const int first = make(Operation::not_negative, minus(b, a));
      return {first, minus(one, first)};
    }
    case Operation::choose:
      return {-1, a};
    case Operation::multiply_unless_zero:
      return {b, a};
    case Operation::floor:
    case Operation::sign_of:
    case Operation::positive:
    case Operation::not_negative:
    case Operation::sign:
    case Operation::usable:
    case Operation::alternating:
    case Operation::noise:
      return {-1, -1};
  }
  return {-1, -1};
}

int ExpressionGraph::held(Switch wanted) {
  for (std::size_t k = 0; k < switches_.size(); ++k) {
    Switch& known = switches_[k];
    if (known.kind != wanted.kind || known.value != wanted.value || known.step != wanted.step ||
        known.is_bend != wanted.is_bend) {
      continue;
    }
    if (known.guard >= 0 && known.guard != wanted.guard) {  // either
      known.guard = wanted.guard < 0 ? -1 : make(Operation::max, known.guard, wanted.guard);
    }
    return leaf({LeafKind::held, first_switch_ + static_cast<int>(k)});
  }
  switches_.push_back(std::move(wanted));
  return leaf({LeafKind::held, first_switch_ + static_cast<int>(switches_.size()) - 1});
}

std::vector<std::pair<Leaf, int>> ExpressionGraph::derivatives(int node_of) {
  // adjoints from the node down to the leaves; operands have lower numbers than what is made of them
  struct Adjoint {
    int weight;
    bool may_be_masked;  // 0 in a branch that is not taken, in which partial derivatives need not be finite
  };
  std::map<int, Adjoint, std::greater<>> adjoint{{node_of, {number(1.0), false}}};
  std::vector<std::pair<Leaf, int>> along;
  while (!adjoint.empty()) {
    const int k = adjoint.begin()->first;
    const auto [weight, may_be_masked] = adjoint.begin()->second;
    adjoint.erase(adjoint.begin());
    const Operation operation = node(k).operation;
    if (operation == Operation::leaf) {
      if (!is_number(weight, 0.0) && leaf_of(k).kind != LeafKind::held) along.emplace_back(leaf_of(k), weight);
      continue;
    }
    const int operands[] = {node(k).a, node(k).b};
    if (operation == Operation::number) continue;
    const auto [first, second] = partials(k);
    const int partial[] = {first, second};
    const bool chooses = operation == Operation::choose || operation == Operation::min || operation == Operation::max;
    for (int which = 0; which < 2; ++which) {
      if (partial[which] < 0 || operands[which] < 0) continue;
      if (node(operands[which]).operation == Operation::number) continue;
      const int share = chooses         ? make(Operation::choose, partial[which], weight)
                        : may_be_masked ? make(Operation::multiply_unless_zero, weight, partial[which])
                                        : make(Operation::multiply, weight, partial[which]);
      if (is_number(share, 0.0)) continue;
      const bool masked = may_be_masked || chooses || (operation == Operation::multiply_unless_zero && which == 1);
      const auto [found, is_new] = adjoint.try_emplace(operands[which], Adjoint{share, masked});
      if (is_new) continue;
      found->second.weight = make(Operation::add, found->second.weight, share);
      found->second.may_be_masked = found->second.may_be_masked || masked;
    }
  }
  return along;
}

}  // namespace mixed_order_game
