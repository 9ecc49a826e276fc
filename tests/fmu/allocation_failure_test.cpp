// Every allocation of a run fails once, one at a time: the call is refused, nothing is lost and nothing leaks. Stands
// in for malloc, so that the allocations of SUNDIALS and of the C library fail too.
#include <cerrno>
#include <cstdlib>
#include <functional>

#include "loop/located_conditions.hpp"
#include "slave.hpp"

using namespace mixed_order_game;

namespace {

/// What malloc does here; only between watch() and the end of the watch.
struct Heap {
  bool watched = false;
  long allocations = 0;
  long fails_at = 0;  ///< number of the allocation that fails; 0: none
  long blocks = 0;    ///< allocated and not freed
} heap;

bool refused() {
  if (!heap.watched) return false;
  if (++heap.allocations == heap.fails_at) return true;
  ++heap.blocks;
  return false;
}

void* out_of_memory() {
  errno = ENOMEM;
  return nullptr;
}

}  // namespace

extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* block);

void* malloc(std::size_t size) { return refused() ? out_of_memory() : __libc_malloc(size); }
void* calloc(std::size_t number, std::size_t size) { return refused() ? out_of_memory() : __libc_calloc(number, size); }
void* realloc(void* old, std::size_t size) {
  if (refused()) return out_of_memory();
  if (old != nullptr && heap.watched) --heap.blocks;
  return __libc_realloc(old, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  return refused() ? out_of_memory() : __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  if (refused()) return ENOMEM;
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}
void free(void* block) {
  if (block != nullptr && heap.watched) --heap.blocks;
  __libc_free(block);
}
}

namespace {

int told = 0;  // messages
void count(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String message, ...) {
  if (message != nullptr && *message != '\0') ++told;
}

/// What an importer does with one instance, call by call; the results land in arrays that are there already.
class Course {
 public:
  Course(const std::string& game, fmi2Type type) : like_(game), type_(type) {
    uri_ = "file://" + resources_of(game);
    callbacks_.logger = count;
    for (const char* name : {"x[1,1]", "v[2,1]", "u[2,1]", "nash_error", "d_ext[1,1]", "W_norm2[2,1]"}) {
      read_.push_back(like_.reference(name));
    }
    values_.resize(read_.size());
    state_.resize(like_.model().variables.states().size());
    rate_.resize(state_.size());
    indicators_.resize(static_cast<std::size_t>(LocatedConditions::located(like_.model().game.parameters)));
    bytes_.resize(100'000);
    initialize();
    type == fmi2CoSimulation ? run_by_itself() : run_by_importer();
  }

  struct Outcome {
    long allocations = 0;
    long blocks = 0;  ///< that remained
    bool wrong = false;
    std::vector<double> values;
  };

  /// All calls; those that fail because memory is short are repeated, or all after a reset.
  Outcome run(long fails_at) {
    Outcome outcome;
    outcome.values.resize(read_.size());
    heap = {.watched = true, .allocations = 0, .fails_at = fails_at, .blocks = 0};
    told = 0;
    for (int attempt = 0; attempt < 2 && component_ == nullptr; ++attempt) {
      component_ = fmi2Instantiate("short of memory", type_, like_.model().guid.c_str(), uri_.c_str(), &callbacks_,
                                   fmi2False, fmi2True);
      outcome.wrong = outcome.wrong || (component_ == nullptr && heap.allocations < fails_at);
    }
    bool again = true;
    while (again) {
      again = false;
      for (const auto& call : calls_) {
        const bool had_failed = fails_at != 0 && heap.allocations >= fails_at;
        const int before = told;
        if (call() == fmi2OK) continue;
        outcome.wrong = outcome.wrong || had_failed || heap.allocations < fails_at || told == before;
        if (outcome.wrong || call() == fmi2OK) continue;
        again = true;  // from the error state
        break;
      }
      if (again) {
        free_states();
        outcome.wrong = outcome.wrong || fmi2Reset(component_) != fmi2OK;
      }
    }
    std::copy(values_.begin(), values_.end(), outcome.values.begin());
    free_states();
    fmi2FreeInstance(component_);
    component_ = nullptr;
    heap.watched = false;
    outcome.allocations = heap.allocations;
    outcome.blocks = heap.blocks;
    return outcome;
  }

 private:
  template <typename Action>
  void add(Action action) {
    calls_.emplace_back(std::move(action));
  }

  void set(const char* name, double value) {
    add([this, vr = like_.reference(name), value] { return fmi2SetReal(component_, &vr, 1, &value); });
  }

  void read() {
    add([this] { return fmi2GetReal(component_, read_.data(), read_.size(), values_.data()); });
  }

  void save(int number) {
    add([this, number] { return fmi2GetFMUstate(component_, &saved_[number]); });
  }

  void restore(int number) {
    add([this, number] { return fmi2SetFMUstate(component_, saved_[number]); });
  }

  /// To bytes and back.
  void copy(int from, int to) {
    add([this, from] { return fmi2SerializedFMUstateSize(component_, saved_[from], &size_); });
    add([this, from] { return fmi2SerializeFMUstate(component_, saved_[from], bytes_.data(), size_); });
    add([this, to] { return fmi2DeSerializeFMUstate(component_, bytes_.data(), size_, &saved_[to]); });
  }

  void differentiate(const char* unknown, const char* known) {
    add([this, of = like_.reference(unknown), by = like_.reference(known)] {
      const double one = 1.0;
      double derivative = 0.0;
      return fmi2GetDirectionalDerivative(component_, &of, 1, &by, 1, &one, &derivative);
    });
  }

  void initialize() {
    set("k2", 1.1);
    set("d_ext[1,1]", 0.2);
    add([this] { return fmi2SetupExperiment(component_, fmi2True, 1e-5, 0.0, fmi2True, 10.0); });
    add([this] { return fmi2EnterInitializationMode(component_); });
    set("x0[1,1]", 0.9);
    read();
    differentiate("x_star[1,1]", "cost_linear[1,1]");
    add([this] { return fmi2ExitInitializationMode(component_); });
  }

  void step(double t, double h) {
    add([=, this] { return fmi2DoStep(component_, t, h, fmi2False); });
  }

  void run_by_itself() {
    read();
    step(0.0, 0.1);
    save(0);
    set("d_ext[1,1]", 0.7);
    add([this, vr = like_.reference("d_ext[1,1]")] {
      const fmi2Integer order = 1;
      const double slope = 0.5;
      return fmi2SetRealInputDerivatives(component_, &vr, 1, &order, &slope);
    });
    step(0.1, 0.1);
    set("k3", 18.0);
    set("a[1,2]", 1.1);
    set("cost_linear[1,1]", 0.3);
    save(1);
    step(0.2, 0.3);
    differentiate("u[1,1]", "x[1,1]");
    add([this, vr = like_.reference("u[1,1]")] {
      const fmi2Integer order = 1;
      double derivative = 0.0;
      return fmi2GetRealOutputDerivatives(component_, &vr, 1, &order, &derivative);
    });
    copy(1, 2);
    restore(0);
    step(0.1, 0.05);
    add([this] { return fmi2Reset(component_); });
    initialize();
    restore(2);
    step(0.2, 0.2);
    save(1);  // into a handle that is in use
    restore(1);
    step(0.4, 0.2);
    read();
    add([this] { return fmi2Terminate(component_); });
  }

  void run_by_importer() {
    add([this] { return fmi2NewDiscreteStates(component_, &info_); });
    set("k3", 18.0);
    set("x[1,1]", 0.7);
    add([this] { return fmi2EnterContinuousTimeMode(component_); });
    save(0);
    add([this] { return fmi2GetContinuousStates(component_, state_.data(), state_.size()); });
    add([this] { return fmi2GetDerivatives(component_, rate_.data(), rate_.size()); });
    add([this] {
      for (std::size_t k = 0; k < state_.size(); ++k) state_[k] = 0.1;
      return fmi2SetContinuousStates(component_, state_.data(), state_.size());
    });
    add([this] { return fmi2SetTime(component_, 0.1); });
    set("d_ext[1,1]", 0.4);
    add([this] { return fmi2GetEventIndicators(component_, indicators_.data(), indicators_.size()); });
    add([this] { return fmi2CompletedIntegratorStep(component_, fmi2True, &flag_, &flag_); });
    differentiate("der(x[1,1])", "x[1,1]");
    copy(0, 1);
    restore(1);
    add([this] { return fmi2EnterEventMode(component_); });
    add([this] { return fmi2NewDiscreteStates(component_, &info_); });
    read();
    add([this] { return fmi2Terminate(component_); });
  }

  void free_states() {
    for (fmi2FMUstate& state : saved_) fmi2FreeFMUstate(component_, &state);
  }

  Slave like_;
  fmi2Type type_;
  std::string uri_;
  fmi2CallbackFunctions callbacks_{};
  std::vector<std::function<fmi2Status()>> calls_;
  std::vector<fmi2ValueReference> read_;
  std::vector<double> values_, state_, rate_, indicators_;
  std::vector<char> bytes_;
  std::size_t size_ = 0;
  fmi2EventInfo info_{};
  fmi2Boolean flag_ = fmi2False;
  fmi2FMUstate saved_[3] = {};
  fmi2Component component_ = nullptr;
};

/// A third player without a plant of its own, whose actions and velocities come from outside.
std::string game_with_a_plant_outside() {
  std::string game = vector_centers_game();
  for (const auto& [begins, line] :
       {std::pair{"centers =", "centers = [-1.0, 0.0, 1.0, 2.0]"}, {"edges =", "edges = [[1, 2], [2, 3]]"}}) {
    const std::size_t place = game.find(begins);
    game.replace(place, game.find('\n', place) - place, line);
  }
  return game + "\n[[player]]\nname = \"outside\"\norder = 2\nplant = \"external\"\ncost = { quadratic = 1.0 }\n";
}

void expect_every_failure_to_be_survived(const std::string& game, fmi2Type type) {
  Course course(game, type);
  const Course::Outcome undisturbed = course.run(0);
  ASSERT_FALSE(undisturbed.wrong);
  EXPECT_GT(undisturbed.allocations, 300);
  EXPECT_EQ(undisturbed.blocks, 0);
  for (long number = 1; number <= undisturbed.allocations; ++number) {
    const Course::Outcome outcome = course.run(number);
    SCOPED_TRACE("allocation " + std::to_string(number) + " of " + std::to_string(undisturbed.allocations));
    EXPECT_FALSE(outcome.wrong);
    EXPECT_EQ(outcome.values, undisturbed.values);
    EXPECT_EQ(outcome.blocks, 0) << "left behind";
  }
}

}  // namespace

TEST(Behaviour25Memory, EveryAllocationOfCoSimulationMayFail) {
  expect_every_failure_to_be_survived(game_with_a_plant_outside(), fmi2CoSimulation);
}

TEST(Behaviour25Memory, EveryAllocationOfModelExchangeMayFail) {
  expect_every_failure_to_be_survived(vector_centers_game(), fmi2ModelExchange);
}
