#include "expression/tape.hpp"

#include <algorithm>
#include <array>
#include <map>

#include "kernels/kernels.hpp"

namespace mixed_order_game {

namespace {

constexpr int lane_multiple = 8;
constexpr std::size_t fewest_lanes = 4;  // fewer players are as fast one by one
constexpr std::size_t most_lanes = 32;   // so that the rows of a tape stay in the nearest caches

/// The nodes that the results need, in the order of a walk that goes to the first operand first: equal for players
/// whose expressions have the same structure.
struct Linearized {
  std::vector<int> nodes;
  std::vector<int> signature;
};

Linearized linearize(const PlayerResults& results) {
  const ExpressionGraph& graph = *results.graph;
  Linearized all;
  std::vector<int> number(at(graph.size()), -1);
  for (const int result : results.nodes) {
    std::vector<int> path{result};
    while (!path.empty()) {
      const int k = path.back();
      const GraphNode& node = graph.node(k);
      if (number[at(k)] >= 0) {
        path.pop_back();
        continue;
      }
      const bool has_operands = node.operation != Operation::number && node.operation != Operation::leaf;
      bool waits = false;
      for (const int operand : {node.b, node.a}) {
        if (has_operands && operand >= 0 && number[at(operand)] < 0) {
          path.push_back(operand);
          waits = true;
        }
      }
      if (waits) continue;
      path.pop_back();
      number[at(k)] = static_cast<int>(all.nodes.size());
      all.nodes.push_back(k);
      all.signature.push_back(static_cast<int>(node.operation));
      if (node.operation == Operation::leaf) all.signature.push_back(static_cast<int>(graph.leaf_of(k).kind));
      if (has_operands) {
        all.signature.push_back(number[at(node.a)]);
        all.signature.push_back(node.b < 0 ? -1 : number[at(node.b)]);
      }
    }
    all.signature.push_back(-2);
    all.signature.push_back(number[at(result)]);
  }
  return all;
}

/// Where the linearized nodes of several players go.
struct Plan {
  std::vector<int> row;                ///< of each node; -1: within a sum
  std::vector<std::vector<int>> sums;  ///< of each node: the actions that it is the sum of, from the first one on
  int rows = 0;
};

/// ((leaf + leaf) + leaf) + ... becomes one sum where nothing else wants the sums on the way.
Plan plan(const PlayerResults& results, const std::vector<int>& nodes) {
  constexpr std::size_t shortest = 4;
  const ExpressionGraph& graph = *results.graph;
  std::vector<int> place(at(graph.size()), -1);
  for (std::size_t k = 0; k < nodes.size(); ++k) place[at(nodes[k])] = static_cast<int>(k);
  const auto node = [&](int k) -> const GraphNode& { return graph.node(nodes[at(k)]); };
  const auto is_operation = [&](int k) {
    return node(k).operation != Operation::number && node(k).operation != Operation::leaf;
  };
  const auto is_action = [&](int k) {
    return node(k).operation == Operation::leaf && graph.leaf_of(nodes[at(k)]).kind == LeafKind::action;
  };
  std::vector<int> users(nodes.size(), 0);
  for (const int result : results.nodes) ++users[at(place[at(result)])];
  const auto count = static_cast<int>(nodes.size());
  for (int k = 0; k < count; ++k) {
    if (!is_operation(k)) continue;
    ++users[at(place[at(node(k).a)])];
    if (node(k).b >= 0) ++users[at(place[at(node(k).b)])];
  }
  Plan all{std::vector<int>(nodes.size(), 0), std::vector<std::vector<int>>(nodes.size())};
  for (int k = count - 1; k >= 0; --k) {  // what is summed last comes first
    if (all.row[at(k)] < 0) continue;
    std::vector<int> within;
    std::vector<int> terms;
    int next = k;
    while (node(next).operation == Operation::add && is_action(place[at(node(next).b)]) &&
           (next == k || users[at(next)] == 1)) {
      within.push_back(next);
      terms.push_back(place[at(node(next).b)]);
      next = place[at(node(next).a)];
    }
    if (terms.size() + 1 < shortest || !is_action(next)) continue;
    terms.push_back(next);
    for (const int step : within) all.row[at(step)] = step == k ? 0 : -1;
    for (const int term : terms) {
      if (--users[at(term)] == 0) all.row[at(term)] = -1;
    }
    all.sums[at(k)].assign(terms.rbegin(), terms.rend());
  }
  for (int& row : all.row) {
    if (row == 0) row = all.rows++;
  }
  return all;
}

}  // namespace

Tapes::Tapes(const std::vector<PlayerResults>& results) {
  std::map<std::vector<int>, std::vector<const PlayerResults*>> groups;
  std::vector<const std::vector<int>*> order;  // of the first players
  for (const PlayerResults& one : results) {
    if (one.nodes.empty()) continue;
    const auto [group, is_new] = groups.try_emplace(linearize(one).signature);
    if (is_new) order.push_back(&group->first);
    group->second.push_back(&one);
  }
  std::vector<Tape> tapes;
  for (const std::vector<int>* signature : order) {
    const auto& members = groups[*signature];
    std::size_t count = 0;
    for (std::size_t first = 0; first < members.size(); first += count) {
      const std::size_t rest = members.size() - first;
      count = rest < fewest_lanes ? 1 : std::min(most_lanes, rest);
      Tape tape;
      tape.lanes = count == 1 ? 1 : static_cast<int>((count + lane_multiple - 1) / lane_multiple) * lane_multiple;
      const std::vector<int> first_nodes = linearize(*members[first]).nodes;
      Plan places{std::vector<int>(first_nodes.size(), 0), std::vector<std::vector<int>>(first_nodes.size())};
      if (count == 1) {
        for (int& row : places.row) row = places.rows++;
      } else {
        places = plan(*members[first], first_nodes);
      }
      tape.rows = places.rows;
      tape.start.assign(at(tape.rows) * at(tape.lanes), 0.0);
      for (std::size_t lane = 0; lane < count; ++lane) {
        const PlayerResults& member = *members[first + lane];
        const ExpressionGraph& graph = *member.graph;
        const std::vector<int> nodes = linearize(member).nodes;
        std::vector<int> row(at(graph.size()), -1);
        for (std::size_t k = 0; k < nodes.size(); ++k) row[at(nodes[k])] = places.row[k];
        // empty lanes hold what the first one does, so that nothing in them is worse than there
        const std::size_t end = lane == 0 ? at(tape.lanes) : lane + 1;
        std::size_t leaf = 0;
        std::size_t sum = 0;
        for (std::size_t k = 0; k < nodes.size(); ++k) {
          if (places.row[k] < 0) continue;
          const GraphNode& node = graph.node(nodes[k]);
          if (!places.sums[k].empty()) {
            if (lane == 0) {
              tape.sums.push_back({places.row[k], std::vector<int>(places.sums[k].size() * at(tape.lanes))});
            }
            std::vector<int>& index = tape.sums[sum++].index;
            for (std::size_t term = 0; term < places.sums[k].size(); ++term) {
              for (std::size_t l = lane; l < end; ++l) {
                index[term * at(tape.lanes) + l] = graph.leaf_of(nodes[at(places.sums[k][term])]).index;
              }
            }
          } else if (node.operation == Operation::number) {
            for (std::size_t l = lane; l < end; ++l) tape.start[at(places.row[k]) * at(tape.lanes) + l] = node.value;
          } else if (node.operation == Operation::leaf) {
            const auto& [kind, index] = graph.leaf_of(nodes[k]);
            if (lane == 0) tape.leaves.push_back({places.row[k], kind, {}});
            tape.leaves[leaf++].index.push_back(index);
          } else if (lane == 0) {
            tape.code.push_back(
                {node.operation, places.row[k], row[at(node.a)], node.b < 0 ? row[at(node.a)] : row[at(node.b)]});
          }
        }
        for (std::size_t k = 0; k < member.nodes.size(); ++k) {
          if (lane == 0) tape.results.push_back({row[at(member.nodes[k])], {}});
          tape.results[k].place.push_back(member.places[k]);
        }
        tape.players.push_back(member.player);
      }
      tapes.push_back(std::move(tape));
    }
  }
  for (const Tape& tape : tapes) rows_.emplace_back(tape.start.begin(), tape.start.end());
  joined_ = std::make_shared<const Joined>(joined(tapes));
  joined_rows_.assign(joined_->start.begin(), joined_->start.end());
  tapes_ = std::make_shared<const std::vector<Tape>>(std::move(tapes));
}

void Tapes::run(std::size_t number, const LeafValues& leaves, Real* result) const {
  const Tape& tape = (*tapes_)[number];
  Real* rows = rows_[number].data();
  const std::size_t lanes = at(tape.lanes);
  const std::size_t players = tape.players.size();
  std::array<const Real*, most_lanes> points{};  // that the players see, and the first one again in empty lanes
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    points[lane] = leaves.points + tape.players[lane < players ? lane : 0] * leaves.stride;
  }
  for (const LeafRow& leaf : tape.leaves) {
    Real* row = rows + at(leaf.row) * lanes;
    const int* index = leaf.index.data();
    const auto gather = [&](const Real* values) {
      for (std::size_t lane = 0; lane < players; ++lane) row[lane] = values[index[lane]];
    };
    switch (leaf.kind) {
      case LeafKind::action:
        for (std::size_t lane = 0; lane < players; ++lane) row[lane] = points[lane][index[lane]];
        break;
      case LeafKind::velocity:
        gather(leaves.velocities);
        break;
      case LeafKind::time:
        std::fill_n(row, players, leaves.time);
        break;
      case LeafKind::parameter:
        gather(leaves.parameters);
        break;
      case LeafKind::held:
        gather(leaves.held);
        break;
    }
    std::fill(row + players, row + lanes, row[0]);
  }
  for (const auto& [row, index] : tape.sums) {
    kernels().sum_actions(static_cast<int>(index.size() / lanes), tape.lanes, points.data(), index.data(),
                          rows + at(row) * lanes);
  }
  kernels().run_tape(static_cast<int>(tape.code.size()), tape.code.data(), tape.lanes, static_cast<int>(players), rows);
  for (const ResultRow& wanted : tape.results) {
    const Real* row = rows + at(wanted.row) * lanes;
    for (std::size_t lane = 0; lane < wanted.place.size(); ++lane) result[wanted.place[lane]] = row[lane];
  }
}

Tapes::Joined Tapes::joined(const std::vector<Tape>& tapes) {
  Joined all;
  std::vector<TapeInstruction> code;
  for (const Tape& tape : tapes) {
    if (tape.lanes != 1) continue;
    const auto first = static_cast<int>(all.start.size());
    all.start.insert(all.start.end(), tape.start.begin(), tape.start.end());
    for (const auto& [operation, row, a, b] : tape.code) code.push_back({operation, first + row, first + a, first + b});
    for (const LeafRow& leaf : tape.leaves) {
      all.leaves[static_cast<std::size_t>(leaf.kind)].push_back({first + leaf.row, leaf.index[0], tape.players[0]});
    }
    for (const ResultRow& wanted : tape.results) all.results.emplace_back(first + wanted.row, wanted.place[0]);
  }
  // of the operations whose operands are known, the one that most instructions wait for comes next
  std::vector<std::vector<int>> users(all.start.size());  // instructions, by row
  std::vector<int> missing(code.size(), 0);               // operands
  std::vector<bool> is_made(all.start.size());
  for (const TapeInstruction& step : code) is_made[at(step.row)] = true;
  std::map<Operation, std::vector<int>> ready;
  for (std::size_t k = 0; k < code.size(); ++k) {
    for (const int operand : {code[k].a, code[k].b}) {
      if (!is_made[at(operand)]) continue;
      users[at(operand)].push_back(static_cast<int>(k));
      ++missing[k];
    }
    if (missing[k] == 0) ready[code[k].operation].push_back(static_cast<int>(k));
  }
  while (!ready.empty()) {
    const auto largest = std::max_element(ready.begin(), ready.end(), [](const auto& one, const auto& other) {
      return one.second.size() < other.second.size();
    });
    const std::vector<int> steps = std::move(largest->second);
    ready.erase(largest);
    for (const int k : steps) {
      all.code.push_back(code[at(k)]);
      for (const int user : users[at(code[at(k)].row)]) {
        if (--missing[at(user)] == 0) ready[code[at(user)].operation].push_back(user);
      }
    }
  }
  return all;
}

void Tapes::run_joined(const LeafValues& leaves, Real* result) const {
  Real* rows = joined_rows_.data();
  const auto of = [&](LeafKind kind) -> const auto& { return joined_->leaves[static_cast<std::size_t>(kind)]; };
  const auto copy = [&](LeafKind kind, const Real* values) {
    for (const auto& leaf : of(kind)) rows[leaf.row] = values[leaf.index];
  };
  for (const auto& leaf : of(LeafKind::action)) {
    rows[leaf.row] = leaves.points[leaf.player * leaves.stride + leaf.index];
  }
  copy(LeafKind::velocity, leaves.velocities);
  for (const auto& leaf : of(LeafKind::time)) rows[leaf.row] = leaves.time;
  copy(LeafKind::parameter, leaves.parameters);
  copy(LeafKind::held, leaves.held);
  kernels().run_tape(static_cast<int>(joined_->code.size()), joined_->code.data(), 1, 1, rows);
  for (const auto& [row, place] : joined_->results) result[place] = rows[row];
}

void Tapes::evaluate(const LeafValues& leaves, Real* result) const {
  for (std::size_t number = 0; number < rows_.size(); ++number) {
    if ((*tapes_)[number].lanes != 1) run(number, leaves, result);
  }
  if (!joined_rows_.empty()) run_joined(leaves, result);
}

void Tapes::evaluate_player(int player, const LeafValues& leaves, Real* result) const {
  for (std::size_t number = 0; number < rows_.size(); ++number) {
    const std::vector<int>& players = (*tapes_)[number].players;
    if (std::find(players.begin(), players.end(), player) != players.end()) run(number, leaves, result);
  }
}

std::size_t Tapes::memory() const {
  std::size_t bytes = 0;
  for (std::size_t number = 0; number < rows_.size(); ++number) {
    const Tape& tape = (*tapes_)[number];
    bytes += 2 * rows_[number].size() * sizeof(Real) + tape.code.size() * sizeof(TapeInstruction) +
             (tape.leaves.size() + tape.results.size()) * at(tape.lanes) * sizeof(int);
    for (const SumRow& sum : tape.sums) bytes += sum.index.size() * sizeof(int);
  }
  return bytes;
}

}  // namespace mixed_order_game
