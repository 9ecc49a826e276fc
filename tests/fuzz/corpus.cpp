// Writes the seeds of both fuzz targets: fuzz_corpus FOLDER makes FOLDER/state_bytes and FOLDER/call_sequences.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "call_code.hpp"
#include "fuzzed_game.hpp"

namespace {

/// Bytes of a call's code and of its arguments.
struct Sequence {
  std::string bytes;

  Sequence& call(CallCode code, std::initializer_list<int> arguments = {}) {
    bytes += static_cast<char>(code);
    bytes += '\0';
    for (const int argument : arguments) bytes += static_cast<char>(argument);
    return *this;
  }
};

constexpr int true_time = 255;  // not replaced by a hostile one

Sequence started(std::size_t game, fmi2Type type) {
  Sequence sequence{{static_cast<char>(game), static_cast<char>(type == fmi2CoSimulation ? 0 : 1)}};
  sequence.call(CallCode::setup_experiment, {0, 0, 0, 0, 0}).call(CallCode::set_real, {1, 0, 0, 0, 5});
  return sequence.call(CallCode::enter_initialization).call(CallCode::exit_initialization);
}

Sequence co_simulation(std::size_t game) {
  Sequence sequence = started(game, fmi2CoSimulation);
  sequence.call(CallCode::do_step, {true_time, 3, 1}).call(CallCode::get_state, {0, 0});
  for (const int k : {0, 4, 9}) {
    sequence.call(CallCode::set_real, {1, 0, k, 0, 4}).call(CallCode::do_step, {true_time, 7, 1});
    sequence.call(CallCode::get_real, {2, 0, 100, 0, 120, 0})
        .call(CallCode::get_output_derivatives, {1, 0, 90, 0, 2, 0});
  }
  sequence.call(CallCode::set_input_derivatives, {1, 0, 60, 0, 2, 0, 3}).call(CallCode::do_step, {true_time, 2, 1});
  sequence.call(CallCode::directional_derivative, {1, 0, 90, 0, 1, 0, 60, 0, 1});
  sequence.call(CallCode::serialize, {0, 0, 255}).call(CallCode::set_state, {0, 0});
  sequence.call(CallCode::deserialize, {1, 0})
      .call(CallCode::set_state, {1, 0})
      .call(CallCode::do_step, {true_time, 1, 1});
  return sequence.call(CallCode::free_state, {0, 0}).call(CallCode::terminate).call(CallCode::reset);
}

Sequence model_exchange(std::size_t game) {
  Sequence sequence = started(game, fmi2ModelExchange);
  sequence.call(CallCode::new_discrete_states, {1}).call(CallCode::enter_continuous_time_mode);
  sequence.call(CallCode::get_nominals, {255}).call(CallCode::get_state, {0, 0});
  for (const int time : {7, 12, 21}) {
    sequence.call(CallCode::get_derivatives, {255}).call(CallCode::get_event_indicators, {255});
    sequence.call(CallCode::set_time, {time}).call(CallCode::set_continuous_states, {255, 2, 0, 1, 0, 140, 9, 0, 120});
    sequence.call(CallCode::completed_integrator_step, {0});
    sequence.call(CallCode::enter_event_mode).call(CallCode::set_real, {1, 0, 2, 0, 4});
    sequence.call(CallCode::new_discrete_states, {1}).call(CallCode::enter_continuous_time_mode);
    sequence.call(CallCode::directional_derivative, {1, 0, 90, 0, 1, 0, 60, 0, 1});
  }
  return sequence.call(CallCode::set_state, {0, 0})
      .call(CallCode::get_continuous_states, {255})
      .call(CallCode::terminate);
}

void write(const std::filesystem::path& folder, const std::string& name, const std::string& bytes) {
  std::filesystem::create_directories(folder);
  std::ofstream(folder / name, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

void write_states(const std::filesystem::path& folder, std::size_t game) {
  FuzzedInstance instance(fuzzed_games()[game]);
  const auto write_state = [&](const std::string& name) {
    const auto bytes = *instance.bytes();
    write(folder, std::to_string(game) + "_" + name, static_cast<char>(game) + std::string(bytes.begin(), bytes.end()));
  };
  write_state("instantiated");
  instance.start();
  write_state("at_0");
  for (int k = 0; k < 4; ++k) {
    require(fmi2DoStep(instance.component, 0.5 * k, 0.5, fmi2True) == fmi2OK, "the game runs");
    write_state("after_" + std::to_string(k + 1) + "_steps");
  }
  require(fmi2Terminate(instance.component) == fmi2OK, "a run can be ended");
  write_state("terminated");
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::fputs("usage: fuzz_corpus FOLDER\n", stderr);
    return 2;
  }
  const std::filesystem::path folder = arguments[1];
  for (std::size_t game = 0; game < fuzzed_games().size(); ++game) {
    write_states(folder / "state_bytes", game);
    write(folder / "call_sequences", std::to_string(game) + "_co_simulation", co_simulation(game).bytes);
    write(folder / "call_sequences", std::to_string(game) + "_model_exchange", model_exchange(game).bytes);
  }
  const char* texts[] = {
      "(x[i,1] - h[i])^2 - p * x[i,1] * exp(-0.1 * sum(x[j,1] for j in 1..N if j != i))",
      "sin(x[i,l]) * x[mod(i, N) + 1, 1] - 0.5 * v[max(i, 2), l] * tanh(v[2,1] / 0.1)",
      "0.3 * cos(2 * t) + exp(-t) - R[1,2] * pi^-1.5e0",
      "if(i > 1 and not l == 2 or order[i] <= 1, log1p(hypot(x[i,1], 2)), atan2(x[1,1], 1)) / prod(k for k in 1..3)",
      "if(x[1,1] > p and not x[2,1] <= 0.5, sqrt(x[1,1]), abs(x[3,2])) + sign(x[1,2]) * mod(x[2,2], 0.3)",
      "min(floor(2 * x[1,1]), max(x[2,1], h[1])) + sum(x[j,1] for j in 1..N if x[j,1] >= 0)",
      "square(t - 0.1, 2) + pulse(t, 1, 0.001) + noise(7 + i, 0.5) + if(mod(t, 2) < 0.5, floor(3 * t), 0)",
  };
  for (std::size_t k = 0; k < std::size(texts); ++k) write(folder / "expressions", std::to_string(k), texts[k]);
  return 0;
}
