#include "loop/located_conditions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "loop/failure.hpp"

namespace mixed_order_game {

namespace {

constexpr int cost = 0;
constexpr int disturbance = 2;

}  // namespace

LocatedConditions::LocatedConditions(const ClosedLoop& loop)
    : loop_(loop),
      columns_(loop.shape().own_entries()),
      bounded_(loop.parameters().bounded()),
      first_bound_(count(loop.parameters()) - static_cast<int>(bounded_.size())),
      has_switches_(count(loop.parameters()) > columns_),
      signals_(loop.shape()),
      plants_(loop.shape()),
      inputs_at_rest_(at(loop.inputs().size())),
      values_(at(located(loop.parameters()))),
      rate_before_(at(loop.layout().size())),
      rate_after_(rate_before_),
      before_(at(count(loop.parameters()))) {
  for (const Family& family : families()) kept_.emplace_back(at(family.switching->count()));
}

int LocatedConditions::count(const Parameters& parameters) {
  return parameters.first_switch(static_cast<int>(parameters.families().size())) +
         static_cast<int>(parameters.bounded().size());
}

int LocatedConditions::located(const Parameters& parameters) {
  const auto families = parameters.families();
  const int others = parameters.shape.own_entries() + static_cast<int>(parameters.bounded().size());
  return std::accumulate(families.begin(), families.end(), others,
                         [](int sum, const GameFamily* family) { return sum + family->switching().located(); });
}

bool LocatedConditions::can_hold(const Parameters& parameters, int k, Real value) {
  if (k < parameters.shape.own_entries()) return value == 0.0 || value == 1.0;
  if (k >= parameters.first_switch(static_cast<int>(parameters.families().size()))) {
    return value == -1.0 || value == 0.0 || value == 1.0;
  }
  int f = disturbance;
  while (k < parameters.first_switch(f)) --f;
  return parameters.families()[at(f)]->switching().can_hold(k - parameters.first_switch(f), value);
}

/// The switches of dynamics and disturbances matter only where these act.
std::array<LocatedConditions::Family, 3> LocatedConditions::families() const {
  const Parameters& parameters = loop_.parameters();
  const auto all = parameters.families();
  std::array<Family, 3> families{};
  int first = columns_;
  for (std::size_t f = 0; f < all.size(); ++f) {
    families[f] = {&all[f]->switching(), first, f == cost || parameters.strategy.perturbed};
    first += families[f].switching->count();
  }
  return families;
}

LeafValues LocatedConditions::leaves(int family, Real t, const Real* state, const Real* inputs,
                                     const Modes& modes) const {
  const auto [x, reference] = loop_.plants(state, inputs, plants_);
  return {.points = family == cost ? state + loop_.layout().estimates() : x,
          .stride = family == cost ? loop_.shape().actions() : 0,
          .velocities = reference,
          .time = loop_.time_origin() + t,
          .parameters = loop_.parameters().named.values.data(),
          .held = modes.data() + loop_.parameters().first_switch(family)};
}

/// What disturbances depend on.
LeafValues LocatedConditions::leaves(Real t, const Modes& modes) const {
  return {.time = loop_.time_origin() + t,
          .parameters = loop_.parameters().named.values.data(),
          .held = modes.data() + loop_.parameters().first_switch(disturbance)};
}

void LocatedConditions::begin(Real t, const Real* state, const Real* inputs, Modes& modes) const {
  std::fill(modes.begin(), modes.end(), 0.0);
  const auto families = this->families();
  for (std::size_t f = 0; f < families.size(); ++f) {
    families[f].switching->own_values(leaves(static_cast<int>(f), t, state, inputs, modes), loop_.time_origin(), t,
                                      modes.data() + families[f].first);
  }
  if (bounded_.empty()) return;
  loop_.evaluate_seeking(state, inputs, modes, signals_);
  for (std::size_t k = 0; k < bounded_.size(); ++k) {
    modes[at(first_bound_) + k] = place_of_control(bounded_[k], signals_);
  }
}

Real LocatedConditions::place_of_control(int p, const Signals& signals) const {
  if (!loop_.is_bounded(at(p), signals)) return 0.0;
  return loop_.wanted_control(at(p), signals) > 0.0 ? 1.0 : -1.0;
}

void LocatedConditions::event_functions(Real t, const Real* state, const Real* inputs, const Modes& modes,
                                        Real tolerance, Signals& signals, Real* values) const {
  loop_.event_functions(state, inputs, modes, tolerance, signals, values);
  if (!has_switches_) return;
  values += columns_;
  const auto families = this->families();
  for (std::size_t f = 0; f < families.size(); ++f) {
    const auto& [switching, first, acts] = families[f];
    if (acts) {
      switching->event_functions(leaves(static_cast<int>(f), t, state, inputs, modes), values);
    } else {
      std::fill_n(values, switching->located(), -1.0);
    }
    values += switching->located();
  }
  if (bounded_.empty()) return;
  loop_.evaluate_seeking(state, inputs, modes, signals);
  for (std::size_t k = 0; k < bounded_.size(); ++k) {
    constexpr Real almost_zero = 1e-100;  // integrators stop watching a function that begins at zero
    const std::size_t p = at(bounded_[k]);
    const Real u = loop_.wanted_control(p, signals) / loop_.gains().u_max[p];
    const Real mode = modes[at(first_bound_) + k];
    const Real value = mode == 0.0 ? std::fabs(u) - 1.0 : 1.0 - mode * u;
    *values++ = value == 0.0 ? -almost_zero : value;
  }
}

Real LocatedConditions::next_event(Real t, const Modes& modes) const {
  if (!has_switches_) return std::numeric_limits<Real>::infinity();
  const Family timed = families()[disturbance];
  if (!timed.acts) return std::numeric_limits<Real>::infinity();
  return timed.switching->next_event(leaves(t, modes), loop_.time_origin(), t);
}

bool LocatedConditions::is_due(Real t, const Modes& modes) const {
  if (!has_switches_) return false;
  const Family timed = families()[disturbance];
  if (!timed.acts) return false;
  Modes now = modes;
  std::vector<bool> kept(at(timed.switching->count()));
  for (std::size_t k = 0; k < kept.size(); ++k) kept[k] = timed.switching->is_located(static_cast<int>(k));
  return timed.switching->settle(leaves(t, now), loop_.time_origin(), t, kept, now.data() + timed.first);
}

void LocatedConditions::pass_switches(Real t, const Real* state, const Real* inputs, const int* passed,
                                      Modes& modes) const {
  const auto families = this->families();
  const int* flag = passed == nullptr ? nullptr : passed + columns_;
  for (std::size_t f = 0; f < families.size(); ++f) {
    const auto& [switching, first, acts] = families[f];
    const LeafValues held = leaves(static_cast<int>(f), t, state, inputs, modes);
    std::fill(kept_[f].begin(), kept_[f].end(), false);
    for (int k = 0; flag != nullptr && k < switching->count(); ++k) {
      if (!switching->is_located(k) || *flag++ == 0) continue;
      kept_[f][at(k)] = true;
      modes[at(first + k)] = switching->next_value(k, held);
    }
    // a switch depends on others of its family alone, that were made before it
    int rounds = switching->count() + 1;
    while (acts && rounds > 0 && switching->settle(held, loop_.time_origin(), t, kept_[f], modes.data() + first)) {
      --rounds;
    }
  }
}

/// Those that passed a bound, or all of them at a jump. Nothing jumps there.
int LocatedConditions::pass_bounds(const Real* state, const Real* inputs, const int* passed, bool jumped,
                                   Signals& signals, Modes& modes) const {
  if (bounded_.empty()) return 0;
  loop_.evaluate_seeking(state, inputs, modes, signals);
  const int* flag = passed == nullptr ? nullptr : passed + located(loop_.parameters()) - bounded_.size();
  int events = 0;
  for (std::size_t k = 0; k < bounded_.size(); ++k) {
    Real& mode = modes[at(first_bound_) + k];
    const Real before = mode;
    if (flag != nullptr && flag[k] != 0) {
      mode = before != 0.0 ? 0.0 : loop_.wanted_control(at(bounded_[k]), signals) > 0.0 ? 1.0 : -1.0;
    } else if (jumped) {
      mode = place_of_control(bounded_[k], signals);
    }
    if (mode != before) ++events;
  }
  return events;
}

LocatedConditions::Change LocatedConditions::pass(Real t, const Real* state, const Real* inputs, Real tolerance,
                                                  const int* passed, Signals& signals, Modes& modes) const {
  std::copy(modes.begin(), modes.end(), before_.begin());
  Change change;
  pass_switches(t, state, inputs, passed, modes);
  const auto families = this->families();
  for (std::size_t f = 0; f < families.size(); ++f) {
    const auto& [switching, first, acts] = families[f];
    for (int k = 0; acts && k < switching->count(); ++k) {
      if (modes[at(first + k)] == before_[at(first + k)]) continue;
      if (!switching->is_active(k, leaves(static_cast<int>(f), t, state, inputs, modes))) continue;
      ++change.events;
      last_switch_ = switching->description(k);
      change.restarts = change.restarts || !switching->is_bend(k);
    }
  }
  if (change.restarts) refuse_sliding(t, state, inputs, before_, modes);

  if (passed != nullptr) {
    loop_.evaluate_seeking(state, inputs, modes, signals);
    const bool jumped = change.restarts;
    for (int p = 0; p < columns_; ++p) {
      if (passed[p] == 0) continue;
      modes[at(p)] = modes[at(p)] == 0.0 ? 1.0 : 0.0;
      ++change.events;
      change.restarts =
          change.restarts || (modes[at(p)] != 0.0 && signals.error[at(p)] * signals.network[at(p)] >= 0.0);
    }
    if (!jumped) {
      change.events += pass_bounds(state, inputs, passed, false, signals, modes);
      return change;
    }
  }
  loop_.event_functions(state, inputs, modes, tolerance, signals, values_.data());
  for (int p = 0; p < columns_; ++p) {
    if (!(values_[at(p)] > 0.0) || (passed != nullptr && passed[p] != 0)) continue;
    modes[at(p)] = modes[at(p)] == 0.0 ? 1.0 : 0.0;
    ++change.events;
  }
  change.events += pass_bounds(state, inputs, passed, true, signals, modes);
  return change;
}

/// How fast the number whose sign a switch follows changes along rates of state and time.
Real LocatedConditions::switch_rate(int family, int k, Real t, const Real* state, const Real* inputs,
                                    const Modes& modes, const Real* state_rate, Real time_rate) const {
  // each looks into the scratch of its own
  LeafValues rates = leaves(family, t, state_rate, inputs_at_rest_.data(), modes);
  if (family != cost) {
    rate_x_.assign(rates.points, rates.points + loop_.shape().actions());
    rate_v_.assign(rates.velocities, rates.velocities + loop_.shape().actions());
    rates.points = rate_x_.data();
    rates.velocities = rate_v_.data();
  }
  rates.time = time_rate;
  return families()[at(family)].switching->rate(k, leaves(family, t, state, inputs, modes), rates);
}

Real LocatedConditions::event_time_along(Real t, const Real* state, const Real* inputs, const Modes& before,
                                         const Modes& after, const Real* rate_before, const Real* along,
                                         const std::vector<Real>& W_max_along) const {
  const auto families = this->families();
  for (int f = 0; f < static_cast<int>(families.size()); ++f) {
    const auto& [switching, first, acts] = families[at(f)];
    for (int k = 0; acts && k < switching->count(); ++k) {
      if (before[at(first + k)] == after[at(first + k)] || switching->is_bend(k)) continue;
      if (!switching->is_located(k)) return 0.0;
      const Real speed = switch_rate(f, k, t, state, inputs, before, rate_before, 1.0);
      return -switch_rate(f, k, t, state, inputs, before, along, 0.0) / speed;
    }
  }
  for (int p = 0; p < columns_; ++p) {
    if (before[at(p)] != 0.0 || after[at(p)] == 0.0) continue;
    // w'w = W_max
    Real change = -W_max_along[at(loop_.shape().player_of_own(p))];
    Real speed = 0.0;
    for (int m = 0; m < loop_.shape().neurons; ++m) {
      const int w = loop_.layout().weights_of(m) + p;
      change += 2.0 * state[w] * along[w];
      speed += 2.0 * state[w] * rate_before[w];
    }
    return -change / speed;
  }
  return 0.0;
}

/// Where what a switch held before leads to its threshold and what it holds now leads back.
void LocatedConditions::refuse_sliding(Real t, const Real* state, const Real* inputs, const Modes& before,
                                       const Modes& after) const {
  loop_.evaluate(t, state, inputs, before, signals_, rate_before_.data());
  loop_.evaluate(t, state, inputs, after, signals_, rate_after_.data());
  const auto families = this->families();
  for (int f = 0; f < static_cast<int>(families.size()); ++f) {
    const auto& family = families[at(f)];
    const auto& switching = family.switching;
    for (int k = 0; family.acts && k < switching->count(); ++k) {
      const Real held_before = before[at(family.first + k)];
      const Real held_after = after[at(family.first + k)];
      if (held_before == held_after || !switching->is_located(k) || switching->is_bend(k)) continue;
      if (!switching->is_active(k, leaves(f, t, state, inputs, after))) continue;
      const Real direction = held_after > held_before ? 1.0 : -1.0;
      const auto towards = [&](const Modes& modes, const AlignedVector& rate) {
        return direction * switch_rate(f, k, t, state, inputs, modes, rate.data(), 1.0);
      };
      if (!(towards(before, rate_before_) > 0.0 && towards(after, rate_after_) < 0.0)) continue;
      throw Error(switching->description(k) + " slides at t = " + number_text(loop_.time_origin() + t, 15) +
                  " s: each of its sides leads back to the other; expected a smooth expression, such as" +
                  " tanh(s / width) for sign(s)");
    }
  }
}

}  // namespace mixed_order_game
