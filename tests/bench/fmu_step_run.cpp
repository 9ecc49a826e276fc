// What fmi2DoStep costs beyond the bare core: the same run with the same outputs, alternately through the functions of
// the FMU's shared library and by the core linked here. Prints CPU seconds per run as JSON.
#include <dlfcn.h>
#include <fmi2FunctionTypes.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>

#include "game/game.hpp"
#include "integration/integrator.hpp"

namespace mixed_order_game {
namespace {

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

class Library {
 public:
  explicit Library(const std::string& path) : handle_(dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL)) {
    if (handle_ == nullptr) throw std::runtime_error(dlerror());
  }
  ~Library() { dlclose(handle_); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  template <typename Function>
  Function* function(const char* name) const {
    void* address = dlsym(handle_, name);
    if (address == nullptr) throw std::runtime_error(std::string("the library lacks ") + name);
    return reinterpret_cast<Function*>(address);
  }

 private:
  void* handle_;
};

void log_message(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String message, ...) {
  std::fprintf(stderr, "%s\n", message);
}

void require(fmi2Status status, const char* call) {
  if (status != fmi2OK) throw std::runtime_error(std::string(call) + " failed");
}

void print(const char* name, const std::vector<double>& values, const char* end) {
  std::printf("\"%s\": [", name);
  for (std::size_t k = 0; k < values.size(); ++k) std::printf("%s%.9g", k == 0 ? "" : ", ", values[k]);
  std::printf("]%s", end);
}

// x, v, u and nash_error of every communication point go into a row, as a master that records outputs would have it
int run(char** arguments) {
  const std::string game_file = arguments[1];
  const Library library(arguments[2]);
  const char* resources = arguments[3];
  const char* guid = arguments[4];
  std::vector<fmi2ValueReference> references;
  std::istringstream list(arguments[5]);
  for (std::string item; std::getline(list, item, ',');) {
    references.push_back(static_cast<fmi2ValueReference>(std::stoul(item)));
  }
  const double stop = std::stod(arguments[6]);
  const int steps = std::stoi(arguments[7]);
  const double rtol = std::stod(arguments[8]);
  const int repetitions = std::stoi(arguments[9]);

  std::ifstream file(game_file);
  if (!file) throw std::runtime_error("cannot read " + game_file);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const ClosedLoop loop(parse_game(text).parameters);
  const Shape& shape = loop.shape();
  const Inputs input(shape.actions());

  const auto instantiate = library.function<fmi2InstantiateTYPE>("fmi2Instantiate");
  const auto set_up = library.function<fmi2SetupExperimentTYPE>("fmi2SetupExperiment");
  const auto enter = library.function<fmi2EnterInitializationModeTYPE>("fmi2EnterInitializationMode");
  const auto leave = library.function<fmi2ExitInitializationModeTYPE>("fmi2ExitInitializationMode");
  const auto do_step = library.function<fmi2DoStepTYPE>("fmi2DoStep");
  const auto get_real = library.function<fmi2GetRealTYPE>("fmi2GetReal");
  const auto terminate = library.function<fmi2TerminateTYPE>("fmi2Terminate");
  const auto free_instance = library.function<fmi2FreeInstanceTYPE>("fmi2FreeInstance");
  const fmi2CallbackFunctions callbacks = {log_message, std::calloc, std::free, nullptr, nullptr};

  const double h = stop / steps;
  const int n = shape.actions();
  Signals signals(shape);
  AlignedVector rate(at(loop.layout().size()));
  const AlignedVector d_ext(at(n), 0.0);
  std::vector<double> row(std::max(references.size(), at(3 * n + 1)));
  std::array<std::vector<double>, 4> seconds;  // the FMU and the core, without and with outputs
  double difference = 0.0;

  for (int repetition = 0; repetition < repetitions; ++repetition) {
    for (const bool outputs : {false, true}) {
      fmi2Component fmu = instantiate("bench", fmi2CoSimulation, guid, resources, &callbacks, fmi2False, fmi2False);
      if (fmu == nullptr) throw std::runtime_error("fmi2Instantiate failed");
      require(set_up(fmu, fmi2True, rtol, 0.0, fmi2True, stop), "fmi2SetupExperiment");
      require(enter(fmu), "fmi2EnterInitializationMode");
      require(leave(fmu), "fmi2ExitInitializationMode");
      double begun = cpu_seconds();
      for (int k = 0; k < steps; ++k) {
        require(do_step(fmu, k * h, h, fmi2True), "fmi2DoStep");
        if (outputs) require(get_real(fmu, references.data(), references.size(), row.data()), "fmi2GetReal");
      }
      seconds[outputs ? 2 : 0].push_back(cpu_seconds() - begun);
      require(get_real(fmu, references.data(), references.size(), row.data()), "fmi2GetReal");
      const double first = row[0];
      terminate(fmu);
      free_instance(fmu);

      Integrator fresh(loop, input, make_structured_newton());  // as an instance has its own
      fresh.start(0.0, {rtol, 0.01 * rtol});
      begun = cpu_seconds();
      for (int k = 0; k < steps; ++k) {
        fresh.advance(std::max(k * h + h, fresh.time()));
        if (!outputs) continue;
        loop.evaluate(fresh.time(), fresh.state(), d_ext.data(), fresh.modes(), signals, rate.data());
        std::copy_n(fresh.state(), 2 * n, row.begin());
        std::copy_n(signals.control.begin(), n, row.begin() + 2 * n);
        double squares = 0.0;
        for (int p = 0; p < n; ++p) squares += (row[at(p)] + 0.5) * (row[at(p)] + 0.5);
        row[at(3 * n)] = std::sqrt(squares);
      }
      seconds[outputs ? 3 : 1].push_back(cpu_seconds() - begun);
      difference = std::max(difference, std::fabs(fresh.state()[0] - first));
    }
  }
  std::printf("{\"steps\": %d, \"difference\": %.3g, ", steps, difference);
  print("fmu", seconds[0], ", ");
  print("core", seconds[1], ", ");
  print("fmu_with_outputs", seconds[2], ", ");
  print("core_with_outputs", seconds[3], "}\n");
  return 0;
}

}  // namespace
}  // namespace mixed_order_game

int main(int count, char** arguments) {
  if (count != 10) {
    std::fputs("usage: fmu_step_run GAME LIBRARY RESOURCES GUID REFERENCES STOP STEPS RTOL REPETITIONS\n", stderr);
    return 2;
  }
  try {
    return mixed_order_game::run(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fmu_step_run: %s\n", error.what());
    return 1;
  }
}
