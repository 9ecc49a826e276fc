#include "expression/enclosure.hpp"

#include <algorithm>
#include <cmath>

namespace mixed_order_game {

namespace {

// How a node depends on the leaves that are no points in the box: an affine argument of log is positive on a convex
// set.
enum Form : unsigned char { constant, affine, curved };

Form form_of(Operation operation, unsigned char a, unsigned char b) {
  const auto larger = static_cast<Form>(std::max(a, b));
  if (larger == constant) return constant;
  switch (operation) {
    case Operation::add:
    case Operation::subtract:
    case Operation::negative:
      return larger;
    case Operation::multiply:
      return a == constant || b == constant ? larger : curved;
    case Operation::divide:
      return b == constant ? larger : curved;
    default:
      return curved;
  }
}

Enclosure::Found both(const Enclosure::Found& a, const Enclosure::Found& b) {
  return {std::max(a.definition, b.definition), a.kink != nullptr ? a.kink : b.kink};
}

/// What a switch can hold while its s and its step are within bounds. One that switches at the very edge of them is not
/// decided: of two boxes that meet there, one at least has to tell.
Interval held_values(const Switch& one, const Interval& s, const Interval& step) {
  switch (one.kind) {
    case SwitchKind::positive:
    case SwitchKind::not_negative:
      return s.lower > 0.0 ? Interval::of(1.0) : s.upper < 0.0 ? Interval::of(0.0) : Interval{0.0, 1.0};
    case SwitchKind::sign:
      return s.lower > 0.0 ? Interval::of(1.0) : s.upper < 0.0 ? Interval::of(-1.0) : Interval{-1.0, 1.0};
    case SwitchKind::count:
      break;
  }
  if (!(step.lower > 0.0)) return {};
  const Interval turns = enclose(Operation::divide, s, step);
  const Real first = std::floor(turns.lower);
  return {turns.lower == first ? first - 1.0 : first, std::floor(turns.upper)};
}

}  // namespace

Enclosure::Enclosure(const ExpressionGraph& graph, std::vector<int> nodes)
    : graph_(graph), nodes_(std::move(nodes)), rows_(at(graph.size())) {
  std::vector<bool> is_needed(at(graph.size()));
  const auto need = [&](int node) {
    if (node >= 0) is_needed[at(node)] = true;
  };
  for (const int node : nodes_) need(node);
  for (int k = graph.size() - 1; k >= 0; --k) {
    if (!is_needed[at(k)]) continue;
    needed_.push_back(k);
    const GraphNode& node = graph.node(k);
    if (node.operation == Operation::number) continue;
    if (node.operation == Operation::leaf) {
      if (graph.leaf_of(k).kind != LeafKind::held) continue;
      const Switch& one = graph.switches()[at(graph.leaf_of(k).index - graph.first_switch())];
      need(one.value);
      need(one.step);
      continue;
    }
    has_branches_ = has_branches_ || node.operation == Operation::choose ||
                    node.operation == Operation::multiply_unless_zero || node.operation == Operation::usable;
    need(node.a);
    need(node.b);
  }
  std::reverse(needed_.begin(), needed_.end());
}

std::vector<Leaf> Enclosure::leaves() const {
  std::vector<Leaf> leaves;
  for (const int k : needed_) {
    if (graph_.node(k).operation == Operation::leaf) leaves.push_back(graph_.leaf_of(k));
  }
  return leaves;
}

Enclosure::Node Enclosure::of_switch(const Switch& one) const {
  const Node& s = rows_[at(one.value)];
  const Interval step = one.step < 0 ? Interval::of(1.0) : rows_[at(one.step)].value;
  Node node{.value = held_values(one, s.value, step), .form = constant, .found = {s.found.definition, nullptr}};
  if (!node.value.is_point()) {
    node.form = curved;
    node.found.kink = &one;
  }
  return node;
}

/// The operations that let a branch be taken or not.
Enclosure::Node Enclosure::of_branch(const GraphNode& node) const {
  const Node& a = rows_[at(node.a)];
  if (node.operation == Operation::usable) {
    if (a.found.definition == Definition::everywhere) return {.value = Interval::of(1.0), .form = constant};
    if (a.found.definition == Definition::nowhere) return {.value = Interval::of(0.0), .form = constant};
    return {.value = {0.0, 1.0}, .form = curved, .found = {Definition::unknown, a.found.kink}};
  }
  if (a.value.is_point() && a.value.lower == 0.0 && a.found.definition != Definition::nowhere) return a;
  const Node& b = rows_[at(node.b)];
  const bool is_choice = node.operation == Operation::choose;
  Node result{.value = is_choice ? b.value : enclose(Operation::multiply, a.value, b.value),
              .form = form_of(is_choice && a.value.is_point() ? Operation::add : Operation::multiply, a.form, b.form),
              .found = both(a.found, b.found)};
  if (is_choice && a.value.contains(0.0)) {
    result.value = {std::min(result.value.lower, 0.0), std::max(result.value.upper, 0.0)};
    if (b.found.definition != Definition::everywhere) result.found.definition = Definition::unknown;
  }
  return result;
}

Enclosure::Found Enclosure::evaluate(const std::function<Interval(const Leaf&)>& box,
                                     std::vector<Interval>& values) const {
  for (const int k : needed_) {
    const GraphNode& node = graph_.node(k);
    Node& row = rows_[at(k)];
    if (node.operation == Operation::number) {
      row = {.value = Interval::of(node.value), .form = constant};
      continue;
    }
    if (node.operation == Operation::leaf) {
      const Leaf& leaf = graph_.leaf_of(k);
      if (leaf.kind == LeafKind::held) {
        row = of_switch(graph_.switches()[at(leaf.index - graph_.first_switch())]);
      } else {
        const Interval value = box(leaf);
        row = {.value = value, .form = value.is_point() ? constant : affine};
      }
      continue;
    }
    if (node.operation == Operation::choose || node.operation == Operation::multiply_unless_zero ||
        node.operation == Operation::usable) {
      row = of_branch(node);
      continue;
    }
    Node& a = rows_[at(node.a)];
    Node& b = rows_[at(node.b < 0 ? node.a : node.b)];
    Found found = both(a.found, b.found);
    const Domain domain = domain_of(node.operation, a.value, b.value);
    if (found.definition == Definition::nowhere || domain.a.is_empty() || domain.b.is_empty()) {
      row = {.value = Interval::none(), .found = {Definition::nowhere, found.kink}};
      continue;
    }
    const auto is_cut_at = [&](const Node& operand) {
      const bool is_convex = operand.form != curved && !has_branches_;
      found.definition = std::max(found.definition, is_convex ? Definition::convex : Definition::unknown);
    };
    const auto narrow = [&](Node& operand, const Interval& narrowed) {
      if (narrowed.lower == operand.value.lower && narrowed.upper == operand.value.upper) return;
      if (!has_branches_) operand.value = narrowed;  // of use to all that comes after
      is_cut_at(operand);
    };
    if (!domain.is_whole) found.definition = Definition::unknown;
    narrow(a, domain.a);
    if (node.b >= 0) narrow(b, domain.b);
    if (domain.meets_edge) is_cut_at(node.operation == Operation::divide ? b : a);
    row = {.value = node.operation == Operation::multiply && &a == &b ? squared(a.value)
                                                                      : enclose(node.operation, a.value, b.value),
           .form = form_of(node.operation, a.form, b.form),
           .found = found};
  }
  values.clear();
  Found found;
  for (const int node : nodes_) {
    values.push_back(rows_[at(node)].value);
    found = both(found, rows_[at(node)].found);
  }
  return found;
}

Enclosure::Found Enclosure::evaluate(const std::vector<Interval>& actions, const std::vector<Real>& parameters,
                                     std::vector<Interval>& values) const {
  return evaluate(
      [&](const Leaf& leaf) {
        switch (leaf.kind) {
          case LeafKind::action:
            return actions[at(leaf.index)];
          case LeafKind::parameter:
            return Interval::of(parameters[at(leaf.index)]);
          default:
            return Interval{};
        }
      },
      values);
}

}  // namespace mixed_order_game
