// A small importer: one instance of a game's FMU, called through the functions of FMI 2.0 as linked.
#pragma once

#include <fmi2Functions.h>
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "model.hpp"

/// Games of pairwise different sizes: three players (orders 1, 2, 1), two coordinates, five neurons, and a bound that
/// the weights reach within the first second.
std::string small_game();
/// The same with lines replaced, each found exactly once.
std::string small_game_with(const std::map<std::string, std::string>& replacements);
/// The same with a line in its table [strategy].
std::string small_game_under(const std::string& strategy);
/// Two players of order 2 on a line, four neurons with centers off the diagonal.
std::string vector_centers_game();
std::string five_vehicles();

/// A folder with the game as game.toml, kept until the process ends.
std::string resources_of(const std::string& game, const std::string& folder_name = "resources");

struct LogEntry {
  std::string instance;
  fmi2Status status;
  std::string category;
  std::string message;
};

/// As "[1,2]".
std::string indices(int i, int l);

/// A logger whose environment is a std::vector<LogEntry>.
void record(fmi2ComponentEnvironment log, fmi2String instance, fmi2Status status, fmi2String category,
            fmi2String message, ...);

class Slave {
 public:
  explicit Slave(const std::string& game = small_game(), bool logging = false, fmi2Type type = fmi2CoSimulation);
  ~Slave();
  Slave(const Slave&) = delete;
  Slave& operator=(const Slave&) = delete;

  fmi2Component component = nullptr;
  std::vector<LogEntry> log;
  [[nodiscard]] const mixed_order_game::Model& model() const { return model_; }
  [[nodiscard]] std::string last_message() const { return log.empty() ? "" : log.back().message; }

  [[nodiscard]] fmi2ValueReference reference(const std::string& name) const;
  [[nodiscard]] double get(const std::string& name);
  [[nodiscard]] bool get_boolean(const std::string& name);
  [[nodiscard]] int get_integer(const std::string& name);
  fmi2Status set(const std::string& name, double value);
  fmi2Status set_boolean(const std::string& name, bool value);
  fmi2Status set_derivative(const std::string& name, int order, double value);
  [[nodiscard]] double output_derivative(const std::string& name);

  /// From instantiated to step complete.
  void initialize(double start = 0.0, std::optional<double> tolerance = std::nullopt,
                  std::optional<double> stop = std::nullopt);
  fmi2Status step(double t, double h) { return fmi2DoStep(component, t, h, fmi2True); }
  /// Equal steps from t to t_end, which must succeed.
  void run(double t, double t_end, int steps);

  /// All Real, Integer and Boolean values, in the order of the table.
  [[nodiscard]] std::vector<double> all();
  [[nodiscard]] std::vector<char> serialized();
  fmi2Status deserialize_and_set(const std::vector<char>& bytes);

 private:
  mixed_order_game::Model model_;
  fmi2CallbackFunctions callbacks_{};
  std::map<std::string, fmi2ValueReference> references_;
};

/// Bit for bit; names the first variable that differs.
testing::AssertionResult same_values(const Slave& slave, const std::vector<double>& a, const std::vector<double>& b);
