// Sequences of FMI calls, legal and illegal, with hostile values, decoded from libFuzzer's bytes.
//
// Promised: no crash, leak or hang; only fmi2OK, fmi2Error and, in model exchange, fmi2Discard; nothing that is not
// finite under fmi2OK; a refused call tells why and changes nothing; fmi2Reset leads back to a fresh instance, bit for
// bit.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

#include "call_code.hpp"
#include "fuzzed_game.hpp"
#include "loop/located_conditions.hpp"

using namespace mixed_order_game;

namespace {

constexpr std::size_t most_calls = 60;

class Bytes {
 public:
  explicit Bytes(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  [[nodiscard]] bool empty() const { return bytes_.empty(); }
  std::uint8_t byte() {
    if (bytes_.empty()) return 0;
    const std::uint8_t value = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return value;
  }
  std::size_t below(std::size_t bound) {
    const std::size_t low = byte();
    return (low + 256U * byte()) % bound;
  }

  /// Ordinary, hostile, or any bits.
  double real() {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    constexpr std::array values{0.0,
                                1.0,
                                -1.0,
                                0.5,
                                2.0,
                                10.0,
                                -0.0,
                                1e-3,
                                1e3,
                                1e-9,
                                1e9,
                                1e-6,
                                0.1,
                                -1e3,
                                1e15,
                                1e300,
                                1e-300,
                                -1e300,
                                5e-324,
                                infinity,
                                -infinity,
                                0.25,
                                50.0,
                                1e6,
                                std::numeric_limits<double>::quiet_NaN(),
                                std::numeric_limits<double>::max()};
    const std::uint8_t choice = byte();
    if (choice < values.size()) return values[choice];
    if (choice < 250) return (choice - 128.0) / 16.0;
    std::uint64_t bits = 0;
    for (int k = 0; k < 8; ++k) bits = bits << 8 | byte();
    double value = 0.0;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }

 private:
  std::span<const std::uint8_t> bytes_;
};

class Session {
 public:
  Session(const FuzzedGame& game, fmi2Type type, Bytes& bytes) : instance_(game, type), type_(type), bytes_(bytes) {}

  [[nodiscard]] bool exists() const { return instance_.component != nullptr; }

  void call() {
    const auto code = static_cast<CallCode>(bytes_.below(static_cast<std::size_t>(CallCode::count)));
    if (!state_is_known_) state_ = instance_.bytes();
    const long messages = instance_.messages;
    const fmi2Status status = perform(code);
    const bool discards = status == fmi2Discard && type_ == fmi2ModelExchange;
    require(status == fmi2OK || status == fmi2Error || discards, "calls return fmi2OK or fmi2Error");
    state_is_known_ = status != fmi2OK;
    if (status == fmi2OK) return;
    require(discards || instance_.messages > messages, "a refused call tells why");
    auto after = instance_.bytes();
    const bool integrates = code == CallCode::do_step || code == CallCode::set_state;
    require(!state_ || after || integrates, "only a failed integration leads to the error state");
    require(!state_ || !after || *state_ == *after, "a refused call changes nothing");
    state_ = std::move(after);
  }

  void end() {
    (void)instance_.values();
    require(fmi2Reset(c()) == fmi2OK, "every instance can be reset");
    static std::map<std::pair<const FuzzedGame*, fmi2Type>, std::vector<double>> fresh;
    auto& expected = fresh[{&instance_.game, type_}];
    if (expected.empty()) expected = FuzzedInstance(instance_.game, type_).values();
    require(same(instance_.values(), expected), "reset leads back to a fresh instance");
  }

 private:
  [[nodiscard]] fmi2Component c() const { return instance_.component; }

  std::vector<fmi2ValueReference> references(Type type) {
    std::vector<fmi2ValueReference> chosen(bytes_.below(4));
    const auto& known = instance_.game.of_type[static_cast<int>(type)];
    for (auto& reference : chosen) {
      const std::size_t k = bytes_.below(known.size() + 4);
      reference = k < known.size() ? known[k] : static_cast<fmi2ValueReference>(bytes_.below(65536));
    }
    return chosen;
  }
  std::vector<double> reals(std::size_t count) {
    std::vector<double> values(count);
    for (double& value : values) value = bytes_.real();
    return values;
  }
  std::vector<int> integers(std::size_t count) {
    std::vector<int> values(count);
    for (int& value : values) value = static_cast<int>(bytes_.below(6)) - 1;
    return values;
  }
  double time() {
    double t = 0.0;
    (void)fmi2GetRealStatus(c(), fmi2LastSuccessfulTime, &t);
    return bytes_.byte() < 16 ? bytes_.real() : t;
  }
  /// Of vectors whose length the importer knows; now and then another.
  std::size_t length(std::size_t right) { return bytes_.byte() < 16 ? bytes_.below(right + 3) : right; }
  [[nodiscard]] std::size_t states() const { return instance_.game.model.variables.states().size(); }
  static fmi2Status finite(fmi2Status status, const std::vector<double>& values) {
    require(status != fmi2OK || std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); }),
            "what is given under fmi2OK is finite");
    return status;
  }
  fmi2FMUstate& handle() { return handles_[bytes_.below(handles_.size())]; }

  fmi2Status perform(CallCode code) {
    switch (code) {
      case CallCode::set_debug_logging: {
        const std::array<fmi2String, 3> categories{"logAll", "logEvents", "other"};
        return fmi2SetDebugLogging(c(), bytes_.byte() % 2, bytes_.below(4), categories.data());
      }
      case CallCode::setup_experiment:
        return fmi2SetupExperiment(c(), bytes_.byte() % 2, bytes_.real(), bytes_.real(), bytes_.byte() % 2,
                                   bytes_.real());
      case CallCode::enter_initialization:
        return fmi2EnterInitializationMode(c());
      case CallCode::exit_initialization:
        return fmi2ExitInitializationMode(c());
      case CallCode::terminate:
        return fmi2Terminate(c());
      case CallCode::reset:
        return fmi2Reset(c());
      case CallCode::get_real: {
        const auto vr = references(Type::real);
        std::vector<double> values(vr.size());
        return finite(fmi2GetReal(c(), vr.data(), vr.size(), values.data()), values);
      }
      case CallCode::get_integer: {
        const auto vr = references(Type::integer);
        std::vector<int> values(vr.size());
        return fmi2GetInteger(c(), vr.data(), vr.size(), values.data());
      }
      case CallCode::get_boolean: {
        const auto vr = references(Type::boolean);
        std::vector<int> values(vr.size());
        return fmi2GetBoolean(c(), vr.data(), vr.size(), values.data());
      }
      case CallCode::get_string: {
        const std::size_t count = bytes_.below(2);
        std::vector<fmi2ValueReference> vr(count);
        std::vector<fmi2String> values(count);
        return fmi2GetString(c(), vr.data(), count, values.data());
      }
      case CallCode::set_real: {
        const auto vr = references(Type::real);
        return fmi2SetReal(c(), vr.data(), vr.size(), reals(vr.size()).data());
      }
      case CallCode::set_integer: {
        const auto vr = references(Type::integer);
        return fmi2SetInteger(c(), vr.data(), vr.size(), integers(vr.size()).data());
      }
      case CallCode::set_boolean: {
        const auto vr = references(Type::boolean);
        return fmi2SetBoolean(c(), vr.data(), vr.size(), integers(vr.size()).data());
      }
      case CallCode::get_state:
        return fmi2GetFMUstate(c(), &handle());
      case CallCode::set_state:
        return fmi2SetFMUstate(c(), handle());
      case CallCode::free_state:
        return fmi2FreeFMUstate(c(), &handle());
      case CallCode::serialize: {
        std::size_t size = 0;
        const fmi2FMUstate from = handle();
        const fmi2Status status = fmi2SerializedFMUstateSize(c(), from, &size);
        if (status != fmi2OK) return status;
        serialized_.resize(length(size));
        return fmi2SerializeFMUstate(c(), from, serialized_.data(), serialized_.size());
      }
      case CallCode::deserialize:
        return fmi2DeSerializeFMUstate(c(), serialized_.data(), serialized_.size(), &handle());
      case CallCode::directional_derivative: {
        const auto unknown = references(Type::real);
        const auto known = references(Type::real);
        const auto direction = reals(known.size());
        std::vector<double> values(unknown.size());
        return finite(fmi2GetDirectionalDerivative(c(), unknown.data(), unknown.size(), known.data(), known.size(),
                                                   direction.data(), values.data()),
                      values);
      }
      case CallCode::set_input_derivatives: {
        const auto vr = references(Type::real);
        const auto orders = integers(vr.size());
        return fmi2SetRealInputDerivatives(c(), vr.data(), vr.size(), orders.data(), reals(vr.size()).data());
      }
      case CallCode::get_output_derivatives: {
        const auto vr = references(Type::real);
        const auto orders = integers(vr.size());
        std::vector<double> values(vr.size());
        return finite(fmi2GetRealOutputDerivatives(c(), vr.data(), vr.size(), orders.data(), values.data()), values);
      }
      case CallCode::do_step: {
        constexpr std::array<double, 8> steps{1e-3, 0.01, 0.05, 0.1, 1e-9, 0.02, 1e-4, 0.3};
        const double t = time();
        const std::uint8_t choice = bytes_.byte();
        return fmi2DoStep(c(), t, choice < 248 ? steps[choice % steps.size()] : bytes_.real(), bytes_.byte() % 2);
      }
      case CallCode::cancel_step:
        return fmi2CancelStep(c());
      case CallCode::get_status: {
        fmi2Status value = fmi2OK;
        return fmi2GetStatus(c(), static_cast<fmi2StatusKind>(bytes_.below(4)), &value);
      }
      case CallCode::get_real_status: {
        std::vector<double> value(1);
        return finite(fmi2GetRealStatus(c(), static_cast<fmi2StatusKind>(bytes_.below(4)), value.data()), value);
      }
      case CallCode::get_boolean_status: {
        fmi2Boolean value = fmi2False;
        return fmi2GetBooleanStatus(c(), static_cast<fmi2StatusKind>(bytes_.below(4)), &value);
      }
      case CallCode::get_integer_status: {
        fmi2Integer value = 0;
        return fmi2GetIntegerStatus(c(), static_cast<fmi2StatusKind>(bytes_.below(4)), &value);
      }
      case CallCode::get_string_status: {
        fmi2String value = nullptr;
        return fmi2GetStringStatus(c(), static_cast<fmi2StatusKind>(bytes_.below(4)), &value);
      }
      case CallCode::enter_event_mode:
        return fmi2EnterEventMode(c());
      case CallCode::new_discrete_states: {
        fmi2EventInfo info{};
        return fmi2NewDiscreteStates(c(), bytes_.byte() == 0 ? nullptr : &info);
      }
      case CallCode::enter_continuous_time_mode:
        return fmi2EnterContinuousTimeMode(c());
      case CallCode::completed_integrator_step: {
        fmi2Boolean enter = fmi2False;
        fmi2Boolean end = fmi2False;
        return fmi2CompletedIntegratorStep(c(), bytes_.byte() % 2, &enter, &end);
      }
      case CallCode::set_time:
        return fmi2SetTime(c(), bytes_.real());
      case CallCode::set_continuous_states: {
        std::vector<double> x(length(states()));
        (void)fmi2GetContinuousStates(c(), x.data(), x.size());
        for (std::size_t k = bytes_.below(4); k > 0 && !x.empty(); --k) x[bytes_.below(x.size())] = bytes_.real();
        return fmi2SetContinuousStates(c(), x.data(), x.size());
      }
      case CallCode::get_derivatives: {
        std::vector<double> values(length(states()));
        return finite(fmi2GetDerivatives(c(), values.data(), values.size()), values);
      }
      case CallCode::get_event_indicators: {
        std::vector<double> values(length(at(LocatedConditions::located(instance_.game.model.game.parameters))));
        return finite(fmi2GetEventIndicators(c(), values.data(), values.size()), values);
      }
      case CallCode::get_continuous_states: {
        std::vector<double> values(length(states()));
        return finite(fmi2GetContinuousStates(c(), values.data(), values.size()), values);
      }
      case CallCode::get_nominals: {
        std::vector<double> values(length(states()));
        return finite(fmi2GetNominalsOfContinuousStates(c(), values.data(), values.size()), values);
      }
      case CallCode::count:
        break;
    }
    return fmi2OK;
  }

  FuzzedInstance instance_;
  fmi2Type type_;
  Bytes& bytes_;
  std::array<fmi2FMUstate, 3> handles_{};
  std::optional<std::vector<char>> state_;  // before the next call
  bool state_is_known_ = false;
  std::vector<char> serialized_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes({data, size});
  const FuzzedGame& game = fuzzed_games()[bytes.byte() % fuzzed_games().size()];
  const fmi2Type type = bytes.byte() % 2 == 0 ? fmi2CoSimulation : fmi2ModelExchange;
  Session session(game, type, bytes);
  if (!session.exists()) {
    require(type == fmi2ModelExchange, "the game can be instantiated for co-simulation");
    return 0;
  }
  for (std::size_t k = 0; k < most_calls && !bytes.empty(); ++k) session.call();
  session.end();
  return 0;
}
