#include "model_structure.hpp"

#include <algorithm>
#include <map>
#include <string>
#include <unordered_map>

#include "unknowns.hpp"

namespace mixed_order_game {

namespace {

using enum DependencyKind;

class Analysis {
 public:
  explicit Analysis(const Model& model)
      : model_(model),
        variables_(model.variables),
        parameters_(model.game.parameters),
        shape_(parameters_.shape),
        n_(shape_.actions()) {
    for (int reference = 0; reference < variables_.size(); ++reference) {
      references_[variables_.family(reference).name][variables_.variable(reference).slot] = reference;
    }
    states_are_variables_ = model.game.expose == Expose::all;
  }

  ModelStructure result() {
    ModelStructure structure;
    for (int reference = 0; reference < variables_.size(); ++reference) {
      const Family& family = variables_.family(reference);
      const std::string& name = family.name;
      const int slot = variables_.variable(reference).slot;
      if (family.causality == Causality::output) {
        structure.outputs.push_back(unknown(reference, [&] { output(name, slot); }));
      }
      if (is_unknown(model_, reference, Equations::initial)) {
        structure.initial_unknowns.push_back(unknown(reference, [&] { initial_value(name, slot); }));
      }
    }
    if (!states_are_variables_) return structure;
    for (int p = 0; p < n_; ++p) add_derivative(structure, "der(x", p);
    for (int p = 0; p < n_; ++p) add_derivative(structure, is_second(p) ? "der(v" : "der(z", p);
    for (int k = 0; k < shape_.players * n_; ++k) add_derivative(structure, "der(y", k);
    for (int k = 0; k < shape_.neurons * n_; ++k) add_derivative(structure, "der(W", k);
    return structure;
  }

 private:
  bool is_second(int p) const { return shape_.is_second_order(shape_.player_of(p)); }

  template <typename Collect>
  Unknown unknown(int reference, Collect collect) {
    collected_.clear();
    collect();
    Unknown result{reference, {}};
    for (const auto& [known, kind] : collected_) result.dependencies.push_back({known, kind});
    return result;
  }
  void add_derivative(ModelStructure& structure, const char* name, int slot) {
    structure.derivatives.push_back(unknown(references_.at(name).at(slot), [&] { derivative(name, slot); }));
  }

  // A known that is no variable of this game (because it is not exposed) is left out, and false returned.
  bool on(const std::string& name, int slot = 0, DependencyKind kind = dependent) {
    const auto family = references_.find(name);
    if (family == references_.end()) return false;
    const auto reference = family->second.find(slot);
    if (reference == family->second.end()) return false;
    const auto [entry, is_new] = collected_.emplace(reference->second, kind);
    if (!is_new) entry->second = std::max(entry->second, kind);
    return true;
  }
  void on_state(const std::string& name, int slot, DependencyKind kind = dependent) {
    if (states_are_variables_) on(name, slot, kind);
  }
  void on_reference_of(int p, DependencyKind kind = dependent) { on_state(is_second(p) ? "v" : "z", p, kind); }

  void output(const std::string& name, int p) {
    if (name == "x" || name == "v") {
      on_state(name, p, constant);
    } else if (name == "u") {
      control(p);
    } else {
      for (int other = 0; other < n_; ++other) on_state("x", other);
    }
  }

  void derivative(const std::string& name, int slot) {
    const int p = slot % n_;
    const int i = shape_.player_of(p);
    if (name == "der(x" && is_second(p)) {
      on_state("v", p, constant);
    } else if (name == "der(x" || name == "der(v") {
      control(p);
      for_dynamics(p, [&](int other, DependencyKind kind) { on_state("x", other, kind); });
      on("d_ext", p, constant);
      on("time");
    } else if (name == "der(z") {
      for_row(p, [&](int other) { on_state("y", i * n_ + other, tunable); });
    } else if (name == "der(y") {
      for (int k = 0; k < shape_.players; ++k) on_state("y", k * n_ + p, tunable);
      if (slot / n_ != i) on_state(is_second(p) ? "x" : "z", p, tunable);  // a_ii = 0
    } else {
      network(p);
      error(p);
    }
  }

  void error(int p) {
    on_reference_of(p);
    if (is_second(p)) {
      for_row(p, [&](int other) { on_state("y", shape_.player_of(p) * n_ + other); });
    } else {
      on_state("x", p);
    }
  }
  // w'S(y_i): the network sees the whole estimate
  void network(int p) {
    for (int other = 0; other < n_; ++other) on_state("y", shape_.player_of(p) * n_ + other);
    for (int m = 0; m < shape_.neurons; ++m) on_state("W", m * n_ + p);
  }
  void control(int p) {
    error(p);
    network(p);
  }

  void initial_value(const std::string& name, int slot) {
    const int p = slot % n_;
    const int i = shape_.player_of(p);
    if (name == "x" || name == "v" || name == "z" || name == "y") {
      on(name + "0", slot);
    } else if (name == "W") {  // starts at zero, whatever is set
    } else if (name == "u") {
      initial_control(p);
    } else if (name == "nash_error") {
      for (int other = 0; other < n_; ++other) on("x0", other);
      for (int other = 0; other < n_; ++other) own_cost(other);
    } else if (name == "x_star") {
      equilibrium_of(p);
    } else if (name == "der(x" && is_second(p)) {
      on("v0", p);
    } else if (name == "der(x" || name == "der(v") {
      initial_control(p);
      on("perturbed");
      for_dynamics(p, [&](int other, DependencyKind) {
        on("dynamics_gain", i);
        on("x0", other);
      });
      for (const char* part : {"amplitude", "frequency", "phase", "bias"}) on("disturbance_" + std::string(part), p);
      on("d_ext", p);
      on("time");
    } else if (name == "der(z") {
      on("k2");
      initial_gradient(p);
    } else if (name == "der(y") {
      const int estimator = slot / n_;
      on("k3");
      for (int k = 0; k < shape_.players; ++k) {
        on("a", std::min(estimator, k) * shape_.players + std::max(estimator, k));
        on("y0", k * n_ + p);
      }
      if (estimator != i) on(is_second(p) ? "x0" : "z0", p);  // a_ii = 0
    } else if (name == "der(W") {
      on("beta");
      on("robust");
      on("rho");
      on("center", slot / n_);
      for (int other = 0; other < n_; ++other) on("y0", i * n_ + other);
      initial_error(p);
    }
  }

  void initial_gradient(int p) {
    const int i = shape_.player_of(p);
    const Real* y0 = parameters_.initial.y.data() + i * n_;  // cannot be set where it is no variable
    on("cost_linear", p);
    if (states_are_variables_ || y0[p] != 0.0) on("cost_quadratic", i);
    for (int j = 0; j < shape_.players; ++j) {
      const int other = shape_.entry(j, shape_.coordinate_of(p));
      if (states_are_variables_ || y0[p] != y0[other]) on("cost_coupling", i * shape_.players + j);
      on("y0", i * n_ + other);
    }
  }
  void initial_error(int p) {
    if (is_second(p)) {
      on("v0", p);
      on("k2");
      initial_gradient(p);
    } else {
      on("x0", p);
      on("z0", p);
    }
  }
  // the weights start at zero, so that the network says nothing yet
  void initial_control(int p) {
    on(is_second(p) ? "k4" : "k1");
    on("delta");
    on("epsilon");
    on("robust");
    initial_error(p);
  }
  // x*_il follows the costs of i and of the players that it is coupled to, directly or by way of others
  void equilibrium_of(int p) {
    std::vector<int> found{p};
    std::vector<bool> is_found(at(shape_.players));
    is_found[at(shape_.player_of(p))] = true;
    for (std::size_t next = 0; next < found.size(); ++next) {
      for (const int j : own_cost(found[next])) {
        if (!is_found[at(j)]) found.push_back(shape_.entry(j, shape_.coordinate_of(p)));
        is_found[at(j)] = true;
      }
    }
  }
  // coefficients of f_i along one coordinate; returns the players that i can be coupled to
  std::vector<int> own_cost(int p) {
    const int i = shape_.player_of(p);
    std::vector<int> others;
    on("cost_quadratic", i);
    on("cost_linear", p);
    for (int j = 0; j < shape_.players; ++j) {
      if (on("cost_coupling", i * shape_.players + j)) others.push_back(j);
    }
    return others;
  }

  // all players' entries of the coordinate of p
  template <typename Each>
  void for_row(int p, Each each) const {
    for (int j = 0; j < shape_.players; ++j) each(shape_.entry(j, shape_.coordinate_of(p)));
  }
  template <typename Each>
  void for_dynamics(int p, Each each) const {
    const UnknownDynamics& dynamics = *parameters_.dynamics;
    const SparseRows& pattern = dynamics.jacobian_pattern();
    for (int k = pattern.start[at(p)]; k < pattern.start[at(p + 1)]; ++k) {
      each(pattern.column[at(k)], dynamics.is_constant(k) ? tunable : dependent);
    }
  }

  const Model& model_;
  const ModelVariables& variables_;
  const Parameters& parameters_;
  const Shape& shape_;
  int n_;
  std::unordered_map<std::string, std::unordered_map<int, int>> references_;  // by family and slot
  bool states_are_variables_ = false;
  std::map<int, DependencyKind> collected_;
};

}  // namespace

ModelStructure model_structure(const Model& model) { return Analysis(model).result(); }

}  // namespace mixed_order_game
