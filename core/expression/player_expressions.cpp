#include "expression/player_expressions.hpp"

#include <algorithm>
#include <map>
#include <set>

namespace mixed_order_game {

namespace {

/// The leaves that the switches of a node, and the switches of those, depend on.
std::set<Leaf> leaves_of_switches(const ExpressionGraph& graph, int of) {
  std::set<Leaf> leaves;
  std::vector<std::pair<int, bool>> path{{of, false}};  // nodes, and whether a switch depends on them
  std::set<std::pair<int, bool>> seen;
  while (!path.empty()) {
    const auto [k, switches] = path.back();
    path.pop_back();
    if (!seen.insert({k, switches}).second) continue;
    const GraphNode& node = graph.node(k);
    if (node.operation == Operation::number) continue;
    if (node.operation != Operation::leaf) {
      path.emplace_back(node.a, switches);
      if (node.b >= 0) path.emplace_back(node.b, switches);
      continue;
    }
    const Leaf& leaf = graph.leaf_of(k);
    if (leaf.kind == LeafKind::held) {
      const Switch& of_leaf = graph.switches()[at(leaf.index - graph.first_switch())];
      path.emplace_back(of_leaf.value, true);
      if (of_leaf.step >= 0) path.emplace_back(of_leaf.step, true);
    } else if (switches) {
      leaves.insert(leaf);
    }
  }
  return leaves;
}

}  // namespace

PlayerExpressions::PlayerExpressions(int slots, int players, int actions, int parameters)
    : slots_(slots), players_(players), actions_(actions), parameters_(parameters), player_of_(at(slots), -1) {
  for (SparseRows& pattern : patterns_) pattern.start.assign(at(slots + 1), 0);
  switched_by_ = patterns_;
}

void PlayerExpressions::add(int slot, int player, std::shared_ptr<const ExpressionGraph> graph, int node) {
  members_.push_back({slot, player, std::move(graph), node});
  player_of_[at(slot)] = player;
}

void PlayerExpressions::compile() {
  // the derivatives of a player's values lie in a graph of their own, with the values that they share
  struct Derivative {
    LeafKind kind;
    int index;
    int node;
  };
  std::map<const ExpressionGraph*, std::shared_ptr<ExpressionGraph>> extended;
  std::vector<std::vector<Derivative>> of_member;
  for (const Member& member : members_) {
    auto& graph = extended[member.graph.get()];
    if (graph == nullptr) graph = std::make_shared<ExpressionGraph>(*member.graph);
    auto& list = of_member.emplace_back();
    for (const auto& [leaf, node] : graph->derivatives(member.node)) list.push_back({leaf.kind, leaf.index, node});
  }
  // patterns: rows by slot, columns ascending
  std::vector<const Member*> member_of(at(slots_), nullptr);
  std::vector<std::size_t> number_of(at(slots_), 0);
  for (std::size_t k = 0; k < members_.size(); ++k) {
    member_of[at(members_[k].slot)] = &members_[k];
    number_of[at(members_[k].slot)] = k;
  }
  for (std::size_t kind = 0; kind < kinds; ++kind) {
    SparseRows& pattern = patterns_[kind];
    pattern = {};
    factors_[kind].clear();
    std::map<int, PlayerResults> results;  // by player
    for (int slot = 0; slot < slots_; ++slot) {
      if (const Member* member = member_of[at(slot)]; member != nullptr) {
        const ExpressionGraph& graph = *extended[member->graph.get()];
        std::vector<const Derivative*> row;
        for (const Derivative& derivative : of_member[number_of[at(slot)]]) {
          if (static_cast<std::size_t>(derivative.kind) == kind) row.push_back(&derivative);
        }
        std::vector<int> columns;
        for (const Derivative* derivative : row) columns.push_back(derivative->index);
        std::sort(columns.begin(), columns.end());
        PlayerResults& wanted = results[member->player];
        wanted.player = member->player;
        wanted.graph = &graph;
        std::vector<Factor> factors(columns.size());
        for (const Derivative* derivative : row) {
          const auto place = std::lower_bound(columns.begin(), columns.end(), derivative->index) - columns.begin();
          wanted.nodes.push_back(derivative->node);
          wanted.places.push_back(pattern.entries() + static_cast<int>(place));
          factors[at(place)] = graph.is_number(derivative->node)             ? Factor::number
                               : graph.has_only_parameters(derivative->node) ? Factor::parameters
                                                                             : Factor::anything;
        }
        pattern.column.insert(pattern.column.end(), columns.begin(), columns.end());
        factors_[kind].insert(factors_[kind].end(), factors.begin(), factors.end());
      }
      pattern.start.push_back(pattern.entries());
    }
    std::vector<PlayerResults> all;
    for (auto& [player, wanted] : results) all.push_back(std::move(wanted));
    derivatives_[kind] = Tapes(all);
  }
  find_switches(member_of);
  std::map<int, PlayerResults> results;
  for (const Member& member : members_) {
    PlayerResults& wanted = results[member.player];
    wanted.player = member.player;
    wanted.graph = member.graph.get();
    wanted.nodes.push_back(member.node);
    wanted.places.push_back(member.slot);
  }
  std::vector<PlayerResults> all;
  for (auto& [player, wanted] : results) all.push_back(std::move(wanted));
  values_ = Tapes(all);
  std::array<std::set<int>, kinds> used;
  for (const auto& [original, graph] : extended) {
    for (const Leaf& leaf : original->leaves()) {
      if (leaf.kind != LeafKind::held) used[at(static_cast<int>(leaf.kind))].insert(leaf.index);
    }
  }
  for (std::size_t kind = 0; kind < kinds; ++kind) used_[kind].assign(used[kind].begin(), used[kind].end());
  members_.clear();  // the graphs have served
}

void PlayerExpressions::find_switches(const std::vector<const Member*>& member_of) {
  switched_by_ = {};
  for (const Member* member : member_of) {
    if (member != nullptr && !member->graph->switches().empty()) {
      for (const Leaf& leaf : leaves_of_switches(*member->graph, member->node)) {  // ascending
        switched_by_[static_cast<std::size_t>(leaf.kind)].column.push_back(leaf.index);
      }
    }
    for (SparseRows& rows : switched_by_) rows.start.push_back(rows.entries());
  }
}

void PlayerExpressions::values(const LeafValues& leaves, Real* value) const { values_.evaluate(leaves, value); }

void PlayerExpressions::derivatives(LeafKind kind, const LeafValues& leaves, Real* entries) const {
  derivatives_[static_cast<std::size_t>(kind)].evaluate(leaves, entries);
}

void PlayerExpressions::add_values(const LeafValuesAs<Dual>& leaves, Dual* value) const {
  if (empty()) return;
  const auto reals = [](const Dual* duals, int count) {
    std::vector<Real> values(at(duals == nullptr ? 0 : count));
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = duals[k].value;
    return values;
  };
  const std::vector<Real> points = reals(leaves.points, actions_ + leaves.stride * (players_ - 1));
  const std::vector<Real> velocities = reals(leaves.velocities, actions_);
  std::vector<Real> parameters(at(parameters_));
  for (int k = 0; k < parameters_; ++k) parameters[at(k)] = leaves.coefficients->named(k).value;
  const LeafValues plain{.points = points.data(),
                         .stride = leaves.stride,
                         .velocities = velocities.data(),
                         .time = leaves.time == nullptr ? 0.0 : leaves.time->value,
                         .parameters = parameters.data(),
                         .held = leaves.held};
  std::vector<Real> values(at(slots_), 0.0);
  this->values(plain, values.data());
  for (int slot = 0; slot < slots_; ++slot) value[slot].value += values[at(slot)];
  for (std::size_t kind = 0; kind < kinds; ++kind) {
    const SparseRows& pattern = patterns_[kind];
    std::vector<Real> entries(at(pattern.entries()));
    derivatives(static_cast<LeafKind>(kind), plain, entries.data());
    for (int slot = 0; slot < slots_; ++slot) {
      for (int k = pattern.start[at(slot)]; k < pattern.start[at(slot + 1)]; ++k) {
        const Dual leaf = leaves.value(static_cast<LeafKind>(kind), pattern.column[at(k)], player_of_[at(slot)]);
        if (leaf.along != 0.0) value[slot].along += entries[at(k)] * leaf.along;
      }
    }
  }
}

void PlayerExpressions::add_values(const LeafValuesAs<Dependencies>& leaves, Dependencies* value) const {
  for (std::size_t kind = 0; kind < kinds; ++kind) {
    const SparseRows& pattern = patterns_[kind];
    for (int slot = 0; slot < slots_; ++slot) {
      for (int k = pattern.start[at(slot)]; k < pattern.start[at(slot + 1)]; ++k) {
        const Dependencies leaf =
            leaves.value(static_cast<LeafKind>(kind), pattern.column[at(k)], player_of_[at(slot)]);
        switch (factors_[kind][at(k)]) {
          case Factor::number:
            value[slot] += leaf;
            break;
          case Factor::parameters:
            value[slot] += Dependencies::unknown() * leaf;
            break;
          case Factor::anything:
            value[slot] += leaf.nonlinear();
            break;
        }
      }
      const SparseRows& switched_by = switched_by_[kind];
      for (int k = switched_by.start[at(slot)]; k < switched_by.start[at(slot + 1)]; ++k) {
        value[slot] +=
            leaves.value(static_cast<LeafKind>(kind), switched_by.column[at(k)], player_of_[at(slot)]).nonlinear();
      }
    }
  }
}

std::size_t PlayerExpressions::memory() const {
  std::size_t bytes = values_.memory();
  for (const Tapes& tapes : derivatives_) bytes += tapes.memory();
  return bytes;
}

}  // namespace mixed_order_game
