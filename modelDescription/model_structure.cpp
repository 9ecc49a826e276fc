// The equations of the loop, evaluated with what values depend on instead of numbers: after initialization, where
// states, inputs and time are known, and in initialization mode, where parameters are known in place of states.
#include "model_structure.hpp"

#include <algorithm>
#include <string>
#include <unordered_map>

#include "loop/equations.hpp"
#include "unknowns.hpp"

namespace mixed_order_game {

namespace {

/// Variables by family and slot, and what they are where they count as known.
class Knowns {
 public:
  Knowns(const ModelVariables& variables, Equations equations) : equations_(equations) {
    for (int reference = 0; reference < variables.size(); ++reference) {
      const Family& family = variables.family(reference);
      const int slot = variables.variable(reference).slot;
      if (family.causality == Causality::input) {
        inputs_[slot] = reference;
        continue;
      }
      references_[family.name][slot] = reference;
      if (family.is_named) named_[slot] = reference;
      if (family.game_family >= 0) coefficients_[family.game_family][family.coefficient] = &references_[family.name];
    }
  }

  /// A parameter; where it is no variable of this game, its number stays.
  [[nodiscard]] Dependencies parameter(const std::string& family, int slot, Real number) const {
    const auto found = references_.find(family);
    return found == references_.end() ? Dependencies(number) : parameter(found->second, slot, number);
  }
  [[nodiscard]] Dependencies coefficient(int game_family, int number, int slot, Real value) const {
    const auto family = coefficients_.find(game_family);
    if (family == coefficients_.end()) return value;
    const auto found = family->second.find(number);
    return found == family->second.end() ? Dependencies(value) : parameter(*found->second, slot, value);
  }
  [[nodiscard]] Dependencies named(int slot, Real value) const { return parameter(named_, slot, value); }
  /// By its position among the inputs; nothing where it is no variable.
  [[nodiscard]] Dependencies input(int position) const {
    const auto found = inputs_.find(position);
    return found == inputs_.end() ? Dependencies() : Dependencies::known(found->second);
  }
  [[nodiscard]] Dependencies time() const { return Dependencies::known(references_.at("time").at(0)); }

 private:
  using Slots = std::unordered_map<int, int>;

  [[nodiscard]] Dependencies parameter(const Slots& slots, int slot, Real number) const {
    const auto found = slots.find(slot);
    if (found == slots.end()) return number;
    return equations_ == Equations::initial ? Dependencies::known(found->second) : Dependencies::unknown();
  }

  Equations equations_;
  std::unordered_map<std::string, Slots> references_;
  Slots named_;
  Slots inputs_;
  std::unordered_map<int, std::unordered_map<int, const Slots*>> coefficients_;
};

class KnownCoefficients final : public CoefficientsAs<Dependencies> {
 public:
  KnownCoefficients(const Knowns& knowns, int game_family, const Coefficients& values)
      : knowns_(knowns), game_family_(game_family), values_(values) {}

  [[nodiscard]] Dependencies value(int number, int slot) const override {
    return knowns_.coefficient(game_family_, number, slot, values_.value(number, slot));
  }
  [[nodiscard]] bool vanishes(int number, int slot) const override {
    const Dependencies coefficient = value(number, slot);
    return coefficient.number() == 0.0;
  }
  [[nodiscard]] Dependencies named(int slot) const override { return knowns_.named(slot, values_.named[at(slot)]); }

 private:
  const Knowns& knowns_;
  int game_family_;
  const Coefficients& values_;
};

/// What every unknown depends on.
class Analysis {
 public:
  Analysis(const Model& model, Equations equations)
      : model_(model),
        parameters_(model.game.parameters),
        shape_(parameters_.shape),
        n_(shape_.actions()),
        equations_(equations),
        knowns_(model.variables, equations),
        loop_(parameters_),
        state_(at(loop_.layout.size())) {
    fill_state();
    const auto families = parameters_.families();
    std::vector<KnownCoefficients> coefficients;
    for (int k = 0; k < static_cast<int>(families.size()); ++k) {
      coefficients.emplace_back(knowns_, k, families[at(k)]->coefficients);
    }
    const LoopNumbers<Dependencies> numbers = loop_numbers(coefficients);
    std::vector<Dependencies> inputs;
    for (int k = 0; k < loop_.inputs.size(); ++k) inputs.push_back(knowns_.input(k));
    const Modes on_sphere(at(shape_.own_entries()), 1.0);
    loop_.evaluate_control(numbers, state_.data(), inputs.data(), on_sphere);
    if (!model.variables.states().empty()) {
      rate_.resize(state_.size());
      loop_.evaluate_rates(numbers, knowns_.time(), state_.data(), inputs.data(), on_sphere, rate_.data());
    }
    if (equations == Equations::initial && shape_.hosts_all()) find_equilibrium(coefficients[0]);
  }

  Unknown unknown(int reference) const {
    Unknown result{reference, {}};
    const Dependencies value = value_of(reference);
    for (const auto& [known, kind] : value.on()) result.dependencies.push_back({known, kind});
    return result;
  }

 private:
  Dependencies value_of(int reference) const {
    const ModelVariables& variables = model_.variables;
    const Family& family = variables.family(reference);
    const int slot = variables.variable(reference).slot;
    if (family.is_state) return state_[at(slot)];
    if (family.derivative_of >= 0) return rate_[at(slot)];
    if (family.signal == &Signals::control) return loop_.control[at(slot)];
    if (family.name == "xbar") return loop_.shared[at(slot)];
    if (family.causality == Causality::calculated_parameter) return equilibrium(slot);
    // nash_error, of all actions and costs
    Dependencies all;
    for (const Dependencies& x : loop_.x) all += x.nonlinear();
    for (const Dependencies& costs : own_costs_) all += costs;
    return all;
  }

  void fill_state() {
    const StateLayout& layout = loop_.layout;
    const InitialState& initial = parameters_.initial;
    if (equations_ == Equations::running) {
      const std::vector<int>& references = model_.variables.states();
      for (std::size_t k = 0; k < state_.size(); ++k) {
        state_[k] = references.empty() ? Dependencies::unknown() : Dependencies::known(references[k]);
      }
      return;
    }
    for (int p = 0; p < shape_.own_entries(); ++p) {
      const int entry = shape_.entry_of_own(p);
      const char* reference = shape_.is_second_order(shape_.player_of_own(p)) ? "v0" : "z0";
      if (const int x = layout.x_of(p); x >= 0) state_[at(x)] = knowns_.parameter("x0", entry, initial.x[at(entry)]);
      if (const int to = layout.reference_of(p); to >= 0) {
        state_[at(to)] = knowns_.parameter(reference, entry, initial.reference[at(entry)]);
      }
    }
    for (int k = 0; k < shape_.hosts() * n_; ++k) {
      state_[at(layout.estimates() + k)] = knowns_.parameter("y0", k, initial.y[at(k)]);
    }
    for (int m = 0; m < shape_.neurons && !initial.W.empty(); ++m) {
      for (int p = 0; p < shape_.own_entries(); ++p) {
        const int slot = m * n_ + shape_.entry_of_own(p);
        state_[at(layout.weights_of(m) + p)] = knowns_.parameter("W0", slot, initial.W[at(slot)]);
      }
    }
  }

  LoopNumbers<Dependencies> loop_numbers(const std::vector<KnownCoefficients>& coefficients) const {
    const Gains& gains = parameters_.gains;
    const RbfNetwork& rbf = parameters_.rbf;
    LoopNumbers<Dependencies> numbers;
    for (std::size_t k = 0; k < declared_gains.size(); ++k) {
      const std::vector<Real>& values = gains.*Gains::members()[k];
      for (int i = 0; i < shape_.players; ++i) {
        (numbers.gains.*GainsAs<Dependencies>::members()[k])
            .push_back(knowns_.parameter(declared_gains[k].name, gains.per_player ? i : 0, values[at(i)]));
      }
    }
    numbers.robust = knowns_.parameter("robust", 0, 1.0);
    numbers.perturbed = knowns_.parameter("perturbed", 0, 1.0);
    for (int i = 0; i < shape_.players; ++i) {
      const int slot = rbf.per_player ? i : 0;
      numbers.width.push_back(knowns_.parameter("rho", slot, rbf.width[at(i)]));
      numbers.W_max.push_back(knowns_.parameter("W_max", slot, rbf.W_max[at(i)]));
    }
    for (std::size_t k = 0; k < rbf.centers.size(); ++k) {
      const int slot = static_cast<int>(k);
      const int first = rbf.per_player ? slot : slot - slot % shape_.players;
      numbers.centers.push_back(rbf.diagonal ? knowns_.parameter("center", first, rbf.centers[k])
                                             : Dependencies(rbf.centers[k]));
    }
    for (std::size_t k = 0; k < parameters_.u_max.size(); ++k) {
      const bool is_bounded = std::isfinite(parameters_.u_max[k]);
      numbers.u_max.push_back(is_bounded ? knowns_.parameter("u_max", static_cast<int>(k), parameters_.u_max[k])
                                         : Dependencies());
    }
    for (int h = 0; h < shape_.hosts(); ++h) {
      const int i = shape_.host(h);
      auto& row = numbers.edges.emplace_back();
      for (int k = 0; k < shape_.players; ++k) {
        const Dependencies weight = knowns_.parameter("a", edge_slot(i, k), parameters_.graph.weight(i, k));
        if (weight.number() != 0.0) row.push_back({k, weight});
      }
    }
    numbers.cost = &coefficients[0];
    numbers.dynamics = &coefficients[1];
    numbers.disturbance = &coefficients[2];
    return numbers;
  }

  /// Where a_ik is a variable.
  int edge_slot(int i, int k) const {
    if (parameters_.graph.directed() || shape_.host_number(k) < 0) return i * shape_.players + k;
    return std::min(i, k) * shape_.players + std::max(i, k);
  }

  // What grad_il f_i depends on at an x of its own, whose entries count as known with references past all others.
  void find_equilibrium(const KnownCoefficients& costs) {
    const int first_entry = model_.variables.size();
    std::vector<Dependencies> x;
    for (int p = 0; p < n_; ++p) x.push_back(Dependencies::known(first_entry + p));
    std::vector<Dependencies> gradients(at(n_));
    parameters_.cost->own_gradients(costs, x.data(), 0, gradients.data());
    for (const Dependencies& gradient : gradients) {
      Dependencies& own = own_costs_.emplace_back();
      std::vector<int>& entries = entries_of_gradient_.emplace_back();
      for (const auto& [reference, kind] : gradient.on()) {
        if (reference < first_entry) {
          own += Dependencies::known(reference);
        } else {
          entries.push_back(reference - first_entry);
        }
      }
    }
  }
  // x*_p follows its own costs and those of the entries that its gradient depends on, directly or by way of others.
  Dependencies equilibrium(int p) const {
    std::vector<int> found{p};
    std::vector<bool> is_found(at(n_));
    is_found[at(p)] = true;
    Dependencies costs;
    for (std::size_t next = 0; next < found.size(); ++next) {
      costs += own_costs_[at(found[next])];
      for (const int entry : entries_of_gradient_[at(found[next])]) {
        if (!is_found[at(entry)]) found.push_back(entry);
        is_found[at(entry)] = true;
      }
    }
    return costs;
  }

  const Model& model_;
  const Parameters& parameters_;
  const Shape& shape_;
  int n_;
  Equations equations_;
  Knowns knowns_;
  LoopEquations<Dependencies> loop_;
  std::vector<Dependencies> state_, rate_;
  std::vector<Dependencies> own_costs_;  // by entry of a gradient
  std::vector<std::vector<int>> entries_of_gradient_;
};

}  // namespace

ModelStructure model_structure(const Model& model) {
  const ModelVariables& variables = model.variables;
  const Analysis running(model, Equations::running);
  const Analysis initial(model, Equations::initial);
  ModelStructure structure;
  for (int reference = 0; reference < variables.size(); ++reference) {
    const Family& family = variables.family(reference);
    if (family.causality == Causality::output) structure.outputs.push_back(running.unknown(reference));
    if (is_unknown(model, reference, Equations::initial)) {
      structure.initial_unknowns.push_back(initial.unknown(reference));
    }
  }
  // in the order of the state vector
  std::vector<int> derivatives(variables.states().size());
  for (int reference = 0; reference < variables.size(); ++reference) {
    const int of = variables.family(reference).derivative_of;
    if (of < 0) continue;
    derivatives[at(variables.variable(reference).slot)] = reference;
  }
  for (const int reference : derivatives) structure.derivatives.push_back(running.unknown(reference));
  return structure;
}

}  // namespace mixed_order_game
