#include "model_variables.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "errors.hpp"
#include "loop/measures.hpp"

namespace mixed_order_game {

namespace {

constexpr SimpleType declared[] = {
    {"Time", Type::real, "s", "Time"},
    {"Action", Type::real, "1", "Entry of an action"},
    {"Velocity", Type::real, "1/s", "Rate of change of an action"},
    {"Drive", Type::real, nullptr, "Drives an action (order 1) or a velocity (order 2)"},
    {"Gain", Type::real, nullptr, "Gain of the strategy"},
    {"EdgeWeight", Type::real, "1", "Weight of an edge of the communication graph; 0 means no edge", 0},
    {"AngularFrequency", Type::real, "rad/s", "Angular frequency of a disturbance"},
    {"Phase", Type::real, "rad", "Phase of a disturbance"},
    {"CostCoefficient", Type::real, "1", "Coefficient of a cost function"},
    {"Weight", Type::real, nullptr, "Weight of the neural network"},
    {"Count", Type::integer, nullptr, "Number of occurrences since the start", 0},
    {"Order", Type::integer, nullptr, "1: velocity-driven, 2: acceleration-driven", 1, 2},
};

constexpr Unit known_units[] = {{"1", 0, 0},     {"s", 1, 0},     {"1/s", -1, 0},   {"1/s2", -2, 0},
                                {"1/s3", -3, 0}, {"1/s4", -4, 0}, {"rad/s", -1, 1}, {"rad", 0, 1}};

// Accessors made from members, so that reading and setting name the same one.
template <auto Member>
Real read_initial(const View& view, int slot) {
  return (view.settings->parameters.initial.*Member)[at(slot)];
}
template <auto Member>
void write_initial(Settings& settings, int slot, Real value) {
  (settings.parameters.initial.*Member)[at(slot)] = value;
}
Real read_state_along(const View&, const Tangent& tangent, int slot) { return tangent.state[slot]; }
template <auto Member>
Real read_count(const View& view, int) {
  return static_cast<Real>(std::min<std::int64_t>(view.statistics.*Member, std::numeric_limits<std::int32_t>::max()));
}

using Index = std::array<int, 3>;
struct Element {
  int slot;
  Index index;
};
using Elements = std::vector<Element>;

}  // namespace

std::span<const SimpleType> simple_types() { return declared; }
std::span<const Unit> units() { return known_units; }

bool Range::contains(Real value) const {
  return std::isfinite(value) && value >= smallest.value_or(value) && value <= largest.value_or(value);
}

std::string Range::expectation() const {
  if (!words.empty()) return std::string(words);
  if (smallest && largest) return "a number from " + text_of(*smallest) + " to " + text_of(*largest);
  if (smallest) return "a finite number of at least " + text_of(*smallest);
  if (largest) return "a finite number of at most " + text_of(*largest);
  return "a finite number";
}

/// Adds the families in the order of the table.
class ModelVariables::Builder {
 public:
  Builder(ModelVariables& table, const Game& game)
      : table_(table), game_(game), shape_(game.parameters.shape), layout_(shape_), inputs_(game.parameters) {}

  void add_all() {
    add({.name = "time",
         .description = "Time",
         .causality = Causality::independent,
         .initial = Initial::none,
         .declared_type = "Time",
         .unit = {"s", "s"},
         .stage = Stage::state,
         .read = [](const View& view, int) { return view.time; }},
        one());
    add_gains();
    add_bounds();
    add_network();
    add_graph();
    add_coefficients();
    add_named_parameters();
    add_switches();
    add_initial_state();
    add_tolerances();
    add_judging_rule();
    add_inputs();
    add_outputs();
    add_inside_of_the_loop();
    add_judgement();
    add_solver();
    require_distinct_names();
  }

 private:
  static Elements one() { return {{0, {}}}; }

  /// [i] of the hosted players of an order (0: of all), or of those whose plants are in the loop.
  Elements players(int order = 0, bool with_plants = false) const {
    Elements elements;
    for (int h = 0; h < shape_.hosts(); ++h) {
      const int i = shape_.host(h);
      if (order != 0 && shape_.order[at(i)] != order) continue;
      if (!with_plants || shape_.has_plant(i)) elements.push_back({i, {i + 1}});
    }
    return elements;
  }
  /// [i,l] of the hosted players for which place(i, own entry) is a slot, not -1.
  template <typename Place>
  Elements actions_at(Place place) const {
    Elements elements;
    for (int h = 0; h < shape_.hosts(); ++h) {
      const int i = shape_.host(h);
      for (int l = 0; l < shape_.dimension; ++l) {
        if (const int slot = place(i, shape_.own_entry(h, l)); slot >= 0) elements.push_back({slot, {i + 1, l + 1}});
      }
    }
    return elements;
  }
  /// At entry(i, l), for players of an order; 0: for all.
  Elements actions(int order = 0, bool with_plants = false) const {
    return actions_at([&](int i, int own) {
      if (order != 0 && shape_.order[at(i)] != order) return -1;
      return with_plants && !shape_.has_plant(i) ? -1 : shape_.entry_of_own(own);
    });
  }
  Elements own_actions() const {
    return actions_at([](int, int own) { return own; });
  }
  Elements states_x() const {
    return actions_at([&](int, int own) { return layout_.x_of(own); });
  }
  Elements states_reference(int order) const {
    return actions_at([&](int i, int own) { return shape_.order[at(i)] == order ? layout_.reference_of(own) : -1; });
  }
  /// [i,j,l] of rows of N D numbers that begin at first: those of the players listed.
  Elements estimates(int first, const std::vector<int>& listed) const {
    Elements elements;
    for (const int i : listed) {
      for (int j = 0; j < shape_.players; ++j) {
        for (int l = 0; l < shape_.dimension; ++l) {
          elements.push_back({first + shape_.entry(j, l), {i + 1, j + 1, l + 1}});
        }
      }
      first += shape_.actions();
    }
    return elements;
  }
  std::vector<int> hosted() const {
    std::vector<int> list;
    for (int h = 0; h < shape_.hosts(); ++h) list.push_back(shape_.host(h));
    return list;
  }
  Elements weights() const {
    Elements elements;
    for (int h = 0; h < shape_.hosts(); ++h) {
      for (int m = 0; m < shape_.neurons; ++m) {
        for (int l = 0; l < shape_.dimension; ++l) {
          elements.push_back({layout_.weights_of(m) + shape_.own_entry(h, l), {shape_.host(h) + 1, m + 1, l + 1}});
        }
      }
    }
    return elements;
  }
  Elements initial_weights() const {
    Elements elements;
    for (const int i : hosted()) {
      for (int m = 0; m < shape_.neurons; ++m) {
        for (int l = 0; l < shape_.dimension; ++l) {
          elements.push_back({m * shape_.actions() + shape_.entry(i, l), {i + 1, m + 1, l + 1}});
        }
      }
    }
    return elements;
  }
  /// Entries of a joint action, at the inputs from first on.
  Elements input_actions(int first, const std::vector<int>& entries) const {
    Elements elements;
    for (const int entry : entries) {
      elements.push_back({first++, {shape_.player_of(entry) + 1, shape_.coordinate_of(entry) + 1}});
    }
    std::sort(elements.begin(), elements.end(), [](const Element& a, const Element& b) { return a.index < b.index; });
    return elements;
  }

  void add(Family family, const Elements& elements) {
    family.first = table_.size();
    family.count = static_cast<int>(elements.size());
    const int number = static_cast<int>(table_.families_.size());
    for (const auto& [slot, index] : elements) {
      const int state = family.is_state ? slot : -1;
      table_.variables_.push_back({number, slot, index, family.type, family.stage, state, family.signal});
    }
    table_.families_.push_back(std::move(family));
  }
  int last_family() const { return static_cast<int>(table_.families_.size()) - 1; }
  bool everything() const { return game_.expose == Expose::all; }

  static Family parameter(const char* name, const char* description, Variability variability) {
    Family family;
    family.name = name;
    family.description = description;
    family.causality = Causality::parameter;
    family.variability = variability;
    family.initial = Initial::exact;
    return family;
  }
  // What the families of the game declare.
  void add_coefficients() {
    const auto families = game_.parameters.families();
    for (std::size_t number = 0; number < families.size(); ++number) {
      const std::span<const Coefficient> coefficients = families[number]->coefficients.declared();
      for (int k = 0; k < static_cast<int>(coefficients.size()); ++k) {
        if (coefficients[at(k)].variable != nullptr) add_coefficient(number, k, coefficients[at(k)]);
      }
    }
  }
  void add_coefficient(std::size_t game_family, int number, const Coefficient& coefficient) {
    Family family = parameter(coefficient.variable, coefficient.description, Variability::tunable);
    family.declared_type = coefficient.declared_type;
    family.unit = coefficient.unit;
    family.moves_equilibrium = coefficient.moves_equilibrium;
    family.read = [=](const View& view, int slot) {
      return view.settings->parameters.families()[game_family]->coefficients[number][at(slot)];
    };
    family.write = [=](Settings& settings, int slot, Real value) {
      settings.parameters.families()[game_family]->coefficients[number][at(slot)] = value;
    };
    family.game_family = static_cast<int>(game_family);
    family.coefficient = number;
    const bool of_plants = game_family > 0;  // costs alone are not
    add(std::move(family),
        elements(coefficient.indices, of_plants, game_.parameters.families()[game_family]->coefficients[number]));
  }
  // Those of the game file; their order is that of the file.
  void add_named_parameters() {
    for (const NamedParameter& named : game_.parameters.named.declared) {
      if (named.fixed) continue;
      if (table_.find(named.name) != nullptr) {
        refuse_name(named.name);
      }
      Family family = parameter(named.name.c_str(), named.description.c_str(), Variability::tunable);
      family.declared_unit = named.unit;
      family.range = {};
      if (std::isfinite(named.min)) family.range.smallest = named.min;
      if (std::isfinite(named.max)) family.range.largest = named.max;
      family.moves_equilibrium = true;
      family.is_named = true;
      family.read = [](const View& view, int slot) { return view.settings->parameters.named.values[at(slot)]; };
      family.write = [](Settings& settings, int slot, Real value) {
        settings.parameters.named.values[at(slot)] = value;
      };
      Elements elements;
      const int columns = named.size.size() == 2 ? named.size[1] : 1;
      for (int k = 0; k < named.count(); ++k) {
        Index index{};
        if (!named.size.empty()) index[0] = k / columns + 1;
        if (named.size.size() == 2) index[1] = k % columns + 1;
        elements.push_back({named.first + k, index});
      }
      add(std::move(family), elements);
    }
  }
  [[noreturn]] static void refuse_name(const std::string& name) {
    const std::string entry = "parameters." + name;
    throw GameError(entry + " has the name of a variable, expected another name", entry);
  }
  // A named parameter may have come before a variable of its name.
  void require_distinct_names() const {
    std::set<std::string_view> seen;
    for (const Family& family : table_.families()) {
      if (!family.is_named) seen.insert(family.name);
    }
    for (const Family& family : table_.families()) {
      if (!family.is_named || !seen.contains(family.name)) continue;
      refuse_name(family.name);
    }
  }
  Elements elements(Indices indices, bool of_plants, const std::vector<Real>& values) const {
    switch (indices) {
      case Indices::player:
        return players(0, of_plants);
      case Indices::entry:
        return actions(0, of_plants);
      case Indices::pair:
        return pairs(values);
      case Indices::term:
        break;
    }
    return {};
  }
  // [i,j], i != j; where not everything is exposed, those that are not zero
  Elements pairs(const std::vector<Real>& values) const {
    Elements elements;
    for (const int i : hosted()) {
      for (int j = 0; j < shape_.players; ++j) {
        const int slot = i * shape_.players + j;
        if (i != j && (everything() || values[at(slot)] != 0.0)) elements.push_back({slot, {i + 1, j + 1}});
      }
    }
    return elements;
  }
  template <auto Member>
  void add_initial(const char* name, const char* description, const char* type, const char* unit,
                   const Elements& elements) {
    Family family = parameter(name, description, Variability::fixed);
    family.declared_type = type;
    family.unit = {unit, unit};
    family.read = read_initial<Member>;
    family.write = write_initial<Member>;
    add(std::move(family), elements);
  }

  void add_gains() {
    const bool per_player = game_.parameters.gains.per_player;
    for (std::size_t k = 0; k < declared_gains.size(); ++k) {
      const GainDeclaration& gain = declared_gains[k];
      const auto values = Gains::members()[k];
      Family family = parameter(gain.name, gain.description, Variability::tunable);
      family.declared_type = "Gain";
      family.unit = {gain.unit, gain.unit};
      family.range = gain.may_be_zero ? Range::non_negative : Range::positive;
      family.read = [=](const View& view, int i) { return (view.settings->parameters.gains.*values)[at(i)]; };
      family.write = [=](Settings& settings, int i, Real value) {
        std::vector<Real>& gains = settings.parameters.gains.*values;
        if (per_player) {
          gains[at(i)] = value;
        } else {
          std::fill(gains.begin(), gains.end(), value);
        }
      };
      add(std::move(family), per_player ? players(gain.order) : one());
    }
  }

  void add_bounds() {
    Elements bounded;
    for (const int p : game_.parameters.bounded()) {
      const int entry = shape_.entry_of_own(p);
      bounded.push_back({entry, {shape_.player_of(entry) + 1, shape_.coordinate_of(entry) + 1}});
    }
    if (bounded.empty()) return;
    std::sort(bounded.begin(), bounded.end(), [](const Element& a, const Element& b) { return a.index < b.index; });
    Family family = parameter("u_max", "Bound of the control in either direction", Variability::tunable);
    family.declared_type = "Drive";
    family.unit = drive;
    family.range = Range::positive;
    family.read = [](const View& view, int slot) { return view.settings->parameters.u_max[at(slot)]; };
    family.write = [](Settings& settings, int slot, Real value) { settings.parameters.u_max[at(slot)] = value; };
    add(std::move(family), bounded);
  }

  void add_network() {
    const bool per_player = game_.parameters.rbf.per_player;
    // one number of each player, or one for all of them
    const auto add_of_players = [&](Family family, std::vector<Real> RbfNetwork::* values) {
      family.range = Range::positive;
      family.read = [=](const View& view, int i) { return (view.settings->parameters.rbf.*values)[at(i)]; };
      family.write = [=](Settings& settings, int i, Real value) {
        std::vector<Real>& numbers = settings.parameters.rbf.*values;
        const auto first = numbers.begin() + i;
        std::fill(first, per_player ? first + 1 : numbers.end(), value);
      };
      add(std::move(family), per_player ? players() : one());
    };
    add_of_players(parameter("W_max", "Bound of the squared norm of each weight column", Variability::fixed),
                   &RbfNetwork::W_max);

    Family rho = parameter("rho", "Width of the radial basis functions", Variability::fixed);
    rho.declared_type = "Action";
    rho.unit = {"1", "1"};
    add_of_players(std::move(rho), &RbfNetwork::width);

    if (!game_.parameters.rbf.diagonal) return;
    Family center = parameter("center", "Every entry of the center of neuron m", Variability::fixed);
    center.declared_type = "Action";
    center.unit = {"1", "1"};
    const int N = shape_.players;
    center.read = [](const View& view, int slot) { return view.settings->parameters.rbf.centers[at(slot)]; };
    center.write = [=](Settings& settings, int slot, Real value) {
      const auto first = settings.parameters.rbf.centers.begin() + slot;
      std::fill_n(first, per_player ? 1 : N, value);
    };
    Elements centers;
    for (const int i : per_player ? hosted() : std::vector<int>{0}) {
      for (int m = 0; m < shape_.neurons; ++m) {
        centers.push_back({m * N + i, per_player ? Index{i + 1, m + 1} : Index{m + 1}});
      }
    }
    add(std::move(center), centers);
  }

  void add_graph() {
    const bool directed = game_.parameters.graph.directed();
    Family family = parameter(
        "a", directed ? "Weight with which player i hears player j" : "Weight of the edge between players i and j",
        Variability::tunable);
    family.declared_type = "EdgeWeight";
    family.unit = {"1", "1"};
    family.range = Range::non_negative;
    family.read = [](const View& view, int slot) {
      const CommunicationGraph& graph = view.settings->parameters.graph;
      return graph.weight(slot / graph.players(), slot % graph.players());
    };
    family.write = [](Settings& settings, int slot, Real value) {
      CommunicationGraph& graph = settings.parameters.graph;
      graph.set_weight(slot / graph.players(), slot % graph.players(), value);
    };
    Elements pairs;
    for (const int i : hosted()) {
      for (int j = 0; j < shape_.players; ++j) {
        if (j == i || (!directed && j < i && shape_.host_number(j) >= 0)) continue;
        const bool must_be_edge = !everything() || !shape_.hosts_all();  // a player elsewhere is heard or not, for good
        if (must_be_edge && game_.parameters.graph.weight(i, j) == 0.0) continue;
        pairs.push_back({i * shape_.players + j, {i + 1, j + 1}});
      }
    }
    add(std::move(family), pairs);
  }

  void add_switches() {
    Family robust = parameter("robust", "Neural network and robust term are in the control", Variability::fixed);
    robust.type = Type::boolean;
    robust.read = [](const View& view, int) { return view.settings->parameters.strategy.robust ? 1.0 : 0.0; };
    robust.write = [](Settings& settings, int, Real value) { settings.parameters.strategy.robust = value != 0.0; };
    add(std::move(robust), one());

    Family perturbed = parameter("perturbed", "Unknown dynamics and disturbance are in the plants", Variability::fixed);
    perturbed.type = Type::boolean;
    perturbed.read = [](const View& view, int) { return view.settings->parameters.strategy.perturbed ? 1.0 : 0.0; };
    perturbed.write = [](Settings& settings, int, Real value) {
      settings.parameters.strategy.perturbed = value != 0.0;
    };
    add(std::move(perturbed), one());

    if (!shape_.hosts_all()) return;
    Family allow =
        parameter("allow_disconnected", "Accept a communication graph that is not connected", Variability::fixed);
    allow.type = Type::boolean;
    allow.read = [](const View& view, int) { return view.settings->allow_disconnected ? 1.0 : 0.0; };
    allow.write = [](Settings& settings, int, Real value) { settings.allow_disconnected = value != 0.0; };
    add(std::move(allow), one());
  }

  void add_initial_state() {
    add_initial<&InitialState::x>("x0", "Initial action", "Action", "1", actions(0, true));
    add_initial<&InitialState::reference>("v0", "Initial velocity", "Velocity", "1/s", actions(2, true));
    add_initial<&InitialState::reference>("z0", "Initial reference", "Action", "1", actions(1));
    if (everything()) {
      add_initial<&InitialState::y>("y0", "Initial estimate by player i of the action of player j", "Action", "1",
                                    estimates(0, hosted()));
      if (!game_.parameters.initial.W.empty()) {
        add_initial<&InitialState::W>("W0", "Initial network weight of player i, neuron m, coordinate l", "Weight",
                                      nullptr, initial_weights());
        table_.families_.back().unit = drive;
      }
    }
  }

  void add_tolerances() {
    Family relative = parameter("tolerance_relative", "Relative tolerance of the integrator; 0: that of the experiment",
                                Variability::fixed);
    relative.unit = {"1", "1"};
    relative.range = Range::tolerance;
    relative.read = [](const View& view, int) { return view.settings->tolerance_relative; };
    relative.write = [](Settings& settings, int, Real value) { settings.tolerance_relative = value; };
    add(std::move(relative), one());

    Family absolute =
        parameter("tolerance_absolute", "Absolute tolerance of the integrator; 0: a hundredth of the relative one",
                  Variability::fixed);
    absolute.range = Range::non_negative;
    absolute.read = [](const View& view, int) { return view.settings->tolerance_absolute; };
    absolute.write = [](Settings& settings, int, Real value) { settings.tolerance_absolute = value; };
    add(std::move(absolute), one());
  }

  void add_judging_rule() {
    if (!shape_.hosts_all()) return;
    Family band =
        parameter("settling_band", "Nash error up to which the run counts as settled; 0: 2 % of the initial one",
                  Variability::fixed);
    band.declared_type = "Action";
    band.unit = {"1", "1"};
    band.range = Range::non_negative;
    band.read = [](const View& view, int) { return view.settings->settling_band; };
    band.write = [](Settings& settings, int, Real value) { settings.settling_band = value; };
    add(std::move(band), one());

    Family from =
        parameter("judge_from", "Time from which error_peak is taken; setting it begins it anew", Variability::tunable);
    from.declared_type = "Time";
    from.unit = {"s", "s"};
    from.only_judges = true;
    from.read = [](const View& view, int) { return view.settings->judge_from; };
    from.write = [](Settings& settings, int, Real value) { settings.judge_from = value; };
    add(std::move(from), one());
  }

  void add_input(const char* name, const char* description, const char* type, std::array<const char*, 2> unit,
                 const Elements& elements) {
    if (elements.empty()) return;
    add({.name = name,
         .description = description,
         .causality = Causality::input,
         .initial = Initial::exact,
         .declared_type = type,
         .unit = unit,
         .stage = Stage::inputs,
         .read = [](const View& view, int slot) { return view.inputs[slot]; },
         .write = [](Settings& settings, int slot, Real value) { settings.inputs.set_value(slot, value); }},
        elements);
  }
  void add_inputs() {
    add_input("d_ext", "External disturbance, added to d_il(t)", "Drive", drive,
              actions_at([&](int i, int own) { return shape_.has_plant(i) ? inputs_.d_ext() + own : -1; }));
    add_input("x", "Action of a plant outside", "Action", {"1", "1"}, input_actions(inputs_.x(), inputs_.actions()));
    add_input("v", "Velocity of a plant outside", "Velocity", {"1/s", "1/s"},
              input_actions(inputs_.v(), inputs_.velocities()));
    add_input("y", "Estimate by player i, who is heard, of the action of player j", "Action", {"1", "1"},
              estimates(inputs_.y_of(0), inputs_.heard()));
    Elements shared;
    for (std::size_t k = 0; k < inputs_.heard().size(); ++k) {
      for (int l = 0; l < shape_.dimension; ++l) {
        shared.push_back({inputs_.xbar_of(static_cast<int>(k)) + l, {inputs_.heard()[k] + 1, l + 1}});
      }
    }
    add_input("xbar", "Signal shared by a player who is heard: z (order 1) or x (order 2)", "Action", {"1", "1"},
              shared);
  }

  void add_outputs() {
    add({.name = "x",
         .description = "Action",
         .causality = Causality::output,
         .declared_type = "Action",
         .unit = {"1", "1"},
         .nominal = 1.0,
         .stage = Stage::state,
         .is_state = true,
         .read_along = read_state_along},
        states_x());
    x_ = last_family();
    add({.name = "v",
         .description = "Velocity",
         .causality = Causality::output,
         .declared_type = "Velocity",
         .unit = {"1/s", "1/s"},
         .nominal = 1.0,
         .stage = Stage::state,
         .is_state = true,
         .read_along = read_state_along},
        states_reference(2));
    v_ = last_family();
    add({.name = "u",
         .description = "Control input of the plant",
         .causality = Causality::output,
         .declared_type = "Drive",
         .unit = drive,
         .stage = Stage::signals,
         .signal = &Signals::control,
         .read_along = [](const View&, const Tangent& tangent, int slot) { return tangent.control[slot]; }},
        own_actions());
    if (!shape_.hosts_all()) {
      add_signals_for_others();
      return;
    }
    add({.name = "nash_error",
         .description = "Distance from the Nash equilibrium: 2-norm of x - x_star",
         .causality = Causality::output,
         .declared_type = "Action",
         .unit = {"1", "1"},
         .stage = Stage::equilibrium,
         .read = [](const View& view,
                    int) { return nash_error(view.plants.x, view.x_star, view.loop->shape().actions()); },
         .read_along =
             [](const View& view, const Tangent& tangent, int) {
               return nash_error_along(view.plants.x, view.x_star, tangent.actions, tangent.x_star,
                                       view.loop->shape().actions());
             }},
        one());
    add({.name = "x_star",
         .description = "Nash equilibrium",
         .causality = Causality::calculated_parameter,
         .variability = Variability::tunable,
         .declared_type = "Action",
         .unit = {"1", "1"},
         .stage = Stage::equilibrium,
         .read = [](const View& view, int slot) { return view.x_star[slot]; },
         .read_along = [](const View&, const Tangent& tangent, int slot) { return tangent.x_star[slot]; }},
        actions());
  }

  /// What other loops hear of the hosted players.
  void add_signals_for_others() {
    add({.name = "xbar",
         .description = "Signal shared with neighbours: z (order 1) or x (order 2)",
         .causality = Causality::output,
         .declared_type = "Action",
         .unit = {"1", "1"},
         .stage = Stage::state,
         .read =
             [](const View& view, int slot) {
               const Shape& shape = view.loop->shape();
               return (shape.is_second_order(shape.player_of(slot)) ? view.plants.x : view.plants.reference)[slot];
             },
         .read_along = [](const View&, const Tangent& tangent, int slot) { return tangent.shared[slot]; }},
        actions());
    add_estimates(Causality::output);
  }
  void add_estimates(Causality causality) {
    add({.name = "y",
         .description = "Estimate by player i of the action of player j",
         .causality = causality,
         .declared_type = "Action",
         .unit = {"1", "1"},
         .nominal = 1.0,
         .stage = Stage::state,
         .is_state = true,
         .read_along = read_state_along},
        estimates(layout_.estimates(), hosted()));
    y_ = last_family();
  }

  void add_inside_of_the_loop() {
    const std::vector<Real>& W_max = game_.parameters.rbf.W_max;
    const Real W_nominal = std::sqrt(*std::max_element(W_max.begin(), W_max.end()));
    add({.name = "z",
         .description = "Reference of a player of order 1",
         .declared_type = "Action",
         .unit = {"1", "1"},
         .nominal = 1.0,
         .stage = Stage::state,
         .is_state = true,
         .read_along = read_state_along},
        states_reference(1));
    const int z = last_family();
    int W = -1;
    if (everything()) {
      if (shape_.hosts_all()) add_estimates(Causality::local);
      add({.name = "W",
           .description = "Network weight of player i, neuron m, coordinate l",
           .declared_type = "Weight",
           .unit = drive,
           .nominal = W_nominal,
           .stage = Stage::state,
           .is_state = true,
           .read_along = read_state_along},
          weights());
      W = last_family();
    }
    add({.name = "W_norm2",
         .description = "Squared norm of a weight column, at most W_max",
         .unit = {"1/s2", "1/s4"},
         .stage = Stage::state,
         .read =
             [](const View& view, int slot) {
               Real squares = 0.0;
               for (int m = 0; m < view.loop->shape().neurons; ++m) {
                 const Real w = view.state[view.loop->layout().weights_of(m) + slot];
                 squares += w * w;
               }
               return squares;
             }},
        own_actions());
    add({.name = "phi",
         .description = "Robust term of the control",
         .declared_type = "Drive",
         .unit = drive,
         .stage = Stage::signals,
         .signal = &Signals::robust},
        own_actions());
    add({.name = "nn",
         .description = "Output of the neural network",
         .declared_type = "Drive",
         .unit = drive,
         .stage = Stage::signals,
         .signal = &Signals::network},
        own_actions());
    if (shape_.hosts_all()) add_measures();
    if (everything()) {
      add_derivatives(x_, {"1/s", "1/s"});
      add_derivatives(v_, {"1/s2", "1/s2"});
      add_derivatives(z, {"1/s", "1/s"});
      add_derivatives(y_, {"1/s", "1/s"});
      add_derivatives(W, {"1/s2", "1/s3"});
    }
  }

  void add_measures() {
    add({.name = "cost",
         .description = "Cost f_i(x)",
         .stage = Stage::state,
         .read = [](const View& view, int i) { return view.loop->parameters().cost->value(i, view.plants.x); }},
        players());
    add({.name = "consensus_error",
         .description = "2-norm of all errors of the estimates",
         .declared_type = "Action",
         .unit = {"1", "1"},
         .stage = Stage::signals,
         .read = [](const View& view, int) { return consensus_error(*view.loop, view.state, *view.signals); }},
        one());
    add({.name = "gradient_norm",
         .description = "2-norm of the own-action gradients at x",
         .stage = Stage::state,
         .read = [](const View& view, int) { return gradient_norm(*view.loop, view.plants.x); }},
        one());
  }

  void add_derivatives(int states, std::array<const char*, 2> unit) {
    const Family& family = table_.families_[at(states)];
    Elements elements;
    for (int k = family.first; k < family.first + family.count; ++k) {
      elements.push_back({table_.variables_[at(k)].slot, table_.variables_[at(k)].index});
    }
    add({.name = "der(" + family.name,
         .description = "Time derivative of " + family.name,
         .unit = unit,
         .stage = Stage::signals,
         .derivative_of = states,
         .read = [](const View& view, int slot) { return view.rate[slot]; },
         .read_along = [](const View&, const Tangent& tangent, int slot) { return tangent.rate[slot]; }},
        elements);
  }

  /// Of the run up to here, between the integrator's steps too.
  void add_judgement() {
    const auto add_value = [&](Family family, auto read) {
      family.stage = Stage::judgement;
      family.read = [read](const View& view, int) { return static_cast<Real>(std::invoke(read, *view.judgement)); };
      add(std::move(family), one());
    };
    if (shape_.hosts_all()) {
      add_value({.name = "settling_time",
                 .description = "Time from the start until nash_error last exceeded the settling band; until now while "
                                "it does",
                 .declared_type = "Time",
                 .unit = {"s", "s"}},
                &Judgement::settling_time);
      add_value({.name = "settled",
                 .description = "nash_error is within the settling band",
                 .type = Type::boolean,
                 .variability = Variability::discrete},
                [](const Judgement& judgement) { return !judgement.outside; });
    }
    add_value({.name = "control_energy", .description = "Integral of u'u since the start"}, &Judgement::control_energy);
    add_value({.name = "control_peak", .description = "Largest magnitude of an entry of u since the start"},
              &Judgement::control_peak);
    if (!shape_.hosts_all()) return;
    add_value({.name = "error_peak",
               .description = "Largest magnitude of an entry of x - x_star since judge_from; 0 before it",
               .declared_type = "Action",
               .unit = {"1", "1"}},
              &Judgement::error_peak);
    add_value({.name = "overshoot",
               .description = "Farthest that an entry of x went beyond x_star, seen from its start, as a part of the "
                              "largest initial magnitude of an entry of x - x_star",
               .unit = {"1", "1"}},
              &Judgement::overshoot);
  }

  void add_solver() {
    const auto add_count = [&](const char* name, const char* description, auto read) {
      add({.name = name,
           .description = description,
           .type = Type::integer,
           .variability = Variability::discrete,
           .declared_type = "Count",
           .range = Range::non_negative,
           .stage = Stage::statistics,
           .read = read},
          one());
    };
    add_count("solver_steps", "Steps taken by the integrator", read_count<&Statistics::steps>);
    add_count("solver_rhs_evaluations", "Evaluations of the right-hand side",
              read_count<&Statistics::rate_evaluations>);
    add_count("solver_events", "Weight columns that entered or left the sphere, and conditions that changed",
              read_count<&Statistics::events>);
    add({.name = "order",
         .description = "Order of player i: 1 velocity-driven, 2 acceleration-driven",
         .type = Type::integer,
         .variability = Variability::constant,
         .initial = Initial::exact,
         .declared_type = "Order",
         .stage = Stage::settings,
         .read = [](const View& view,
                    int i) { return static_cast<Real>(view.settings->parameters.shape.order[at(i)]); }},
        players());
  }

  static constexpr std::array<const char*, 2> drive{"1/s", "1/s2"};

  ModelVariables& table_;
  const Game& game_;
  const Shape& shape_;
  StateLayout layout_;
  InputLayout inputs_;
  int x_ = -1;
  int v_ = -1;
  int y_ = -1;
};

ModelVariables::ModelVariables(const Game& game) : order_(game.parameters.shape.order) {
  Builder(*this, game).add_all();
  for (const bool only_judges : {false, true}) {
    for (int reference = 0; reference < size(); ++reference) {
      const Family& of = family(reference);
      if (of.causality == Causality::parameter && of.only_judges == only_judges) settable_.push_back(reference);
    }
    if (!only_judges) acting_parameters_ = settable_.size();
  }
  if (game.expose == Expose::all) {
    states_.resize(at(StateLayout(game.parameters.shape).size()));
    for (int reference = 0; reference < size(); ++reference) {
      if (family(reference).is_state) states_[at(variable(reference).slot)] = reference;
    }
  }
  input_numbers_ = Settings(game).inputs.numbers().size();
}

std::string ModelVariables::name(int reference) const {
  const Family& of = family(reference);
  std::string text = of.name;
  const auto& index = variable(reference).index;
  for (std::size_t k = 0; k < index.size() && index[k] != 0; ++k) {
    text += k == 0 ? '[' : ',';
    text += std::to_string(index[k]);
  }
  if (index[0] != 0) text += ']';
  if (of.derivative_of >= 0) text += ')';
  return text;
}

const char* ModelVariables::unit(int reference) const {
  if (!family(reference).declared_unit.empty()) return family(reference).declared_unit.c_str();
  const int player = family(reference).is_named ? 0 : variable(reference).index[0];
  return family(reference).unit[player > 0 && at(player) <= order_.size() && order_[at(player - 1)] == 2 ? 1 : 0];
}

const Family* ModelVariables::find(std::string_view name) const {
  const auto found =
      std::find_if(families_.begin(), families_.end(), [&](const Family& family) { return family.name == name; });
  return found == families_.end() ? nullptr : &*found;
}

std::optional<int> ModelVariables::find(std::string_view name, int slot) const {
  const Family* found = find(name);
  if (found == nullptr) return std::nullopt;
  for (int reference = found->first; reference < found->first + found->count; ++reference) {
    if (variable(reference).slot == slot) return reference;
  }
  return std::nullopt;
}

std::vector<Real> ModelVariables::save(const Settings& settings) const {
  View view;
  view.settings = &settings;
  std::vector<Real> numbers;
  numbers.reserve(saved_size());
  for (const int reference : settable_) numbers.push_back(read(reference, view));
  const std::span<const Real> input = settings.inputs.numbers();
  numbers.insert(numbers.end(), input.begin(), input.end());
  return numbers;
}

void ModelVariables::load(std::span<const Real> numbers, Settings& settings) const {
  for (std::size_t k = 0; k < settable_.size(); ++k) {
    family(settable_[k]).write(settings, variable(settable_[k]).slot, numbers[k]);
  }
  settings.inputs.set_numbers(numbers.subspan(settable_.size()));
  settings.parameters.refresh();
}

void ModelVariables::require_settable(std::span<const Real> numbers) const {
  for (std::size_t k = 0; k < settable_.size(); ++k) {
    const Range& range = family(settable_[k]).range;
    if (range.contains(numbers[k])) continue;
    throw Error("the saved " + name(settable_[k]) + " is " + text_of(numbers[k]) + ", expected " + range.expectation());
  }
}

}  // namespace mixed_order_game
