#include "slave.hpp"

#include <bit>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace fs = std::filesystem;
using namespace mixed_order_game;

namespace {

constexpr const char* small = R"(title = "Three players in the plane"
dimension = 2

[gains]
k1 = 6.0
k2 = 0.9
k3 = 20.0
k4 = 15.0
beta = 30.0
delta = 1.5
epsilon = 0.05

[rbf]
centers = [-1.6, -0.7, 0.1, 0.9, 1.8]
width = 3.0
W_max = 0.5

[graph]
edges = [[1, 2, 1.3], [2, 3]]

[[player]]
name = "first"
order = 1
x0 = [0.8, -1.1]
z0 = [0.3, 0.2]
y0 = [[0.1, -0.2], [0.4, 0.3], [-0.5, 0.6]]
cost = { quadratic = 1.2, linear = [0.4, -0.7], constant = 0.3, coupling = [[2, 0.5]] }
dynamics = { linear = [[1, [0.5, -0.4]], [3, [0.2, 0.3]]], square = [[2, [0.05, 0.04]]] }
disturbance = { amplitude = [0.9, 1.1], frequency = [2.0, 3.0], phase = [0.1, -0.4], bias = [0.2, -0.3] }

[[player]]
name = "second"
order = 2
x0 = [-0.6, 1.4]
v0 = [0.25, -0.35]
y0 = [[0.7, 0.1], [-0.3, 0.8], [0.2, -0.9]]
cost = { quadratic = 1.7, linear = [-0.6, 0.9], constant = -0.2, coupling = [[1, 0.3], [3, 0.6]] }
dynamics = { linear = [[2, [0.6, 0.7]]], square = [[2, [-0.03, 0.02]]] }
disturbance = { amplitude = [1.4, 0.8], frequency = [1.5, 2.5], phase = [0.6, 0.2], bias = [-0.1, 0.15] }

[[player]]
name = "third"
order = 1
x0 = [1.5, 0.45]
z0 = [-0.2, 0.55]
cost = { quadratic = 2.1, linear = [0.8, 0.35], constant = 0.1, coupling = [[2, 0.2]] }
dynamics = { linear = [[3, [-0.3, 0.8]]] }
disturbance = { amplitude = [1.2, 0.7], frequency = [2.2, 1.8] }
)";

constexpr const char* vectors = R"(title = "Two players on a line"
dimension = 1
[gains]
k1 = 5.0
k2 = 1.1
k3 = 12.0
k4 = 9.0
beta = 14.0
delta = 0.8
epsilon = 0.1
[rbf]
centers = [[-1.0, 0.5], [0.2, 0.3], [0.9, -0.6], [1.1, 1.2]]
width = 2.0
W_max = 0.4
[graph]
edges = [[1, 2]]
[[player]]
name = "left"
order = 2
x0 = 1.0
cost = { quadratic = 1.0, linear = 0.5, coupling = [[2, 0.4]] }
disturbance = { amplitude = 0.9, frequency = 2.0 }
[[player]]
name = "right"
order = 2
x0 = -1.0
v0 = 0.3
cost = { quadratic = 1.5, linear = -0.4 }
disturbance = { amplitude = 0.7, frequency = 1.0, phase = 0.5 }
)";

std::string element_name(const ModelVariables& variables, int reference) { return variables.name(reference); }

fs::path make_scratch_folder() {
  std::string pattern = (fs::temp_directory_path() / "fmu_tests_XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make a folder for tests");
  return pattern;
}

struct ScratchFolder {
  fs::path path = make_scratch_folder();
  int made = 0;
  std::map<std::string, std::string> of_game;
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
};

}  // namespace

std::string small_game() { return small; }

std::string small_game_with(const std::map<std::string, std::string>& replacements) {
  std::string game = small;
  for (const auto& [from, to] : replacements) {
    const std::size_t found = game.find(from);
    if (found == std::string::npos || game.find(from, found + 1) != std::string::npos) {
      throw std::logic_error("not found exactly once: " + from);
    }
    game.replace(found, from.size(), to);
  }
  return game;
}

std::string small_game_under(const std::string& strategy) {
  std::string lines = "dimension = 2\n[strategy]\n";
  lines += strategy;
  lines += '\n';
  return small_game_with({{"dimension = 2\n", lines}});
}

std::string vector_centers_game() { return vectors; }

std::string five_vehicles() {
  std::ifstream file(MIXED_ORDER_GAME_SOURCE_DIR "/modelDescription/games/five_vehicles.toml");
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string resources_of(const std::string& game, const std::string& folder_name) {
  static ScratchFolder scratch;
  std::string& folder = scratch.of_game[game + '\n' + folder_name];
  if (folder.empty()) {
    const fs::path path = scratch.path / std::to_string(++scratch.made) / folder_name;
    fs::create_directories(path);
    std::ofstream(path / "game.toml", std::ios::binary) << game;
    folder = path.string();
  }
  return folder;
}

std::string indices(int i, int l) {
  std::string text = "[";
  text += std::to_string(i);
  text += ',';
  text += std::to_string(l);
  text += ']';
  return text;
}

void record(fmi2ComponentEnvironment log, fmi2String instance, fmi2Status status, fmi2String category,
            fmi2String message, ...) {
  static_cast<std::vector<LogEntry>*>(log)->push_back({instance, status, category, message});
}

Slave::Slave(const std::string& game, bool logging, fmi2Type type) : model_(game) {
  callbacks_.logger = record;
  callbacks_.componentEnvironment = &log;
  for (int k = 0; k < model_.variables.size(); ++k) {
    references_[element_name(model_.variables, k)] = static_cast<fmi2ValueReference>(k);
  }
  component = fmi2Instantiate("slave", type, model_.guid.c_str(), ("file://" + resources_of(game)).c_str(), &callbacks_,
                              fmi2False, logging ? fmi2True : fmi2False);
  if (component == nullptr) throw std::runtime_error("not instantiated: " + last_message());
}

Slave::~Slave() { fmi2FreeInstance(component); }

fmi2ValueReference Slave::reference(const std::string& name) const {
  const auto found = references_.find(name);
  if (found == references_.end()) throw std::logic_error("no variable " + name);
  return found->second;
}

double Slave::get(const std::string& name) {
  const fmi2ValueReference vr = reference(name);
  double value = 0.0;
  EXPECT_EQ(fmi2GetReal(component, &vr, 1, &value), fmi2OK) << name << ": " << last_message();
  return value;
}

bool Slave::get_boolean(const std::string& name) {
  const fmi2ValueReference vr = reference(name);
  fmi2Boolean value = 0;
  EXPECT_EQ(fmi2GetBoolean(component, &vr, 1, &value), fmi2OK) << name << ": " << last_message();
  return value != fmi2False;
}

int Slave::get_integer(const std::string& name) {
  const fmi2ValueReference vr = reference(name);
  fmi2Integer value = 0;
  EXPECT_EQ(fmi2GetInteger(component, &vr, 1, &value), fmi2OK) << name << ": " << last_message();
  return value;
}

fmi2Status Slave::set(const std::string& name, double value) {
  const fmi2ValueReference vr = reference(name);
  return fmi2SetReal(component, &vr, 1, &value);
}

fmi2Status Slave::set_boolean(const std::string& name, bool value) {
  const fmi2ValueReference vr = reference(name);
  const fmi2Boolean number = value ? fmi2True : fmi2False;
  return fmi2SetBoolean(component, &vr, 1, &number);
}

fmi2Status Slave::set_derivative(const std::string& name, int order, double value) {
  const fmi2ValueReference vr = reference(name);
  return fmi2SetRealInputDerivatives(component, &vr, 1, &order, &value);
}

double Slave::output_derivative(const std::string& name) {
  const fmi2ValueReference vr = reference(name);
  const fmi2Integer order = 1;
  double value = 0.0;
  EXPECT_EQ(fmi2GetRealOutputDerivatives(component, &vr, 1, &order, &value), fmi2OK) << last_message();
  return value;
}

void Slave::initialize(double start, std::optional<double> tolerance, std::optional<double> stop) {
  ASSERT_EQ(fmi2SetupExperiment(component, tolerance.has_value(), tolerance.value_or(0.0), start, stop.has_value(),
                                stop.value_or(0.0)),
            fmi2OK)
      << last_message();
  ASSERT_EQ(fmi2EnterInitializationMode(component), fmi2OK) << last_message();
  ASSERT_EQ(fmi2ExitInitializationMode(component), fmi2OK) << last_message();
}

void Slave::run(double t, double t_end, int steps) {
  const double h = (t_end - t) / steps;
  for (int k = 0; k < steps; ++k) ASSERT_EQ(step(t + k * h, h), fmi2OK) << last_message();
}

std::vector<double> Slave::all() {
  std::vector<double> values;
  for (int k = 0; k < model_.variables.size(); ++k) {
    const auto vr = static_cast<fmi2ValueReference>(k);
    fmi2Status status = fmi2OK;
    double real = 0.0;
    int number = 0;
    switch (model_.variables.family(k).type) {
      case Type::real:
        status = fmi2GetReal(component, &vr, 1, &real);
        break;
      case Type::integer:
        status = fmi2GetInteger(component, &vr, 1, &number);
        real = number;
        break;
      case Type::boolean:
        status = fmi2GetBoolean(component, &vr, 1, &number);
        real = number;
        break;
    }
    EXPECT_EQ(status, fmi2OK) << model_.variables.name(k) << ": " << last_message();
    values.push_back(real);
  }
  return values;
}

std::vector<char> Slave::serialized() {
  fmi2FMUstate state = nullptr;
  std::size_t size = 0;
  EXPECT_EQ(fmi2GetFMUstate(component, &state), fmi2OK);
  EXPECT_EQ(fmi2SerializedFMUstateSize(component, state, &size), fmi2OK);
  std::vector<char> bytes(size);
  EXPECT_EQ(fmi2SerializeFMUstate(component, state, bytes.data(), bytes.size()), fmi2OK);
  EXPECT_EQ(fmi2FreeFMUstate(component, &state), fmi2OK);
  return bytes;
}

fmi2Status Slave::deserialize_and_set(const std::vector<char>& bytes) {
  fmi2FMUstate state = nullptr;
  fmi2Status status = fmi2DeSerializeFMUstate(component, bytes.data(), bytes.size(), &state);
  if (status == fmi2OK) status = fmi2SetFMUstate(component, state);
  fmi2FreeFMUstate(component, &state);
  return status;
}

testing::AssertionResult same_values(const Slave& slave, const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return testing::AssertionFailure() << a.size() << " and " << b.size() << " values";
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (std::bit_cast<std::uint64_t>(a[k]) != std::bit_cast<std::uint64_t>(b[k])) {
      return testing::AssertionFailure() << slave.model().variables.name(static_cast<int>(k)) << ": " << a[k] << " and "
                                         << b[k] << ", difference " << a[k] - b[k];
    }
  }
  return testing::AssertionSuccess();
}
