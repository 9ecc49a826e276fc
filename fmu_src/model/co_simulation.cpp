#include "co_simulation.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "errors.hpp"
#include "experiment.hpp"
#include "model_variables.hpp"

namespace mixed_order_game {

namespace {

bool same_bits(std::span<const Real> a, std::span<const Real> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

}  // namespace

CoSimulation::CoSimulation(const Evaluation& evaluation)
    : loop_(evaluation.loop()), integrator_(loop_, evaluation.inputs(), make_structured_newton()) {}

void CoSimulation::start(Tolerances tolerances, std::vector<Real> acting, const JudgingRule& rule,
                         std::span<const Real> x_star) {
  integrator_.set_equilibrium(x_star);
  integrator_.start(0.0, tolerances, rule);
  time_ = loop_.time_origin();
  acting_ = std::move(acting);
}

Standing CoSimulation::standing() const {
  return {time_, integrator_.time(), integrator_.state(), &integrator_.modes()};
}

Change CoSimulation::change_to(std::span<const Real> settings, std::size_t parameters, std::size_t inputs) const {
  const std::span<const Real> acting = acting_;
  if (!same_bits(settings.first(parameters), acting.first(parameters))) return Change::parameters;
  return change_to(settings.last(inputs));
}

Change CoSimulation::change_to(std::span<const Real> inputs) const {
  return same_bits(inputs, std::span(acting_).last(inputs.size())) ? Change::none : Change::input;
}

void CoSimulation::settings_act(std::vector<Real> acting, std::span<const Real> x_star) {
  integrator_.set_equilibrium(x_star);
  acting_ = std::move(acting);
  integrator_.restart(true);
}

void CoSimulation::inputs_act(std::span<const Real> inputs) {
  std::ranges::copy(inputs, std::span(acting_).last(inputs.size()).begin());
  integrator_.restart(false);
}

Real CoSimulation::end_of_step(Real t, Real h, std::optional<Real> stop_time) const {
  const Real now = time_;
  if (!(h > 0.0) || !std::isfinite(h)) {
    throw Error("the step size is " + text_of(h) + ", expected a positive finite number");
  }
  if (!std::isfinite(t) || !(std::fabs(t - now) <= time_tolerance(std::max(std::fabs(t), std::fabs(now)), h))) {
    throw Error("the communication point is " + text_of(t) + ", expected " + text_of(now) +
                ", where the last step ended");
  }
  const Real end = std::max(t + h, now);
  if (!std::isfinite(end)) throw Error("the step ends at " + text_of(end) + ", expected a finite time");
  if (!(end > now)) {
    throw Error("the step size is " + text_of(h) + ", expected one that reaches beyond " + text_of(now) +
                " in double precision");
  }
  if (stop_time && end > *stop_time + stop_tolerance(end, h)) {
    throw Error("the step from " + text_of(t) + " by " + text_of(h) + " ends after the stop time " +
                text_of(*stop_time));
  }
  return end;
}

void CoSimulation::advance(Real t_end) {
  integrator_.advance(t_end - loop_.time_origin());
  time_ = t_end;
}

bool CoSimulation::restore(const Point& point, Tolerances tolerances) {
  acting_ = point.acting;
  time_ = point.time;
  return integrator_.restore(point.checkpoint, tolerances);
}

}  // namespace mixed_order_game
