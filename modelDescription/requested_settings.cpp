#include "requested_settings.hpp"

namespace mixed_order_game {

References references_of(const ModelVariables& variables) {
  References references;
  for (int reference = 0; reference < variables.size(); ++reference) {
    references.emplace(variables.name(reference), reference);
  }
  return references;
}

Settings settings_with(const TomlEntry& table, const Model& model) {
  Settings changed(model.game);
  if (!table.present()) return changed;
  const References references = references_of(model.variables);
  for (const std::string& name : table.keys("a table of start values")) {
    const TomlEntry entry = table[name];
    const auto found = references.find(name);
    if (found == references.end() || !model.variables.family(found->second).write) {
      entry.fail("a variable that can be set");
    }
    const Family& family = model.variables.family(found->second);
    const Real value = entry.number();
    if (!family.range.contains(value)) entry.fail(family.range.expectation());
    family.write(changed, model.variables.variable(found->second).slot, value);
  }
  changed.parameters.refresh();
  changed.parameters.judge_switching();
  return changed;
}

}  // namespace mixed_order_game
