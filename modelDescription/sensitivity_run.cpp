#include "sensitivity_run.hpp"

#include <algorithm>
#include <vector>

#include "equilibrium/equilibrium.hpp"
#include "errors.hpp"
#include "instance.hpp"
#include "integration/integrator.hpp"
#include "integration/sensitivities.hpp"
#include "json_text.hpp"
#include "requested_settings.hpp"

namespace mixed_order_game {

namespace {

bool switches_with_jumps(const Parameters& parameters) {
  for (const GameFamily* family : parameters.families()) {
    const Switching& switching = family->switching();
    for (int k = 0; k < switching.count(); ++k) {
      if (!switching.is_bend(k)) return true;
    }
  }
  return false;
}

/// A direction has the form of the parameters: the table writes it as it writes them.
Parameters direction_of(const TomlEntry& entry, const Model& model, const References& references) {
  const std::string name = entry.text();
  const auto found = references.find(name);
  const Family* family = found == references.end() ? nullptr : &model.variables.family(found->second);
  if (family == nullptr || family->causality != Causality::parameter || family->type != Type::real ||
      family->only_judges || family->range.kind == Range::Kind::tolerance) {
    entry.fail("a Real parameter on which the run depends");
  }
  if (family->is_named && switches_with_jumps(model.game.parameters)) {
    entry.fail(
        "no parameter of expressions, because expressions of this game jump at conditions that may depend on it");
  }
  Settings direction(model.game);
  direction.parameters = model.game.parameters.zero_direction();
  View written;
  written.settings = &direction;
  const Real before = model.variables.read(found->second, written);
  family->write(direction, model.variables.variable(found->second).slot, before + 1.0);
  direction.parameters.refresh();
  return direction.parameters;
}

std::vector<Real> times_of(const TomlEntry& entry) {
  const std::size_t count = entry.length("a list of times");
  std::vector<Real> times;
  for (std::size_t k = 0; k < count; ++k) {
    times.push_back(entry.item(k).number());
    if (k > 0 && !(times[k] > times[k - 1])) entry.item(k).fail("a time after the one before");
  }
  if (times.empty()) entry.fail("at least one time");
  return times;
}

/// What the FMU would refuse, in its words.
void require_runnable(const Model& model, const TomlEntry& settings, const References& references, Real start) {
  Instance instance(model, Interface::co_simulation);
  Experiment experiment;
  experiment.start_time = start;
  instance.setup_experiment(experiment);
  for (const std::string& name : settings.present() ? settings.keys("a table") : std::vector<std::string>{}) {
    const int reference = references.find(name)->second;
    const auto one = static_cast<std::uint32_t>(reference);
    const Real value = settings[name].number();
    instance.set(model.variables.family(reference).type, {&one, 1}, &value);
  }
  instance.enter_initialization();
  instance.exit_initialization();
}

}  // namespace

std::string sensitivity_run(std::string_view toml, std::string_view request) {
  const Model model(toml);
  const toml::table document = parse_toml(request);
  const TomlEntry asked(document);
  asked.accept_keys({"times", "parameters", "tolerance", "settings"});
  const Shape& shape = model.game.parameters.shape;
  if (!shape.hosts_all() || !shape.external.empty()) {
    throw GameError("some players or plants are elsewhere, expected a game with all of its players");
  }
  const References references = references_of(model.variables);
  const std::vector<Real> times = times_of(asked["times"]);
  const Settings settings = settings_with(asked["settings"], model);
  require_runnable(model, asked["settings"], references, times[0]);
  std::vector<Parameters> directions;
  const TomlEntry names = asked["parameters"];
  for (std::size_t k = 0; k < names.length("a list of names"); ++k) {
    directions.push_back(direction_of(names.item(k), model, references));
  }

  const std::vector<Real> x_star = nash_equilibrium(*settings.parameters.cost, shape, settings.parameters.guess);
  std::vector<std::vector<Real>> x_star_along;
  for (const Parameters& direction : directions) {
    x_star_along.push_back(nash_equilibrium_along(*settings.parameters.cost, *direction.cost, shape, x_star.data()));
  }

  ClosedLoop loop(settings.parameters);
  loop.set_time_origin(times[0]);
  Sensitivities sensitivities(loop, settings.inputs, directions);
  Integrator integrator(loop, settings.inputs, make_structured_newton());
  integrator.set_follower(&sensitivities);
  Tolerances tolerances;
  tolerances.relative = settings.tolerance_relative > 0.0 ? settings.tolerance_relative : asked["tolerance"].positive();
  tolerances.absolute = settings.tolerance_absolute > 0.0 ? settings.tolerance_absolute : 0.01 * tolerances.relative;
  integrator.start(0.0, tolerances);
  const std::size_t n = at(shape.actions());
  std::vector<std::vector<Real>> x;
  std::vector<std::vector<std::vector<Real>>> x_along(directions.size());
  for (const Real t : times) {
    integrator.advance(t - times[0]);
    x.emplace_back(integrator.state(), integrator.state() + n);
    for (std::size_t k = 0; k < directions.size(); ++k) {
      const Real* along = sensitivities.at_time(integrator.time(), static_cast<int>(k));
      x_along[k].emplace_back(along, along + n);
    }
  }
  const auto actions = [&](const std::vector<Real>& one) { return json_actions(one, shape); };
  const auto rows = [&](const std::vector<std::vector<Real>>& many) { return json_list(many, actions); };
  return "{\"x\": " + rows(x) + ",\n \"x_along\": " + json_list(x_along, rows) + ",\n \"x_star\": " + actions(x_star) +
         ",\n \"x_star_along\": " + rows(x_star_along) +
         ",\n \"steps\": " + std::to_string(integrator.statistics().steps) + "}\n";
}

}  // namespace mixed_order_game
