#include "model_description.hpp"

#include <pugixml.hpp>
#include <set>
#include <sstream>

#include "logger.hpp"
#include "loop/located_conditions.hpp"
#include "model_structure.hpp"

namespace mixed_order_game {

namespace {

using pugi::xml_node;

const char* const tool = "mixed-order-game " MIXED_ORDER_GAME_VERSION;

const char* name_of(Causality causality) {
  constexpr const char* names[] = {"parameter", "calculatedParameter", "input", "output", "local", "independent"};
  return names[static_cast<int>(causality)];
}
const char* name_of(Variability variability) {
  constexpr const char* names[] = {"constant", "fixed", "tunable", "discrete", "continuous"};
  return names[static_cast<int>(variability)];
}
const char* name_of(Type type) {
  constexpr const char* names[] = {"Real", "Integer", "Boolean"};
  return names[static_cast<int>(type)];
}
const char* name_of(DependencyKind kind) {
  constexpr const char* names[] = {"constant", "tunable", "dependent"};
  return names[static_cast<int>(kind)];
}

void attribute(xml_node node, const char* name, const std::string& value) {
  node.append_attribute(name) = value.c_str();
}

// XML 1.0 has no control characters
std::string printable(std::string text) {
  for (char& character : text) {
    if (static_cast<unsigned char>(character) < 0x20 || character == 0x7F) character = ' ';
  }
  return text;
}

void write_head(xml_node root, const Model& model) {
  attribute(root, "fmiVersion", "2.0");
  attribute(root, "modelName", model_identifier);
  attribute(root, "guid", model.guid);
  attribute(root, "description", printable(model.game.title));
  attribute(root, "version", MIXED_ORDER_GAME_VERSION);
  attribute(root, "license", "BSD-3-Clause, see documentation/licenses");
  attribute(root, "generationTool", tool);
  attribute(root, "variableNamingConvention", "structured");
  const int located = model.offers_model_exchange() ? LocatedConditions::located(model.game.parameters) : 0;
  attribute(root, "numberOfEventIndicators", std::to_string(located));

  if (model.offers_model_exchange()) {
    xml_node model_exchange = root.append_child("ModelExchange");
    attribute(model_exchange, "modelIdentifier", model_identifier);
    attribute(model_exchange, "needsExecutionTool", "false");
    attribute(model_exchange, "completedIntegratorStepNotNeeded", "false");
    attribute(model_exchange, "canBeInstantiatedOnlyOncePerProcess", "false");
    attribute(model_exchange, "canNotUseMemoryManagementFunctions", "true");
    attribute(model_exchange, "canGetAndSetFMUstate", "true");
    attribute(model_exchange, "canSerializeFMUstate", "true");
    attribute(model_exchange, "providesDirectionalDerivative", "true");
  }
  xml_node co_simulation = root.append_child("CoSimulation");
  attribute(co_simulation, "modelIdentifier", model_identifier);
  attribute(co_simulation, "needsExecutionTool", "false");
  attribute(co_simulation, "canHandleVariableCommunicationStepSize", "true");
  attribute(co_simulation, "canInterpolateInputs", "true");
  attribute(co_simulation, "maxOutputDerivativeOrder", std::to_string(highest_output_derivative));
  attribute(co_simulation, "canRunAsynchronuously", "false");
  attribute(co_simulation, "canBeInstantiatedOnlyOncePerProcess", "false");
  attribute(co_simulation, "canNotUseMemoryManagementFunctions", "true");
  attribute(co_simulation, "canGetAndSetFMUstate", "true");
  attribute(co_simulation, "canSerializeFMUstate", "true");
  attribute(co_simulation, "providesDirectionalDerivative", "true");
}

void write_definitions(xml_node root, const Model& model) {
  xml_node unit_definitions = root.append_child("UnitDefinitions");
  for (const Unit& unit : units()) {
    xml_node node = unit_definitions.append_child("Unit");
    attribute(node, "name", unit.name);
    xml_node base = node.append_child("BaseUnit");
    if (unit.seconds != 0) attribute(base, "s", std::to_string(unit.seconds));
    if (unit.radians != 0) attribute(base, "rad", std::to_string(unit.radians));
  }
  // units of named parameters, of which only the name is known
  std::set<std::string> seen;
  for (const Unit& unit : units()) seen.insert(unit.name);
  for (const Family& family : model.variables.families()) {
    if (family.declared_unit.empty() || !seen.insert(family.declared_unit).second) continue;
    attribute(unit_definitions.append_child("Unit"), "name", family.declared_unit);
  }
  xml_node type_definitions = root.append_child("TypeDefinitions");
  for (const SimpleType& type : simple_types()) {
    xml_node node = type_definitions.append_child("SimpleType");
    attribute(node, "name", type.name);
    attribute(node, "description", type.description);
    xml_node value = node.append_child(name_of(type.type));
    if (type.unit != nullptr) attribute(value, "unit", type.unit);
    if (type.min) attribute(value, "min", std::to_string(*type.min));
    if (type.max) attribute(value, "max", std::to_string(*type.max));
  }
  xml_node categories = root.append_child("LogCategories");
  for (const LogCategory& category : log_categories) {
    xml_node node = categories.append_child("Category");
    attribute(node, "name", category.name);
    attribute(node, "description", category.description);
  }
  xml_node experiment = root.append_child("DefaultExperiment");
  attribute(experiment, "startTime", "0");
  attribute(experiment, "stopTime", text_of(default_stop_time));
  attribute(experiment, "tolerance", text_of(default_tolerance));
  attribute(experiment, "stepSize", text_of(default_step_size));
}

std::string start_of(Type type, Real start) {
  if (type == Type::boolean) return start != 0.0 ? "true" : "false";
  return text_of(start);
}

void write_variables(xml_node root, const Model& model) {
  const ModelVariables& variables = model.variables;
  const Settings settings(model.game);
  const AlignedVector no_inputs(at(settings.inputs.count()));
  View view;
  view.settings = &settings;
  view.inputs = no_inputs.data();
  xml_node model_variables = root.append_child("ModelVariables");
  for (int reference = 0; reference < variables.size(); ++reference) {
    const Family& family = variables.family(reference);
    xml_node node = model_variables.append_child("ScalarVariable");
    attribute(node, "name", variables.name(reference));
    attribute(node, "valueReference", std::to_string(reference));
    attribute(node, "description", family.description);
    attribute(node, "causality", name_of(family.causality));
    attribute(node, "variability", name_of(family.variability));
    if (family.initial != Initial::none && family.causality != Causality::input) {
      attribute(node, "initial", family.initial == Initial::exact ? "exact" : "calculated");
    }
    xml_node value = node.append_child(name_of(family.type));
    if (family.declared_type != nullptr) attribute(value, "declaredType", family.declared_type);
    if (const char* unit = variables.unit(reference); unit != nullptr) attribute(value, "unit", unit);
    if (const auto min = family.range.smallest) attribute(value, "min", text_of(*min));
    if (const auto max = family.range.largest) attribute(value, "max", text_of(*max));
    if (family.nominal > 0.0) attribute(value, "nominal", text_of(family.nominal));
    if (family.initial == Initial::exact) {
      attribute(value, "start", start_of(family.type, variables.read(reference, view)));
    }
    if (family.derivative_of >= 0) {
      const int state = variables.families()[at(family.derivative_of)].first + reference - family.first;
      attribute(value, "derivative", std::to_string(state + 1));
    }
  }
}

void write_unknowns(xml_node structure, const char* name, const std::vector<Unknown>& unknowns, bool with_kinds) {
  if (unknowns.empty()) return;
  xml_node list = structure.append_child(name);
  for (const Unknown& unknown : unknowns) {
    std::string dependencies;
    std::string kinds;
    for (const auto& [reference, kind] : unknown.dependencies) {
      if (!dependencies.empty()) dependencies += ' ';
      dependencies += std::to_string(reference + 1);
      if (!kinds.empty()) kinds += ' ';
      kinds += name_of(kind);
    }
    xml_node node = list.append_child("Unknown");
    attribute(node, "index", std::to_string(unknown.reference + 1));
    attribute(node, "dependencies", dependencies);
    if (with_kinds && !kinds.empty()) attribute(node, "dependenciesKind", kinds);
  }
}

}  // namespace

std::string model_description(const Model& model) {
  pugi::xml_document document;
  xml_node declaration = document.append_child(pugi::node_declaration);
  attribute(declaration, "version", "1.0");
  attribute(declaration, "encoding", "UTF-8");
  xml_node root = document.append_child("fmiModelDescription");
  write_head(root, model);
  write_definitions(root, model);
  write_variables(root, model);
  const ModelStructure structure = model_structure(model);
  xml_node node = root.append_child("ModelStructure");
  write_unknowns(node, "Outputs", structure.outputs, true);
  write_unknowns(node, "Derivatives", structure.derivatives, true);
  write_unknowns(node, "InitialUnknowns", structure.initial_unknowns, false);
  std::ostringstream text;
  document.save(text, "  ", pugi::format_indent, pugi::encoding_utf8);
  return text.str();
}

}  // namespace mixed_order_game
