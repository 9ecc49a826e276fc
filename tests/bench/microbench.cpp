// Right-hand side, Newton set-up and Newton solve of the core, with their arithmetic and traffic per second, and what
// this machine can do at most: a triad in each cache and in memory, and multiplies with adds that are not fused.
//
// Bytes are the least traffic: what must be read and written once. Operations count +, -, *, / as one each, an
// exponential as 33, a tanh as 38 and a sine as 40 (of the polynomials in kernels/elementary.ipp).
#include <benchmark/benchmark.h>

#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

#include "game/game.hpp"
#include "integration/integrator.hpp"
#include "kernels/kernels.hpp"
#include "loop/inputs.hpp"
#include "loop/loop_jacobian.hpp"
#include "newton/newton_solver.hpp"

namespace mixed_order_game {
namespace {

struct Work {
  double operations = 0.0;
  double bytes = 0.0;
};

/// A game in a state that a run has reached, so that modes, weights and activations are typical.
struct Scene {
  explicit Scene(const std::string& path)
      : loop(parse_game(text_of(path)).parameters),
        input(loop.shape().actions()),
        signals(loop.shape()),
        state(at(loop.layout().size())),
        rate(state.size()),
        d_ext(at(loop.shape().actions()), 0.0),
        jacobian(loop),
        solver(make_structured_newton()) {
    Integrator integrator(loop, input, make_structured_newton());
    integrator.start(0.0, {1e-4, 1e-6});
    integrator.advance(time);
    std::copy_n(integrator.state(), state.size(), state.begin());
    modes = integrator.modes();
    evaluate();
    jacobian.linearize(state.data(), loop.plants(state.data(), nullptr, signals), signals, modes);
    solver->refresh(jacobian);
    if (!solver->factor(jacobian, gamma)) throw std::runtime_error("singular Newton matrix");
  }

  static std::string text_of(const std::string& path) {
    std::ifstream file(path);
    if (!file) throw std::runtime_error("cannot read " + path);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  void evaluate() { loop.evaluate(time, state.data(), d_ext.data(), modes, signals, rate.data()); }

  [[nodiscard]] double players() const { return loop.shape().players; }
  [[nodiscard]] double n() const { return loop.shape().actions(); }
  [[nodiscard]] double neurons() const { return loop.shape().neurons; }
  [[nodiscard]] double directed_edges() const {
    return 2.0 * static_cast<double>(loop.parameters().graph.edges().size());
  }
  [[nodiscard]] double couplings() const { return loop.parameters().cost->hessian_pattern().entries(); }
  [[nodiscard]] double dynamics_terms() const { return loop.parameters().dynamics->jacobian_pattern().entries(); }

  [[nodiscard]] Work rate_work() const {
    Work work;
    work.operations = directed_edges() * 4.0 * n()                     // consensus
                      + 3.0 * players() * n()                          // sums of y and y^2
                      + players() * neurons() * (5.0 + 33.0)           // activations
                      + 2.0 * n() * neurons() + 4.0 * n() * neurons()  // w'S and adaptation
                      + n() * (38.0 + 40.0)                            // robust term and disturbance
                      + 4.0 * couplings() + 4.0 * dynamics_terms() + 8.0 * n();
    work.bytes = 8.0 * (2.0 * static_cast<double>(state.size()) + n() * neurons());
    return work;
  }

  static constexpr Real time = 0.5;
  static constexpr Real gamma = 2e-3;
  ClosedLoop loop;
  Inputs input;
  Signals signals;
  AlignedVector state;
  AlignedVector rate;
  AlignedVector d_ext;
  Modes modes;
  LoopJacobian jacobian;
  std::unique_ptr<NewtonSolver> solver;
};

void report(benchmark::State& runs, double states, Work work) {
  using benchmark::Counter;
  runs.counters["states"] = states;
  runs.counters["seconds_per_state"] = Counter(states, Counter::kIsIterationInvariantRate | Counter::kInvert);
  if (work.bytes > 0.0) runs.counters["bytes_per_second"] = Counter(work.bytes, Counter::kIsIterationInvariantRate);
  if (work.operations > 0.0) {
    runs.counters["flops_per_second"] = Counter(work.operations, Counter::kIsIterationInvariantRate);
  }
}

void register_scene(const std::string& name, const std::string& path) {
  const auto scene = std::make_shared<Scene>(path);
  const auto size = static_cast<double>(scene->state.size());
  benchmark::RegisterBenchmark(("rate/" + name).c_str(), [scene, size](benchmark::State& runs) {
    for (auto _ : runs) {
      scene->evaluate();
      benchmark::DoNotOptimize(scene->rate.data());
      benchmark::ClobberMemory();
    }
    report(runs, size, scene->rate_work());
  });
  benchmark::RegisterBenchmark(("setup/" + name).c_str(), [scene, size](benchmark::State& runs) {
    for (auto _ : runs) {
      scene->jacobian.linearize(scene->state.data(), scene->loop.plants(scene->state.data(), nullptr, scene->signals),
                                scene->signals, scene->modes);
      if (!scene->solver->factor(scene->jacobian, Scene::gamma)) runs.SkipWithError("singular Newton matrix");
      benchmark::ClobberMemory();
    }
    // least traffic: the state is read, the gains of the estimates (N x N) are written
    report(runs, size, {0.0, 8.0 * (size + scene->players() * scene->players())});
  });
  benchmark::RegisterBenchmark(("solve/" + name).c_str(), [scene, size](benchmark::State& runs) {
    AlignedVector b(scene->rate.size());
    for (auto _ : runs) {
      std::copy(scene->rate.begin(), scene->rate.end(), b.begin());
      scene->solver->solve(b.data());
      benchmark::ClobberMemory();
    }
    // least traffic: the right-hand side is read and written; y, activations and weights are read
    report(runs, size, {0.0, 8.0 * (3.0 * size + scene->n() * scene->neurons())});
  });
}

// The machine's own limits, with the widest vectors that the kernels use on it.

typedef double Two __attribute__((vector_size(16)));
typedef double Four __attribute__((vector_size(32)));
typedef double Eight __attribute__((vector_size(64)));

constexpr int chains = 12;  // enough independent sums to hide the latency of multiply and add
constexpr int rounds = 1000;

#define MIXED_ORDER_GAME_PEAK(NAME, VECTOR, ...)                                                 \
  __VA_ARGS__ double multiply_add_##NAME(double start) {                                         \
    VECTOR sum[chains];                                                                          \
    for (int c = 0; c < chains; ++c) sum[c] = VECTOR{} + (start + c);                            \
    const VECTOR factor = VECTOR{} + 0.999999;                                                   \
    const VECTOR term = VECTOR{} + 1e-6;                                                         \
    for (int r = 0; r < rounds; ++r) {                                                           \
      _Pragma("GCC unroll 12") for (int c = 0; c < chains; ++c) sum[c] = sum[c] * factor + term; \
    }                                                                                            \
    VECTOR total{};                                                                              \
    for (int c = 0; c < chains; ++c) total += sum[c];                                            \
    return total[0];                                                                             \
  }                                                                                              \
  __VA_ARGS__ void triad_##NAME(long n, const double* a, const double* b, double* c) {           \
    constexpr long length = sizeof(VECTOR) / sizeof(double);                                     \
    for (long k = 0; k + length <= n; k += length) {                                             \
      VECTOR x;                                                                                  \
      VECTOR y;                                                                                  \
      __builtin_memcpy(&x, a + k, sizeof x);                                                     \
      __builtin_memcpy(&y, b + k, sizeof y);                                                     \
      x = x + 3.0 * y;                                                                           \
      __builtin_memcpy(c + k, &x, sizeof x);                                                     \
    }                                                                                            \
  }

MIXED_ORDER_GAME_PEAK(baseline, Two)
#ifdef __x86_64__
MIXED_ORDER_GAME_PEAK(v3, Four, __attribute__((target("arch=x86-64-v3"))))
MIXED_ORDER_GAME_PEAK(v4, Eight, __attribute__((target("arch=x86-64-v4"))))
#endif

struct Peak {
  int lanes;
  double (*multiply_add)(double);
  void (*triad)(long, const double*, const double*, double*);
};

Peak peak_of_this_machine() {
#ifdef __x86_64__
  if (kernel_level_count() == 3) return {8, multiply_add_v4, triad_v4};
  if (kernel_level_count() == 2) return {4, multiply_add_v3, triad_v3};
#endif
  return {2, multiply_add_baseline, triad_baseline};
}

void register_peak() {
  using benchmark::Counter;
  const Peak peak = peak_of_this_machine();
  benchmark::RegisterBenchmark("peak/multiply_add", [peak](benchmark::State& runs) {
    double value = 1.0;
    for (auto _ : runs) benchmark::DoNotOptimize(value = peak.multiply_add(value));
    runs.counters["flops_per_second"] = Counter(2.0 * peak.lanes * chains * rounds, Counter::kIsIterationInvariantRate);
  });
  for (const auto& [name, kilobytes] :
       {std::pair{"16 kB", 16L}, {"512 kB", 512L}, {"8 MB", 8192L}, {"384 MB", 393216L}}) {
    const long n = kilobytes * 1024 / (3 * 8);
    benchmark::RegisterBenchmark((std::string("peak/triad ") + name).c_str(), [peak, n](benchmark::State& runs) {
      AlignedVector a(at(n), 1.0);
      AlignedVector b(at(n), 2.0);
      AlignedVector c(at(n), 0.0);
      for (auto _ : runs) {
        peak.triad(n, a.data(), b.data(), c.data());
        benchmark::ClobberMemory();
      }
      runs.counters["bytes_per_second"] = Counter(24.0 * static_cast<double>(n), Counter::kIsIterationInvariantRate);
    });
  }
}

}  // namespace
}  // namespace mixed_order_game

int main(int count, char** arguments) {
  benchmark::Initialize(&count, arguments);
  if (count < 2) {
    std::fputs("usage: microbench [--benchmark_...] NAME=GAME ...\n", stderr);
    return 2;
  }
  try {
    for (int k = 1; k < count; ++k) {
      const std::string argument = arguments[k];
      const std::size_t equals = argument.find('=');
      if (equals == std::string::npos) throw std::runtime_error(argument + " is not NAME=GAME");
      mixed_order_game::register_scene(argument.substr(0, equals), argument.substr(equals + 1));
    }
    mixed_order_game::register_peak();
    benchmark::AddCustomContext("kernels", mixed_order_game::kernels().level);
    benchmark::RunSpecifiedBenchmarks();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "microbench: %s\n", error.what());
    return 1;
  }
  return 0;
}
