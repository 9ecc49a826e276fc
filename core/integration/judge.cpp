#include "integration/judge.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace mixed_order_game {

namespace {

constexpr Real settled_part = 0.02;  // of the initial distance from x*

// A step whose predecessor was shorter than this part of it is judged with its middle in that one's place.
constexpr Real least_part = 0.25;

// The last term of an integral's series, relative to the integral, and to that of the run so far, below which it counts
// as converged.
constexpr Real energy_tolerance = 1e-4;
constexpr Real total_tolerance = 1e-9;
constexpr int most_halvings = 12;

// An integral that is too large for a number is the largest one, which a saved state may hold.
constexpr Real beyond_range = std::numeric_limits<Real>::max();

/// Second divided difference of a function at three points: half its curvature.
class HalfCurvature {
 public:
  HalfCurvature(Real a, Real b, Real r) : ab_(1.0 / (b - a)), ra_(1.0 / (a - r)), rb_(1.0 / (b - r)) {}
  Real operator()(Real fa, Real fb, Real fr) const { return ((fb - fa) * ab_ - (fa - fr) * ra_) * rb_; }

 private:
  Real ab_, ra_, rb_;
};

/// Whether the magnitude of a function with half curvature c can have a peak beyond a record between two points a
/// distance h apart: its parabola turns where the chord's slope is below |c| h, and rises above the chord by at most
/// |c| h^2 / 4. Both count twice.
bool may_peak(Real record, Real fa, Real fb, Real c, Real h) {
  const Real bend = std::fabs(c) * h * h;
  return std::fabs(fb - fa) < 2.0 * bend && std::max(std::fabs(fa), std::fabs(fb)) + 0.5 * bend > record;
}

constexpr Real squared(Real value) { return value * value; }

struct Peak {
  Real t;
  Real value;
};

/// The largest value of f on [a, b], by parabolas through three points as they close in on it; or any value up to the
/// record, where the first of them tells that it is not exceeded.
template <typename Function>
Peak largest(Peak left, Peak right, Real record, Function f) {
  constexpr int most_refinements = 12;
  const Real resolution = 1e-7 * (right.t - left.t);
  const auto evaluated = [&f](Real t) { return Peak{t, f(t)}; };
  Peak middle = evaluated(0.5 * (left.t + right.t));
  Peak top = std::max({left, middle, right}, [](const Peak& p, const Peak& q) { return p.value < q.value; });
  for (int k = 0; k < most_refinements; ++k) {
    const Real c = HalfCurvature(left.t, right.t, middle.t)(left.value, right.value, middle.value);
    const Real slope = (right.value - left.value) / (right.t - left.t);
    Real t = 0.5 * (left.t + right.t - slope / c);
    if (!(c < 0.0) || !(t > left.t && t < right.t)) break;  // no peak between
    const Real rise = -c * (t - left.t) * (right.t - t);
    if (k == 0 && std::max(left.value, right.value) + 2.0 * rise <= record) break;
    if (std::fabs(t - middle.t) < resolution) {
      t = middle.t + (right.t - middle.t > middle.t - left.t ? resolution : -resolution);
    }
    const Peak next = evaluated(t);
    const Real gain = next.value - top.value;
    if (gain > 0.0) top = next;
    if (next.value > middle.value) {
      (next.t < middle.t ? right : left) = middle;
      middle = next;
    } else {
      (next.t < middle.t ? left : right) = next;
    }
    if (std::fabs(gain) <= 1e-10 * std::fabs(top.value)) break;
  }
  return top;
}

}  // namespace

void hermite_cubic(const StepEnd& from, const StepEnd& to, Real t, AlignedVector& state) {
  const Real h = to.t - from.t;
  const Real s = (t - from.t) / h;
  for (std::size_t k = 0; k < state.size(); ++k) {
    const Real change = to.state[k] - from.state[k];
    const Real bend = (1.0 - s) * (h * from.rate[k] - change) + s * (change - h * to.rate[k]);
    state[k] = from.state[k] + s * (change + (1.0 - s) * bend);
  }
}

Judge::Judge(const ClosedLoop& loop) : loop_(loop), signals_(loop.shape()) {
  const auto give_room = [&](Node& node) {
    node.control.resize(at(loop.shape().own_entries()));
    node.deviation.reserve(at(loop.shape().actions()));
  };
  for (Node& node : nodes_) give_room(node);
  for (Node* node : {&noted_, &middle_, &between_, &end_}) give_room(*node);
}

bool Judge::is_usable(const Node& node) { return std::isfinite(node.power); }

void Judge::look_at_control(Node& node) {
  loop_.evaluate_control(signals_);
  node.control.swap(signals_.control);  // all of which is written anew each time
  node.power = 0.0;
  for (const Real u : node.control) node.power += u * u;
  node.differences[0] = node.power;
}

void Judge::look_at_deviation(const Place& place, Node& node) {
  node.deviation.resize(judgement_.x_star.size());
  node.square = 0.0;
  if (judgement_.x_star.empty()) return;
  const Real* x = loop_.plants(place.state, place.inputs, signals_).x;
  for (std::size_t p = 0; p < judgement_.x_star.size(); ++p) {
    const Real deviation = x[p] - judgement_.x_star[p];
    node.deviation[p] = deviation;
    node.square += deviation * deviation;
  }
}

void Judge::look(Real t, const Place& place, const Modes& modes, Node& node) {
  node.t = t;
  loop_.evaluate_seeking(place.state, place.inputs, modes, signals_);
  look_at_control(node);
  look_at_deviation(place, node);
}

void Judge::note(Real t, const Place& place, const AlignedVector& error, const AlignedVector& network) {
  noted_.t = t;
  signals_.error = error;
  signals_.network = network;
  if (loop_.parameters().strategy.robust) loop_.evaluate_robust_term(signals_);
  look_at_control(noted_);
  look_at_deviation(place, noted_);
  has_noted_ = true;
}

/// As the newest; what was there goes into the node given.
void Judge::keep(Node& node) {
  if (!is_usable(node)) {
    count_ = 0;
    return;
  }
  const int size = static_cast<int>(nodes_.size());
  newest_ = (newest_ + size - 1) % size;
  std::swap(nodes_[at(newest_)], node);
  count_ = std::min(count_ + 1, size);
}

void Judge::start(Real t, const JudgingRule& rule, const Place& place, const Modes& modes) {
  AlignedVector x_star = std::move(judgement_.x_star);
  judgement_ = {};
  judgement_.x_star = std::move(x_star);
  judgement_.begun = judgement_.until = judgement_.last_outside = t;
  judgement_.errors_from = std::max(t, rule.errors_from);
  look(t, place, modes, end_);
  for (const Real deviation : end_.deviation) {
    judgement_.side.push_back(deviation > 0.0 ? -1.0 : deviation < 0.0 ? 1.0 : 0.0);
    judgement_.largest_deviation = std::max(judgement_.largest_deviation, std::fabs(deviation));
  }
  const Real band = rule.settling_band > 0.0 ? rule.settling_band : settled_part * std::sqrt(end_.square);
  judgement_.squared_band = band * band;
  jump(t, place, modes);
}

void Judge::resume(const Judgement& judgement) {
  judgement_ = judgement;
  count_ = 0;
  has_noted_ = false;
}

void Judge::stand(Real t, const Place& place, const Modes& modes) {
  count_ = 0;
  has_noted_ = false;
  look(t, place, modes, end_);
  keep(end_);
}

void Judge::jump(Real t, const Place& place, const Modes& modes) {
  stand(t, place, modes);
  if (count_ == 0) return;
  judgement_.until = t;
  observe(node(0), judgement_);
  const bool was_outside = std::exchange(judgement_.outside, is_outside(node(0).square, judgement_));
  if (was_outside && !judgement_.outside) judgement_.last_outside = t;
}

void Judge::begin_errors_anew(Real t, Real from, const Place& place) {
  judgement_.errors_from = std::max(t, from);
  judgement_.error_peak = 0.0;
  if (from > t) return;
  look_at_deviation(place, between_);
  for (const Real deviation : between_.deviation) {
    judgement_.error_peak = std::max(judgement_.error_peak, std::fabs(deviation));
  }
}

bool Judge::is_outside(Real square, const Judgement& judgement) {
  return judgement.squared_band > 0.0 && square > judgement.squared_band;
}

/// What one point alone tells of peaks. No entry is larger than the norm.
void Judge::observe(const Node& node, Judgement& judgement) {
  if (!std::isfinite(node.power) || node.power > squared(judgement.control_peak)) {
    for (const Real u : node.control) judgement.control_peak = std::max(judgement.control_peak, std::fabs(u));
  }
  if (std::isfinite(node.square) && node.square <= squared(error_record(node.t, judgement))) return;
  for (std::size_t p = 0; p < node.deviation.size(); ++p) {
    const Real side = judgement.side[p];
    const Real size = std::fabs(node.deviation[p]);
    if (node.t >= judgement.errors_from) judgement.error_peak = std::max(judgement.error_peak, size);
    judgement.farthest_beyond = std::max(judgement.farthest_beyond, side == 0.0 ? size : side * node.deviation[p]);
  }
}

void Judge::pass_noted(const Path& path, const Modes& modes) {
  has_noted_ = false;
  go_on(noted_, path, modes, judgement_);
  keep(noted_);
}

void Judge::pass(Real t, const Path& path, const Modes& modes) {
  has_noted_ = false;
  look(t, path(t), modes, end_);
  go_on(end_, path, modes, judgement_);
  keep(end_);
}

Judgement Judge::up_to(Real t, const Path& path, const Modes& modes) {
  Judgement judgement = judgement_;
  look(t, path(t), modes, end_);
  go_on(end_, path, modes, judgement);
  return judgement;
}

void Judge::go_on(Node& end, const Path& path, const Modes& modes, Judgement& judgement) {
  if (std::isnan(end.power) || std::isnan(end.square)) return;
  judgement.until = end.t;
  observe(end, judgement);
  if (!is_usable(end)) {
    judgement.control_energy = beyond_range;
    judgement.outside = is_outside(end.square, judgement);
    return;
  }
  if (count_ == 0) return;
  const Node& begin = node(0);
  const Real h = end.t - begin.t;
  if (!(h > 0.0)) return;
  for (int k = 1; k <= std::min(count_, 4); ++k) {
    end.differences[at(k)] = (end.differences[at(k - 1)] - begin.differences[at(k - 1)]) / (end.t - node(k - 1).t);
  }
  Step step{&begin, &end, &node(1), h, &path, &modes};
  if (count_ == 1 || begin.t - node(1).t < least_part * h) {
    const Real t = begin.t + 0.5 * h;
    look(t, path(t), modes, middle_);
    if (!is_usable(middle_)) return;
    step.third = &middle_;
  }
  add_energy(step, judgement);
  find_control_peak(step, judgement);
  if (judgement_.x_star.empty()) return;
  find_error_peaks(step, judgement);
  find_last_outside(step, judgement);
}

Real Judge::power_at(Real t, const Step& step) {
  look(t, (*step.path)(t), *step.modes, between_);
  return is_usable(between_) ? between_.power : 0.0;
}

const Judge::Node& Judge::deviation_at(Real t, const Step& step) {
  between_.t = t;
  look_at_deviation((*step.path)(t), between_);
  return between_;
}

/// The integral of the polynomial through the last points, at most five, by Newton's divided differences; of the
/// parabola through the middle where that is the third point, which is Simpson's rule.
void Judge::add_energy(const Step& step, Judgement& judgement) {
  const Real a = step.begin->t;
  const Real b = step.end->t;
  const Real h = step.h;
  const Real m = a + 0.5 * h;
  const Real cube = h * h * h / 6.0;
  const Real fa = step.begin->power;
  const Real fb = step.end->power;
  const Real fr = step.third->power;
  const std::array<Real, 5>& difference = step.end->differences;
  Real last = 0.0;
  if (step.third != &middle_) {
    last = -cube * difference[2];
  } else if (a < m && m < b) {  // not of a step as short as the resolution of time
    last = -cube * HalfCurvature(a, b, m)(fa, fb, fr);
  }
  Real integral = 0.5 * h * (fa + fb) + last;
  if (step.third != &middle_) {
    if (count_ > 2) integral += last = -cube * (m - node(1).t) * difference[3];
    if (count_ > 3) {
      integral += last = -cube * (h * h / 20.0 + (m - node(1).t) * (m - node(2).t)) * difference[4];
    }
  }
  const Real tolerance = energy_tolerance * std::fabs(integral) + total_tolerance * judgement.control_energy;
  if (!(std::fabs(last) <= tolerance)) {
    const Real fm = step.third == &middle_ ? fr : power_at(m, step);
    integral = energy(step, {a, m, b}, {fa, fm, fb}, tolerance, most_halvings);
  }
  const Real sum = judgement.control_energy + std::max(integral, 0.0);
  judgement.control_energy = std::isfinite(sum) ? sum : beyond_range;
}

/// Simpson's rule on [t0, t2], and on halves of it where the two differ by more than the tolerance allows.
Real Judge::energy(const Step& step, const std::array<Real, 3>& t, const std::array<Real, 3>& power, Real tolerance,
                   int halvings) {
  const Real h = t[2] - t[0];
  const Real left = 0.5 * (t[0] + t[1]);
  const Real right = 0.5 * (t[1] + t[2]);
  const Real power_left = power_at(left, step);
  const Real power_right = power_at(right, step);
  const Real whole = h / 6.0 * (power[0] + 4.0 * power[1] + power[2]);
  const Real halves = h / 12.0 * (power[0] + 4.0 * power_left + 2.0 * power[1] + 4.0 * power_right + power[2]);
  const Real difference = halves - whole;
  // halves of what is out of range are no better
  if (halvings == 0 || !std::isfinite(difference) || !(std::fabs(difference) > 15.0 * tolerance)) {
    return halves + difference / 15.0;
  }
  return energy(step, {t[0], left, t[1]}, {power[0], power_left, power[1]}, 0.5 * tolerance, halvings - 1) +
         energy(step, {t[1], right, t[2]}, {power[1], power_right, power[2]}, 0.5 * tolerance, halvings - 1);
}

/// The record of deviations that counts at time t: that of whatever is judged then.
Real Judge::error_record(Real t, const Judgement& judgement) {
  return t < judgement.errors_from ? judgement.farthest_beyond
                                   : std::min(judgement.error_peak, judgement.farthest_beyond);
}

/// Whether no entry of a vector, whose squared norm is given, can reach a record on a step: with the norm M at its
/// three points an entry's parabola rises above the chord by at most M times the ratio of their distances, which counts
/// twice as in may_peak.
bool Judge::stays_below(Real record, const Step& step, Real Node::* squared_norm) {
  const Real norm2 = std::max({step.begin->*squared_norm, step.end->*squared_norm, step.third->*squared_norm});
  // of points r < a < b, or of a < r < b, where the parabola through the middle turns
  const Real a = step.begin->t;
  const Real r = step.third->t;
  const Real ratio = r < a ? step.h / (a - r) : 4.0;
  return norm2 * squared(1.0 + ratio) <= squared(record);
}

void Judge::find_control_peak(const Step& step, Judgement& judgement) {
  if (stays_below(judgement.control_peak, step, &Node::power)) return;
  const HalfCurvature half_curvature(step.begin->t, step.end->t, step.third->t);
  for (std::size_t p = 0; p < step.end->control.size(); ++p) {
    const Real fa = step.begin->control[p];
    const Real fb = step.end->control[p];
    const Real c = half_curvature(fa, fb, step.third->control[p]);
    if (!may_peak(judgement.control_peak, fa, fb, c, step.h)) continue;
    const Peak peak =
        largest({step.begin->t, std::fabs(fa)}, {step.end->t, std::fabs(fb)}, judgement.control_peak, [&](Real t) {
          power_at(t, step);
          return is_usable(between_) ? std::fabs(between_.control[p]) : 0.0;
        });
    judgement.control_peak = std::max(judgement.control_peak, peak.value);
  }
}

void Judge::find_error_peaks(const Step& step, Judgement& judgement) {
  const Real from = std::max(step.begin->t, judgement.errors_from);
  const bool is_judged = from <= step.end->t;
  if (is_judged && from > step.begin->t) {  // the peak of errors begins within the step
    for (const Real deviation : deviation_at(from, step).deviation) {
      judgement.error_peak = std::max(judgement.error_peak, std::fabs(deviation));
    }
  }
  const Real record = error_record(step.end->t, judgement);
  if (stays_below(record, step, &Node::square)) return;
  const HalfCurvature half_curvature(step.begin->t, step.end->t, step.third->t);
  for (std::size_t p = 0; p < step.end->deviation.size(); ++p) {
    const Real fa = step.begin->deviation[p];
    const Real fb = step.end->deviation[p];
    const Real c = half_curvature(fa, fb, step.third->deviation[p]);
    if (!may_peak(record, fa, fb, c, step.h)) continue;
    const auto deviation = [&](Real t) { return deviation_at(t, step).deviation[p]; };
    if (is_judged && may_peak(judgement.error_peak, fa, fb, c, step.h)) {
      const Peak first{from, std::fabs(from > step.begin->t ? deviation(from) : fa)};
      const Peak peak = largest(first, {step.end->t, std::fabs(fb)}, judgement.error_peak,
                                [&](Real t) { return std::fabs(deviation(t)); });
      judgement.error_peak = std::max(judgement.error_peak, peak.value);
    }
    const Real side = judgement.side[p];
    const auto beyond = [side](Real value) { return side == 0.0 ? std::fabs(value) : side * value; };
    if (may_peak(judgement.farthest_beyond, fa, fb, c, step.h) && std::max(beyond(fa), beyond(fb)) > 0.0) {
      const Peak peak = largest({step.begin->t, beyond(fa)}, {step.end->t, beyond(fb)}, judgement.farthest_beyond,
                                [&](Real t) { return beyond(deviation(t)); });
      judgement.farthest_beyond = std::max(judgement.farthest_beyond, peak.value);
    }
  }
}

void Judge::find_last_outside(const Step& step, Judgement& judgement) {
  const Node* begin = step.begin;
  const Node* end = step.end;
  judgement.outside = is_outside(end->square, judgement);
  if (judgement.outside || judgement.squared_band == 0.0) return;
  Real outside = begin->t;
  if (!is_outside(begin->square, judgement)) {
    const HalfCurvature half_curvature(begin->t, end->t, step.third->t);
    const Real c = half_curvature(begin->square, end->square, step.third->square);
    if (!may_peak(judgement.squared_band, begin->square, end->square, c, step.h)) return;
    const Peak peak = largest({begin->t, begin->square}, {end->t, end->square}, judgement.squared_band,
                              [&](Real t) { return deviation_at(t, step).square; });
    if (!is_outside(peak.value, judgement)) return;
    outside = peak.t;
  }
  Real inside = end->t;
  constexpr int halvings = 40;
  for (int k = 0; k < halvings; ++k) {
    const Real t = 0.5 * (outside + inside);
    (is_outside(deviation_at(t, step).square, judgement) ? outside : inside) = t;
  }
  judgement.last_outside = outside;
}

}  // namespace mixed_order_game
