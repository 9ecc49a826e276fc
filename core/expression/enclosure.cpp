#include "expression/enclosure.hpp"

#include <algorithm>

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

}  // namespace

Enclosure::Enclosure(const ExpressionGraph& graph, std::vector<int> nodes)
    : graph_(graph), nodes_(std::move(nodes)), rows_(at(graph.size())), form_(at(graph.size())) {
  std::vector<bool> is_needed(at(graph.size()));
  for (const int node : nodes_) is_needed[at(node)] = true;
  for (int k = graph.size() - 1; k >= 0; --k) {
    if (!is_needed[at(k)]) continue;
    const GraphNode& node = graph.node(k);
    is_smooth_ = is_smooth_ && is_smooth_operation(node.operation) &&
                 (node.operation != Operation::leaf || graph.leaf_of(k).kind <= LeafKind::parameter);
    needed_.push_back(k);
    if (node.operation == Operation::number || node.operation == Operation::leaf) continue;
    is_needed[at(node.a)] = true;
    if (node.b >= 0) is_needed[at(node.b)] = true;
  }
  std::reverse(needed_.begin(), needed_.end());
}

Enclosure::Definition Enclosure::evaluate(const std::function<Interval(const Leaf&)>& box,
                                          std::vector<Interval>& values) const {
  Definition definition = Definition::everywhere;
  for (const int k : needed_) {
    const GraphNode& node = graph_.node(k);
    if (node.operation == Operation::number) {
      rows_[at(k)] = Interval::of(node.value);
      form_[at(k)] = constant;
      continue;
    }
    if (node.operation == Operation::leaf) {
      rows_[at(k)] = box(graph_.leaf_of(k));
      form_[at(k)] = rows_[at(k)].is_point() ? constant : affine;
      continue;
    }
    const int a = node.a;
    const int b = node.b < 0 ? node.a : node.b;
    const Domain domain = domain_of(node.operation, rows_[at(a)], rows_[at(b)]);
    if (domain.a.is_empty() || domain.b.is_empty()) return Definition::nowhere;
    const auto is_cut_at = [&](int operand) {
      if (definition == Definition::everywhere) definition = Definition::convex;
      if (form_[at(operand)] == curved) definition = Definition::unknown;
    };
    const auto narrow = [&](int operand, const Interval& narrowed) {
      Interval& row = rows_[at(operand)];
      if (narrowed.lower == row.lower && narrowed.upper == row.upper) return;
      row = narrowed;  // of use to all that comes after
      is_cut_at(operand);
    };
    if (!domain.is_whole) definition = Definition::unknown;
    narrow(a, domain.a);
    if (node.b >= 0) narrow(b, domain.b);
    if (domain.meets_edge) is_cut_at(node.operation == Operation::divide ? b : a);
    rows_[at(k)] = node.operation == Operation::multiply && a == b
                       ? square(rows_[at(a)])
                       : enclose(node.operation, rows_[at(a)], rows_[at(b)]);
    form_[at(k)] = form_of(node.operation, form_[at(a)], form_[at(b)]);
  }
  values.clear();
  for (const int node : nodes_) values.push_back(rows_[at(node)]);
  return definition;
}

}  // namespace mixed_order_game
