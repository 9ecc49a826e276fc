// THE table of the FMU's variables: each is registered once, and that drives reading, setting, modelDescription.xml
// and the serialized state alike.
//
// Variables come in families, as x[i,l]. A value reference is a variable's position in the table.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "number_text.hpp"
#include "settings.hpp"

namespace mixed_order_game {

enum class Type : std::uint8_t { real, integer, boolean };
enum class Causality : std::uint8_t { parameter, calculated_parameter, input, output, local, independent };
enum class Variability : std::uint8_t { constant, fixed, tunable, discrete, continuous };
enum class Initial : std::uint8_t { none, exact, calculated };

/// Which values may be set: finite ones within these bounds.
struct Range {
  enum class Kind : std::uint8_t { any, non_negative, positive, tolerance, bounds };

  Kind kind = Kind::bounds;
  std::optional<Real> smallest = std::nullopt;
  std::optional<Real> largest = std::nullopt;
  std::string_view words = {};  ///< as in "a positive finite number"; empty: made of the bounds

  [[nodiscard]] bool contains(Real value) const;
  [[nodiscard]] std::string expectation() const;

  static const Range any;
  static const Range non_negative;
  static const Range positive;
  static const Range tolerance;
};
inline const Range Range::any{.kind = Kind::any, .words = "a finite number"};
inline const Range Range::non_negative{
    .kind = Kind::non_negative, .smallest = 0.0, .words = "a finite number of at least 0"};
inline const Range Range::positive{
    .kind = Kind::positive, .smallest = std::numeric_limits<Real>::min(), .words = "a positive finite number"};
inline const Range Range::tolerance{.kind = Kind::tolerance,
                                    .smallest = 0.0,
                                    .largest = 0.1,
                                    .words = "0 (not set) or a positive number of at most 0.1"};

/// Declared types of modelDescription.xml.
struct SimpleType {
  const char* name;
  Type type;
  const char* unit;  ///< null when it depends on the player's order or has none
  const char* description;
  std::optional<int> min = std::nullopt;
  std::optional<int> max = std::nullopt;
};
std::span<const SimpleType> simple_types();

/// Units of modelDescription.xml, as powers of the base units.
struct Unit {
  const char* name;
  int seconds;
  int radians;
};
std::span<const Unit> units();

/// Variables of one kind. Two families may share a name: actions of plants inside the loop are outputs, those of plants
/// outside are inputs.
struct Family {
  std::string name;
  std::string description;
  Type type = Type::real;
  Causality causality = Causality::local;
  Variability variability = Variability::continuous;
  Initial initial = Initial::calculated;
  std::string declared_unit = {};  ///< of a named parameter, in place of unit
  const char* declared_type = nullptr;
  std::array<const char*, 2> unit{};  ///< for players of order 1 and of order 2; null: none
  Range range = Range::any;
  Real nominal = 0.0;  ///< 0: not stated
  Stage stage = Stage::settings;
  bool moves_equilibrium = false;
  bool only_judges = false;  ///< how a run is judged; the run does not depend on it
  int derivative_of = -1;    ///< family of states of which this one holds the derivatives, element by element
  bool is_state = false;     ///< slots are positions in the state vector, as those of derivatives

  AlignedVector Signals::* signal = nullptr;  ///< the vector of signals that holds the elements at their slots

  /// Value of the element at a slot, of other families than states and signals; Integer and Boolean values are exact
  /// in a Real.
  std::function<Real(const View& view, int slot)> read = nullptr;
  /// Empty when it cannot be set.
  std::function<void(Settings& settings, int slot, Real value)> write = nullptr;

  /// Change of the element at a slot along a tangent; empty unless the equations of the model determine it.
  std::function<Real(const View& view, const Tangent& tangent, int slot)> read_along = nullptr;

  bool is_named = false;  ///< named parameters: slots count their values
  int game_family = -1;   ///< of coefficients: which of Parameters::families() declares it
  int coefficient = -1;   ///< and its number there

  int first = 0;  ///< value references first .. first + count - 1
  int count = 0;
};

struct Variable {
  int family = 0;
  int slot = 0;                ///< position in an array of the core: of inputs, in that of InputLayout
  std::array<int, 3> index{};  ///< public indices, from one; 0 where there is none
  // the family's, side by side for the calls that importers make after every step
  Type type = Type::real;
  Stage stage = Stage::settings;
  int state = -1;  ///< position in the state vector
  AlignedVector Signals::* signal = nullptr;
};

class ModelVariables {
 public:
  explicit ModelVariables(const Game& game);

  [[nodiscard]] int size() const { return static_cast<int>(variables_.size()); }
  [[nodiscard]] const std::vector<Family>& families() const { return families_; }
  [[nodiscard]] const Variable& variable(int reference) const { return variables_[at(reference)]; }
  [[nodiscard]] const Family& family(int reference) const { return families_[at(variable(reference).family)]; }
  [[nodiscard]] std::string name(int reference) const;
  /// Null when there is none.
  [[nodiscard]] const char* unit(int reference) const;
  [[nodiscard]] const Family* find(std::string_view family) const;
  /// Value reference of an element by its slot, when it is a variable.
  [[nodiscard]] std::optional<int> find(std::string_view family, int slot) const;

  /// Value references of the states in the order of the state vector; empty unless all of them are variables.
  [[nodiscard]] const std::vector<int>& states() const { return states_; }

  [[nodiscard]] Real read(int reference, const View& view) const {
    const Variable& one = variable(reference);
    if (one.state >= 0) return view.state[one.state];
    if (one.signal != nullptr) return (view.signals->*one.signal)[at(one.slot)];
    return families_[at(one.family)].read(view, one.slot);
  }

  /// All settings as numbers: parameters in the order of the table, those that only judge, the input polynomials.
  [[nodiscard]] std::vector<Real> save(const Settings& settings) const;
  void load(std::span<const Real> numbers, Settings& settings) const;
  /// Refuses saved numbers that could not have been set.
  void require_settable(std::span<const Real> numbers) const;
  [[nodiscard]] std::size_t saved_size() const { return settable_.size() + input_numbers_; }
  /// How many of the saved numbers come first and are parameters on which runs depend, and how many come last and are
  /// input polynomials.
  [[nodiscard]] std::size_t saved_parameters() const { return acting_parameters_; }
  [[nodiscard]] std::size_t saved_inputs() const { return input_numbers_; }

 private:
  class Builder;

  std::vector<Family> families_;
  std::vector<Variable> variables_;
  std::vector<int> settable_;  // parameters that can be set
  std::vector<int> states_;
  std::size_t acting_parameters_ = 0;
  std::size_t input_numbers_ = 0;
  std::vector<int> order_;  // of the players
};

}  // namespace mixed_order_game
