// Runs a game file with the bare core, several times, and prints what it cost as JSON.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <exception>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string>

#include "game/game.hpp"
#include "integration/integrator.hpp"
#include "kernels/kernels.hpp"
#include "klu_newton.hpp"

namespace mixed_order_game {
namespace {

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Peak of resident memory, MB, of this program alone: getrusage would count what its parent had before exec.
double peak_megabytes() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kilobytes = 0.0;
    if (word == "VmHWM:" && status >> kilobytes) return kilobytes / 1024.0;
  }
  throw std::runtime_error("/proc/self/status has no VmHWM");
}

std::unique_ptr<NewtonSolver> make_solver(const std::string& name) {
  if (name == "structured") return make_structured_newton();
  if (name == "klu") return make_klu_newton(false);
  if (name == "klu-ordered") return make_klu_newton(true);
  throw std::runtime_error("unknown linear solver " + name);
}

constexpr const char* usage =
    "usage: core_run GAME --stop S --outputs N --rtol R [--repetitions 1] [--solver structured] [--write FILE]\n"
    "  solver: structured, klu, klu-ordered\n"
    "  FILE receives x and z or v at times 0, S/N, ..., S as doubles, coordinate-major within a row\n";

int run(int count, char** arguments) {
  std::map<std::string, std::string> options{{"--repetitions", "1"}, {"--solver", "structured"}, {"--write", ""}};
  for (int k = 2; k + 1 < count; k += 2) options[arguments[k]] = arguments[k + 1];
  if (count < 2 || count % 2 != 0 || !options.contains("--stop") || !options.contains("--outputs") ||
      !options.contains("--rtol")) {
    std::fputs(usage, stderr);
    return 2;
  }
  const double stop = std::stod(options["--stop"]);
  const int outputs = std::stoi(options["--outputs"]);
  const double rtol = std::stod(options["--rtol"]);
  const int repetitions = std::stoi(options["--repetitions"]);

  std::ifstream file(arguments[1]);
  if (!file) throw std::runtime_error(std::string("cannot read ") + arguments[1]);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const double start = cpu_seconds();
  const ClosedLoop loop(parse_game(text).parameters);
  const Inputs input(loop.shape().actions());
  Integrator integrator(loop, input, make_solver(options["--solver"]));
  const double reading = cpu_seconds() - start;

  const auto kept = at(2 * loop.shape().actions());  // x and z or v
  std::vector<double> trajectory(kept * at(outputs + 1));
  std::vector<double> seconds;
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    const double begun = cpu_seconds();
    integrator.start(0.0, {rtol, 0.01 * rtol});
    std::copy_n(integrator.state(), kept, trajectory.begin());
    for (int k = 1; k <= outputs; ++k) {
      integrator.advance(k == outputs ? stop : stop * k / outputs);
      std::copy_n(integrator.state(), kept, trajectory.begin() + static_cast<std::ptrdiff_t>(kept * at(k)));
    }
    seconds.push_back(cpu_seconds() - begun);
  }

  if (!options["--write"].empty()) {
    std::ofstream out(options["--write"], std::ios::binary);
    out.write(reinterpret_cast<const char*>(trajectory.data()),
              static_cast<std::streamsize>(trajectory.size() * sizeof(double)));
    if (!out) throw std::runtime_error("cannot write " + options["--write"]);
  }
  const Statistics statistics = integrator.statistics();
  std::printf(
      "{\"states\": %d, \"level\": \"%s\", \"steps\": %lld, \"rate_evaluations\": %lld, \"setups\": %lld, "
      "\"solves\": %lld, \"events\": %lld, \"peak_mb\": %.2f, "
      "\"reading\": %.9g, \"cpu\": [",
      loop.layout().size(), kernels().level, static_cast<long long>(statistics.steps),
      static_cast<long long>(statistics.rate_evaluations), static_cast<long long>(statistics.newton_setups),
      static_cast<long long>(statistics.newton_solves), static_cast<long long>(statistics.events), peak_megabytes(),
      reading);
  for (std::size_t k = 0; k < seconds.size(); ++k) std::printf("%s%.9g", k == 0 ? "" : ", ", seconds[k]);
  std::puts("]}");
  return 0;
}

}  // namespace
}  // namespace mixed_order_game

int main(int count, char** arguments) {
  try {
    return mixed_order_game::run(count, arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "core_run: %s\n", error.what());
    return 1;
  }
}
