// ModelStructure of modelDescription.xml: what each output, derivative and initial value depends on.
#pragma once

#include <vector>

#include "model.hpp"
#include "numbers/dependencies.hpp"

namespace mixed_order_game {

struct Dependency {
  int reference;  ///< of the known variable
  DependencyKind kind;
};

struct Unknown {
  int reference;
  std::vector<Dependency> dependencies;  ///< ascending, each once
};

struct ModelStructure {
  std::vector<Unknown> outputs;
  std::vector<Unknown> derivatives;  ///< in the order of the state vector; empty unless all states are variables
  std::vector<Unknown> initial_unknowns;
};

ModelStructure model_structure(const Model& model);

}  // namespace mixed_order_game
