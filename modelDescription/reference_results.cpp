#include "reference_results.hpp"

#include <charconv>
#include <cmath>
#include <optional>
#include <pugixml.hpp>
#include <sstream>

#include "errors.hpp"
#include "instance.hpp"

namespace mixed_order_game {

namespace {

constexpr const char* experiment_file = "default.exp";
constexpr const char* results_file = "default.csv";

// Together a few seconds.
constexpr int most_states = 5000;
constexpr std::int64_t most_work = 100'000'000;  // integrator steps times states

void append(std::string& text, Real value) {
  char digits[32];
  const auto [end, error] = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::general, 10);
  text.append(digits, end);
}

std::optional<std::string> simulated(const Model& model) {
  const std::int64_t states = StateLayout(model.game.parameters.shape).size();
  const Shape& shape = model.game.parameters.shape;
  // what waits for signals from outside has no run of its own
  if (states > most_states || !shape.hosts_all() || !shape.external.empty()) return std::nullopt;
  const ModelVariables& variables = model.variables;
  std::vector<std::uint32_t> outputs;
  std::string table = "\"time\"";
  for (int reference = 0; reference < variables.size(); ++reference) {
    if (variables.family(reference).causality != Causality::output) continue;
    outputs.push_back(static_cast<std::uint32_t>(reference));
    table += ",\"" + variables.name(reference) + '"';
  }
  Instance instance(model, Interface::co_simulation);
  Experiment experiment;
  experiment.tolerance = reference_tolerance;
  instance.setup_experiment(experiment);
  instance.enter_initialization();
  instance.exit_initialization();
  const int intervals = static_cast<int>(std::lround(default_stop_time / reference_interval));
  std::vector<Real> values(outputs.size());
  for (int k = 0; k <= intervals; ++k) {
    const Real t = default_stop_time * k / intervals;
    if (k > 0) instance.do_step(instance.time(), t - instance.time());
    if (instance.statistics().steps * states > most_work) return std::nullopt;
    instance.get(Type::real, outputs, values.data());
    table += '\n';
    append(table, t);
    for (const Real value : values) {
      table += ',';
      append(table, value);
    }
  }
  return table + '\n';
}

std::string text_of(const pugi::xml_document& document) {
  std::ostringstream text;
  document.save(text, "  ", pugi::format_default, pugi::encoding_utf8);
  return text.str();
}

pugi::xml_document document() {
  pugi::xml_document made;
  pugi::xml_node declaration = made.append_child(pugi::node_declaration);
  declaration.append_attribute("version") = "1.0";
  declaration.append_attribute("encoding") = "UTF-8";
  return made;
}

std::string manifest() {
  pugi::xml_document made = document();
  pugi::xml_node root = made.append_child("fmiReferences");
  root.append_attribute("xmlns:fmi-ls") = "http://fmi-standard.org/fmi-ls-manifest";
  root.append_attribute("fmi-ls:fmi-ls-name") = reference_folder;
  root.append_attribute("fmi-ls:fmi-ls-version") = "1.0.0-alpha.1";
  root.append_attribute("fmi-ls:fmi-ls-description") =
      "Layered Standard providing information on related files included in an FMU.";
  const auto related = [&](const char* type, const char* source, const char* role, const char* description) {
    pugi::xml_node node = root.append_child("Related");
    node.append_attribute("type") = type;
    node.append_attribute("source") = source;
    node.append_attribute("role") = role;
    node.append_attribute("description") = description;
  };
  related("application/x-ma-hs-experiments", experiment_file, "experiment/validation",
          "The default experiment with reference results");
  related("text/csv", results_file, "result", "All outputs of the default experiment");
  related("application/toml", "../../resources/game.toml", "model", "Definition of the game");
  return text_of(made);
}

std::string experiment() {
  pugi::xml_document made = document();
  pugi::xml_node root = made.append_child("Experiments");
  root.append_attribute("name") = "Reference results";
  pugi::xml_node node = root.append_child("Experiment");
  node.append_attribute("name") = "Default experiment";
  node.append_attribute("description") = "All parameters at their start values, no external disturbance";
  node.append_attribute("tolerance") = mixed_order_game::text_of(reference_tolerance).c_str();
  pugi::xml_node settings = node.append_child("TransientSimulation");
  settings.append_attribute("startTime") = "0";
  settings.append_attribute("stopTime") = mixed_order_game::text_of(default_stop_time).c_str();
  settings.append_attribute("stepSize") = mixed_order_game::text_of(reference_interval).c_str();
  node.append_child("References").append_attribute("source") = results_file;
  return text_of(made);
}

}  // namespace

std::map<std::string, std::string> reference_results(const Model& model) {
  try {
    if (const std::optional<std::string> results = simulated(model)) {
      return {{"fmi-ls-manifest.xml", manifest()}, {experiment_file, experiment()}, {results_file, *results}};
    }
  } catch (const Error&) {  // a game that cannot run to the end has no results to compare
  }
  return {};
}

}  // namespace mixed_order_game
