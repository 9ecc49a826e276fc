#include "expression/switching.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "errors.hpp"
#include "number_text.hpp"

namespace mixed_order_game {

namespace {

constexpr Real almost_zero = 1e-100;  // integrators stop watching a function that begins at zero
constexpr Real never = std::numeric_limits<Real>::infinity();

}  // namespace

Switching::Switching(const std::vector<OfPlayer>& graphs, const std::string& of, int rows, int actions,
                     int parameters) {
  std::size_t total = 0;
  for (const OfPlayer& one : graphs) total += one.graph->switches().size();
  values_ = PlayerExpressions(static_cast<int>(total), rows, actions, parameters);
  std::vector<PlayerResults> steps_and_guards;
  std::vector<PlayerResults> requirements;
  for (const auto& [row, player, graph] : graphs) {
    const std::string where = " in the " + of + " of player " + std::to_string(player + 1);
    PlayerResults results{.player = row, .graph = graph.get()};
    for (const Switch& one : graph->switches()) {
      const int k = count();
      values_.add(k, row, graph, one.value);
      if (one.step >= 0) {
        results.nodes.push_back(one.step);
        results.places.push_back(2 * k);
      }
      if (one.guard >= 0) {
        results.nodes.push_back(one.guard);
        results.places.push_back(2 * k + 1);
      }
      switches_.push_back({.kind = one.kind,
                           .is_timed = one.is_timed,
                           .is_bend = one.is_bend,
                           .has_step = one.step >= 0,
                           .has_guard = one.guard >= 0,
                           .row = row,
                           .text = "\"" + one.text + "\"" + where});
      if (!one.is_timed) ++located_;
      has_timed_ = has_timed_ || one.is_timed;
    }
    PlayerResults required{.player = row, .graph = graph.get()};
    for (const Requirement& one : graph->requirements) {
      required.nodes.push_back(one.node);
      required.places.push_back(static_cast<int>(judged_.size()));
      judged_.push_back({one.kind, one.text + where});
    }
    steps_and_guards.push_back(std::move(results));
    requirements.push_back(std::move(required));
  }
  values_.compile();
  steps_and_guards_ = Tapes(steps_and_guards);
  requirements_ = Tapes(requirements);
  value_.assign(total, 0.0);
  slope_ = offset_ = value_;
  step_and_guard_.assign(2 * total, 1.0);
  entries_.assign(at(values_.pattern(LeafKind::time).entries()), 0.0);
}

bool Switching::can_hold(int k, Real value) const {
  switch (switches_[at(k)].kind) {
    case SwitchKind::positive:
    case SwitchKind::not_negative:
      return value == 0.0 || value == 1.0;
    case SwitchKind::sign:
      return value == -1.0 || value == 0.0 || value == 1.0;
    case SwitchKind::count:
      return std::isfinite(value) && value == std::floor(value);
  }
  return false;
}

void Switching::judge(const Real* parameters) const {
  if (judged_.empty()) return;
  std::vector<Real> values(judged_.size());
  requirements_.evaluate({.parameters = parameters}, values.data());
  for (std::size_t k = 0; k < values.size(); ++k) {
    const Real value = values[k];
    const bool is_seed = judged_[k].kind == Requirement::Kind::seed;
    constexpr Real largest_seed = 9007199254740992.0;
    const bool fits = is_seed ? value >= 0.0 && value <= largest_seed && value == std::floor(value)
                              : value > 0.0 && std::isfinite(value);
    if (fits) continue;
    throw GameError(judged_[k].text + " is " + text_of(value) + ", expected " +
                    (is_seed ? "an integer from 0 to 9007199254740992" : "a positive number"));
  }
}

void Switching::evaluate(const LeafValues& leaves) const {
  values_.values(leaves, value_.data());
  steps_and_guards_.evaluate(leaves, step_and_guard_.data());
}

/// s = offset + slope t, after evaluate().
void Switching::evaluate_times(const LeafValues& leaves) const {
  if (!has_timed_) return;
  LeafValues at_zero = leaves;
  at_zero.time = 0.0;
  values_.values(at_zero, offset_.data());
  values_.derivatives(LeafKind::time, at_zero, entries_.data());
  const SparseRows& rows = values_.pattern(LeafKind::time);
  for (std::size_t k = 0; k < switches_.size(); ++k) {
    slope_[k] = rows.start[k] == rows.start[k + 1] ? 0.0 : entries_[at(rows.start[k])];
  }
}

/// As s says.
Real Switching::own_value(int k) const {
  const Real s = value_[at(k)];
  switch (switches_[at(k)].kind) {
    case SwitchKind::positive:
      return s > 0.0 ? 1.0 : 0.0;
    case SwitchKind::not_negative:
      return s >= 0.0 ? 1.0 : 0.0;
    case SwitchKind::sign:
      return s > 0.0 ? 1.0 : s < 0.0 ? -1.0 : 0.0;
    case SwitchKind::count:
      break;
  }
  const Real step = step_and_guard_[at(2 * k)];
  Real count = std::floor(s / step);
  if (!std::isfinite(count)) return 0.0;
  if ((count + 1.0) * step <= s) count += 1.0;
  if (count * step > s) count -= 1.0;
  return count;
}

/// Absolute.
Real Switching::time_of_level(int k, Real level) const {
  const Real step = switches_[at(k)].has_step ? step_and_guard_[at(2 * k)] : 1.0;
  return (level * step - offset_[at(k)]) / slope_[at(k)];
}

/// Within rounding counts as reached.
bool Switching::is_reached(Real time, Real origin, Real t) {
  return time - origin - t <= 4.0 * std::numeric_limits<Real>::epsilon() * std::fabs(origin + t);
}

/// Just after origin + t.
Real Switching::timed_value(int k, Real origin, Real t) const {
  const Real slope = slope_[at(k)];
  if (slope == 0.0 || !std::isfinite(slope) || !std::isfinite(offset_[at(k)])) return own_value(k);
  const auto is_passed = [&](Real level) { return is_reached(time_of_level(k, level), origin, t); };
  switch (switches_[at(k)].kind) {
    case SwitchKind::positive:
    case SwitchKind::not_negative:
      return is_passed(0.0) == (slope > 0.0) ? 1.0 : 0.0;
    case SwitchKind::sign:
      return is_passed(0.0) == (slope > 0.0) ? 1.0 : -1.0;
    case SwitchKind::count:
      break;
  }
  // rising: the last level that is passed; falling: the one below the last that is passed
  Real level = own_value(k);
  constexpr int most_corrections = 4;  // of rounding
  const auto is_below = [&](Real of) { return slope > 0.0 ? is_passed(of) : !is_passed(of); };
  for (int n = 0; n < most_corrections && is_below(level + 1.0); ++n) level += 1.0;
  for (int n = 0; n < most_corrections && !is_below(level); ++n) level -= 1.0;
  return level;
}

void Switching::own_values(LeafValues leaves, Real origin, Real t, Real* held) const {
  if (switches_.empty()) return;
  std::fill_n(held, switches_.size(), 0.0);
  leaves.held = held;
  leaves.time = origin + t;
  // a switch depends on others that were made before it
  for (std::size_t pass = 0; pass <= switches_.size(); ++pass) {
    evaluate(leaves);
    evaluate_times(leaves);
    bool changed = false;
    for (int k = 0; k < count(); ++k) {
      const Real value = switches_[at(k)].is_timed ? timed_value(k, origin, t) : own_value(k);
      changed = changed || value != held[k];
      held[k] = value;
    }
    if (!changed) return;
  }
}

Real Switching::next_value(int k, const LeafValues& leaves) const {
  evaluate(leaves);
  const Real held = leaves.held[k];
  switch (switches_[at(k)].kind) {
    case SwitchKind::positive:
    case SwitchKind::not_negative:
      return 1.0 - held;
    case SwitchKind::sign:
      return held != 0.0 ? -held : own_value(k);
    case SwitchKind::count:
      break;
  }
  const Real s = value_[at(k)] / step_and_guard_[at(2 * k)];
  return s < held + 0.5 ? held - 1.0 : held + 1.0;
}

bool Switching::is_active(int k, const LeafValues& leaves) const {
  if (!switches_[at(k)].has_guard) return true;
  steps_and_guards_.evaluate(leaves, step_and_guard_.data());
  return !is_masked(k);
}

Real Switching::event_function(int k, Real held) const {
  if (is_masked(k)) return -1.0;
  const Real s = value_[at(k)];
  Real end = 0.0;
  bool ends_at_zero = false;
  switch (switches_[at(k)].kind) {
    case SwitchKind::positive:
      end = held != 0.0 ? -s : s;
      ends_at_zero = held != 0.0;
      break;
    case SwitchKind::not_negative:
      end = held != 0.0 ? -s : s;
      ends_at_zero = held == 0.0;
      break;
    case SwitchKind::sign:
      end = held == 0.0 ? std::fabs(s) : -held * s;
      ends_at_zero = held != 0.0;
      break;
    case SwitchKind::count: {
      const Real step = step_and_guard_[at(2 * k)];
      const Real above = s - (held + 1.0) * step;
      end = std::max(held * step - s, above);
      ends_at_zero = end == above;
      break;
    }
  }
  if (!std::isfinite(end)) return -1.0;
  return end != 0.0 ? end : ends_at_zero ? almost_zero : -almost_zero;
}

void Switching::event_functions(const LeafValues& leaves, Real* value) const {
  if (located_ == 0) return;
  evaluate(leaves);
  for (int k = 0; k < count(); ++k) {
    if (is_located(k)) *value++ = event_function(k, leaves.held[k]);
  }
}

bool Switching::settle(LeafValues leaves, Real origin, Real t, const std::vector<bool>& kept, Real* held) const {
  if (switches_.empty()) return false;
  leaves.held = held;
  leaves.time = origin + t;
  evaluate(leaves);
  evaluate_times(leaves);
  bool changed = false;
  for (int k = 0; k < count(); ++k) {
    if (kept[at(k)]) continue;
    Real value = held[k];
    if (!is_located(k)) {
      value = timed_value(k, origin, t);
    } else if (is_masked(k) || event_function(k, held[k]) > 0.0) {
      const bool crosses = switches_[at(k)].kind == SwitchKind::sign && held[k] != 0.0 && !is_masked(k);
      value = crosses ? -held[k] : own_value(k);  // even if s happens to be zero
    }
    changed = changed || value != held[k];
    held[k] = value;
  }
  return changed;
}

Real Switching::rate(int k, const LeafValues& leaves, const LeafValues& rates) const {
  Real sum = 0.0;
  for (const LeafKind kind : {LeafKind::action, LeafKind::velocity, LeafKind::time}) {
    const SparseRows& rows = values_.pattern(kind);
    if (rows.start[at(k)] == rows.start[at(k + 1)]) continue;
    std::vector<Real> entries(at(rows.entries()));
    values_.derivatives(kind, leaves, entries.data());
    for (int entry = rows.start[at(k)]; entry < rows.start[at(k + 1)]; ++entry) {
      const int index = rows.column[at(entry)];
      const Real rate = kind == LeafKind::action     ? rates.points[switches_[at(k)].row * rates.stride + index]
                        : kind == LeafKind::velocity ? rates.velocities[index]
                                                     : rates.time;
      sum += entries[at(entry)] * rate;
    }
  }
  return sum;
}

Real Switching::next_event(const LeafValues& leaves, Real origin, Real t) const {
  if (!has_timed_) return never;
  LeafValues now = leaves;
  now.time = origin + t;
  evaluate(now);
  evaluate_times(now);
  Real next = never;
  for (int k = 0; k < count(); ++k) {
    const Compiled& one = switches_[at(k)];
    const Real slope = slope_[at(k)];
    if (!one.is_timed || slope == 0.0 || is_masked(k)) continue;
    Real level = 0.0;
    if (one.kind == SwitchKind::count) {
      level = timed_value(k, origin, t);
      if (slope > 0.0) level += 1.0;
    }
    const Real time = time_of_level(k, level);
    if (time < next && !is_reached(time, origin, t)) next = time;
  }
  return next;
}

}  // namespace mixed_order_game
