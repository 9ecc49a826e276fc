#include "importer.hpp"

#include <algorithm>

namespace {

std::vector<double> moved_along(const std::vector<double>& state, double h, const std::vector<double>& rate) {
  std::vector<double> sum(state);
  for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += h * rate[k];
  return sum;
}

bool changed_sign(const std::vector<double>& before, const std::vector<double>& after) {
  return !std::equal(before.begin(), before.end(), after.begin(),
                     [](double a, double b) { return (a > 0.0) == (b > 0.0); });
}

}  // namespace

void Importer::begin(double start, std::optional<double> stop) {
  initialize(start, std::nullopt, stop);
  time = start;
  finish_event();
}

fmi2EventInfo Importer::finish_event() {
  fmi2EventInfo info{};
  info.newDiscreteStatesNeeded = fmi2True;
  fmi2Boolean any_moved = fmi2False;
  while (info.newDiscreteStatesNeeded != fmi2False) {
    const fmi2Status status = fmi2NewDiscreteStates(component, &info);
    EXPECT_EQ(status, fmi2OK) << last_message();
    if (status != fmi2OK) break;
    any_moved = std::max(any_moved, info.valuesOfContinuousStatesChanged);
  }
  info.valuesOfContinuousStatesChanged = any_moved;
  EXPECT_EQ(fmi2EnterContinuousTimeMode(component), fmi2OK) << last_message();
  return info;
}

void Importer::handle_event() {
  ASSERT_EQ(fmi2EnterEventMode(component), fmi2OK) << last_message();
  moved += finish_event().valuesOfContinuousStatesChanged != fmi2False ? 1 : 0;
}

std::vector<double> Importer::state() {
  std::vector<double> values(states());
  EXPECT_EQ(fmi2GetContinuousStates(component, values.data(), values.size()), fmi2OK) << last_message();
  return values;
}

std::vector<double> Importer::rate() {
  std::vector<double> values(states());
  EXPECT_EQ(fmi2GetDerivatives(component, values.data(), values.size()), fmi2OK) << last_message();
  return values;
}

std::vector<double> Importer::event_indicators() {
  std::vector<double> values(indicators());
  EXPECT_EQ(fmi2GetEventIndicators(component, values.data(), values.size()), fmi2OK) << last_message();
  return values;
}

void Importer::move_to(double t, const std::vector<double>& state) {
  ASSERT_EQ(fmi2SetTime(component, t), fmi2OK) << last_message();
  ASSERT_EQ(fmi2SetContinuousStates(component, state.data(), state.size()), fmi2OK) << last_message();
}

std::vector<double> Importer::rate_at(double t, const std::vector<double>& state) {
  move_to(t, state);
  return rate();
}

void Importer::take_step(double t, const std::vector<double>& from, double h) {
  const auto k1 = rate_at(t, from);
  const auto k2 = rate_at(t + h / 2.0, moved_along(from, h / 2.0, k1));
  const auto k3 = rate_at(t + h / 2.0, moved_along(from, h / 2.0, k2));
  const auto k4 = rate_at(t + h, moved_along(from, h, k3));
  std::vector<double> to(from);
  for (std::size_t k = 0; k < to.size(); ++k) to[k] += h / 6.0 * (k1[k] + 2.0 * k2[k] + 2.0 * k3[k] + k4[k]);
  move_to(t + h, to);
}

void Importer::integrate(double t_end, double h) {
  while (time < t_end - 1e-12) {
    double step = std::min(h, t_end - time);
    const auto from = state();
    const auto before = event_indicators();
    take_step(time, from, step);
    const bool event = changed_sign(before, event_indicators());
    if (event) {  // the first change, kept on the side after it
      double early = 0.0;
      while (step - early > 1e-13) {
        const double middle = (early + step) / 2.0;
        take_step(time, from, middle);
        (changed_sign(before, event_indicators()) ? step : early) = middle;
      }
      take_step(time, from, step);
    }
    time += step;
    fmi2Boolean enter = fmi2False;
    fmi2Boolean terminate = fmi2True;
    ASSERT_EQ(fmi2CompletedIntegratorStep(component, fmi2True, &enter, &terminate), fmi2OK) << last_message();
    ASSERT_EQ(terminate, fmi2False);
    if (!event && enter == fmi2False) continue;
    ++(event ? state_events : step_events);
    handle_event();
  }
}
