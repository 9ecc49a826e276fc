// Saving, restoring, serializing and resetting: behaviours 1 to 6.
#include <malloc.h>

#include <bit>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "instance.hpp"
#include "slave.hpp"

using namespace mixed_order_game;

namespace {

#ifdef __SANITIZE_ADDRESS__
constexpr int patience = 20;  // times fewer repetitions
#else
constexpr int patience = 1;
#endif

const std::vector<std::pair<const char*, std::string>>& options() {
  static const std::vector<std::pair<const char*, std::string>> all = {
      {"default", small_game()},
      {"not robust", small_game_under("robust = false")},
      {"not perturbed", small_game_under("perturbed = false")},
      {"outputs only", small_game_with({{"dimension = 2\n", "dimension = 2\nexpose = \"outputs\"\n"}})},
      {"vector centers", vector_centers_game()},
      {"five vehicles", five_vehicles()},
  };
  return all;
}

// A run in which parameters, inputs and input derivatives change, with uneven steps from t = 0.3 k.
constexpr int segments = 8;
std::vector<double> segment(Slave& slave, int k) {
  const double t = 0.3 * k;
  fmi2Status changed = fmi2OK;
  if (k == 2) changed = slave.set("d_ext[1,1]", 0.7);
  if (k == 3) changed = slave.set_derivative("d_ext[2,1]", 1, -0.8);
  if (k == 4) changed = slave.set("k3", 1.1 * slave.get("k3"));
  if (k == 5) changed = slave.set("cost_quadratic[1]", 1.05 * slave.get("cost_quadratic[1]"));
  if (k == 6) changed = slave.set_derivative("d_ext[2,1]", 2, 0.4);
  EXPECT_EQ(changed, fmi2OK) << slave.last_message();
  EXPECT_EQ(slave.step(t, 0.11), fmi2OK) << slave.last_message();
  EXPECT_EQ(slave.step(t + 0.11, 0.19), fmi2OK) << slave.last_message();
  return slave.all();
}

}  // namespace

TEST(Behaviour01Rollback, RepeatsBitForBitInAnyOrderWithEveryOption) {
  for (const auto& [name, game] : options()) {
    SCOPED_TRACE(name);
    Slave slave(game);
    slave.initialize();
    std::vector<fmi2FMUstate> saved(segments + 1, nullptr);
    std::vector<std::vector<double>> seen;
    for (int k = 0; k < segments; ++k) {
      ASSERT_EQ(fmi2GetFMUstate(slave.component, &saved[static_cast<std::size_t>(k)]), fmi2OK);
      seen.push_back(segment(slave, k));
    }
    for (const int from : {5, 1, 7, 0, 3, 3}) {
      ASSERT_EQ(fmi2SetFMUstate(slave.component, saved[static_cast<std::size_t>(from)]), fmi2OK)
          << slave.last_message();
      for (int k = from; k < segments; ++k) {
        ASSERT_TRUE(same_values(slave, segment(slave, k), seen[static_cast<std::size_t>(k)]))
            << "restored at " << from << ", segment " << k;
      }
    }
    for (fmi2FMUstate& state : saved) EXPECT_EQ(fmi2FreeFMUstate(slave.component, &state), fmi2OK);
  }
}

TEST(Behaviour01Rollback, TheWeightsReachTheSphere) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 2.4, 24);
  EXPECT_GE(slave.get_integer("solver_events"), 3) << "the runs above would miss the hybrid part";
}

TEST(Behaviour01Rollback, WorksInEveryPhase) {
  Slave slave;
  ASSERT_EQ(slave.set("k1", 7.5), fmi2OK);
  fmi2FMUstate instantiated = nullptr;
  fmi2FMUstate running = nullptr;
  ASSERT_EQ(fmi2GetFMUstate(slave.component, &instantiated), fmi2OK);
  const auto before = slave.all();
  slave.initialize();
  slave.run(0.0, 0.5, 3);
  ASSERT_EQ(fmi2GetFMUstate(slave.component, &running), fmi2OK);
  const auto at_half = slave.all();
  ASSERT_EQ(fmi2SetFMUstate(slave.component, instantiated), fmi2OK);
  EXPECT_TRUE(same_values(slave, slave.all(), before));
  EXPECT_EQ(slave.step(0.5, 0.1), fmi2Error) << "it is not initialized any more";
  ASSERT_EQ(slave.set("x0[1,1]", 3.0), fmi2OK);
  ASSERT_EQ(fmi2SetFMUstate(slave.component, running), fmi2OK);
  EXPECT_TRUE(same_values(slave, slave.all(), at_half));
  ASSERT_EQ(fmi2Terminate(slave.component), fmi2OK);
  ASSERT_EQ(fmi2SetFMUstate(slave.component, running), fmi2OK);
  EXPECT_EQ(slave.step(0.5, 0.1), fmi2OK);
  fmi2FreeFMUstate(slave.component, &instantiated);
  fmi2FreeFMUstate(slave.component, &running);
}

TEST(Behaviour02SavingIsNeutral, ARunThatSavesAtEveryStepIsTheSame) {
  for (const auto& [name, game] : options()) {
    SCOPED_TRACE(name);
    Slave plain(game);
    Slave saving(game);
    plain.initialize();
    saving.initialize();
    fmi2FMUstate state = nullptr;
    for (int k = 0; k < 60; ++k) {
      ASSERT_EQ(fmi2GetFMUstate(saving.component, &state), fmi2OK);
      ASSERT_EQ(plain.step(0.05 * k, 0.05), fmi2OK);
      ASSERT_EQ(saving.step(0.05 * k, 0.05), fmi2OK);
    }
    EXPECT_TRUE(same_values(plain, plain.all(), saving.all()));
    fmi2FreeFMUstate(saving.component, &state);
  }
}

TEST(Behaviour03StateHoldsEverything, PendingChangesAndDerivativesIncluded) {
  Slave slave;
  slave.initialize(0.0, 1e-7, 10.0);
  ASSERT_EQ(slave.set("d_ext[3,2]", 0.4), fmi2OK);
  ASSERT_EQ(slave.set_derivative("d_ext[3,2]", 1, 0.9), fmi2OK);
  slave.run(0.0, 1.0, 7);
  ASSERT_EQ(slave.set("delta", 0.5), fmi2OK);  // not acting yet
  ASSERT_EQ(slave.set("d_ext[1,2]", -0.6), fmi2OK);
  fmi2FMUstate state = nullptr;
  ASSERT_EQ(fmi2GetFMUstate(slave.component, &state), fmi2OK);
  const auto before = slave.all();
  ASSERT_EQ(slave.step(1.0, 0.7), fmi2OK);
  const auto after = slave.all();

  ASSERT_EQ(slave.set("k1", 1.0), fmi2OK);
  ASSERT_EQ(slave.set("a[1,2]", 4.0), fmi2OK);
  ASSERT_EQ(slave.set_derivative("d_ext[1,1]", 3, 2.0), fmi2OK);
  slave.run(1.7, 3.0, 3);
  ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
  ASSERT_EQ(fmi2SetFMUstate(slave.component, state), fmi2OK);
  EXPECT_TRUE(same_values(slave, slave.all(), before));
  ASSERT_EQ(slave.step(1.0, 0.7), fmi2OK);
  EXPECT_TRUE(same_values(slave, slave.all(), after));
  EXPECT_EQ(slave.step(1.7, 9.0), fmi2Error) << "the stop time belongs to the state";
  fmi2FreeFMUstate(slave.component, &state);
}

// Run by the test below in a process of its own.
TEST(Behaviour04Serialization, DISABLED_ContinueInThisProcess) {
  const char* folder = std::getenv("FMU_TESTS_CONTINUE");
  ASSERT_NE(folder, nullptr);
  std::ifstream file(std::string(folder) + "/state", std::ios::binary);
  const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
  Slave slave;
  ASSERT_EQ(slave.deserialize_and_set(bytes), fmi2OK) << slave.last_message();
  std::ofstream result(std::string(folder) + "/result", std::ios::binary);
  for (int k = 5; k < segments; ++k) {
    for (const double value : segment(slave, k)) result.write(reinterpret_cast<const char*>(&value), sizeof value);
  }
}

TEST(Behaviour04Serialization, AnotherProcessContinuesBitForBit) {
  const std::string folder = resources_of("title = 'exchange'", "exchange");
  Slave slave;
  slave.initialize();
  for (int k = 0; k < 5; ++k) segment(slave, k);
  const auto bytes = slave.serialized();
  std::ofstream(folder + "/state", std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  const std::string command = "FMU_TESTS_CONTINUE='" + folder + "' '" +
                              std::filesystem::read_symlink("/proc/self/exe").string() +
                              "' --gtest_also_run_disabled_tests --gtest_filter='*DISABLED_ContinueInThisProcess'"
                              " > /dev/null";
  ASSERT_EQ(std::system(command.c_str()), 0);
  std::ifstream result(folder + "/result", std::ios::binary);
  for (int k = 5; k < segments; ++k) {
    const auto expected = segment(slave, k);
    std::vector<double> continued(expected.size());
    result.read(reinterpret_cast<char*>(continued.data()),
                static_cast<std::streamsize>(continued.size() * sizeof(double)));
    ASSERT_TRUE(result);
    EXPECT_TRUE(same_values(slave, continued, expected));
  }
}

TEST(Behaviour04Serialization, SameStateSameBytes) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 1.0, 5);
  const auto bytes = slave.serialized();
  Slave other;
  ASSERT_EQ(other.deserialize_and_set(bytes), fmi2OK) << other.last_message();
  EXPECT_EQ(other.serialized(), bytes);
}

TEST(Behaviour04Serialization, DamagedBytesAreRefusedAndHarmless) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 1.0, 4);
  const auto bytes = slave.serialized();
  slave.run(1.0, 1.5, 2);
  const auto before = slave.all();
  fmi2FMUstate state = nullptr;
  for (std::size_t k = 0; k < bytes.size(); k += k < 100 ? 1 : 37) {
    auto damaged = bytes;
    damaged[k] = static_cast<char>(damaged[k] ^ 0x10);
    ASSERT_EQ(fmi2DeSerializeFMUstate(slave.component, damaged.data(), damaged.size(), &state), fmi2Error) << k;
    ASSERT_EQ(state, nullptr);
  }
  for (std::size_t length = 0; length < bytes.size(); length += length < 100 ? 1 : 53) {
    ASSERT_EQ(fmi2DeSerializeFMUstate(slave.component, bytes.data(), length, &state), fmi2Error) << length;
  }
  auto longer = bytes;
  longer.push_back(0);
  EXPECT_EQ(fmi2DeSerializeFMUstate(slave.component, longer.data(), longer.size(), &state), fmi2Error);
  EXPECT_EQ(fmi2DeSerializeFMUstate(slave.component, nullptr, 10, &state), fmi2Error);
  EXPECT_EQ(fmi2DeSerializeFMUstate(slave.component, nullptr, 0, &state), fmi2Error);
  EXPECT_EQ(fmi2DeSerializeFMUstate(slave.component, bytes.data(), bytes.size(), nullptr), fmi2Error);
  EXPECT_TRUE(same_values(slave, slave.all(), before));
  EXPECT_EQ(slave.step(1.5, 0.1), fmi2OK) << "the instance is still usable";
}

TEST(Behaviour04Serialization, TooManyStepsToRepeatAreRefused) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 1.0, 4);
  const auto bytes = slave.serialized();
  const Instance instance(slave.model(), Interface::co_simulation);
  Snapshot snapshot = from_bytes(bytes, slave.model().guid, instance.snapshot_shape());
  snapshot.co_simulation->checkpoint.steps_since_restart = instance.snapshot_shape().steps;
  EXPECT_NO_THROW(
      (void)from_bytes(to_bytes(snapshot, slave.model().guid), slave.model().guid, instance.snapshot_shape()));
  ++snapshot.co_simulation->checkpoint.steps_since_restart;
  const auto excessive = to_bytes(snapshot, slave.model().guid);
  EXPECT_EQ(slave.deserialize_and_set(excessive), fmi2Error);
  EXPECT_NE(slave.last_message().find("too many steps"), std::string::npos) << slave.last_message();
  EXPECT_EQ(slave.step(1.0, 0.1), fmi2OK);
}

TEST(Behaviour04Serialization, SettingsThatCannotBeSetAreRefused) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 1.0, 4);
  const Instance instance(slave.model(), Interface::co_simulation);
  const Snapshot good = from_bytes(slave.serialized(), slave.model().guid, instance.snapshot_shape());
  const auto before = slave.all();
  const auto refused = [&](const Snapshot& snapshot, const char* reason) {
    EXPECT_EQ(slave.deserialize_and_set(to_bytes(snapshot, slave.model().guid)), fmi2Error) << reason;
    EXPECT_NE(slave.last_message().find(reason), std::string::npos) << slave.last_message();
    EXPECT_TRUE(same_values(slave, slave.all(), before));
  };
  ASSERT_EQ(good.settings[2], 20.0) << "k3";
  for (const bool acting : {false, true}) {
    Snapshot snapshot = good;
    (acting ? snapshot.co_simulation->acting : snapshot.settings)[2] = -3.0;
    refused(snapshot, "the saved k3 is -3, expected a positive finite number");
  }
  Snapshot snapshot = good;
  snapshot.experiment.tolerance = -1e-3;
  refused(snapshot, "the tolerance is -0.001");
  EXPECT_EQ(slave.deserialize_and_set(to_bytes(good, slave.model().guid)), fmi2OK);
}

TEST(Behaviour04Serialization, AnotherModelsBytesAreRefused) {
  Slave slave;
  slave.initialize();
  Slave foreign(small_game_with({{"k1 = 6.0", "k1 = 6.5"}}));
  foreign.initialize();
  EXPECT_EQ(slave.deserialize_and_set(foreign.serialized()), fmi2Error);
  EXPECT_NE(slave.last_message().find("GUID"), std::string::npos) << slave.last_message();
}

TEST(Behaviour04Serialization, TooSmallAnArrayIsRefused) {
  Slave slave;
  slave.initialize();
  fmi2FMUstate state = nullptr;
  ASSERT_EQ(fmi2GetFMUstate(slave.component, &state), fmi2OK);
  std::size_t size = 0;
  ASSERT_EQ(fmi2SerializedFMUstateSize(slave.component, state, &size), fmi2OK);
  std::vector<char> bytes(size, 'x');
  EXPECT_EQ(fmi2SerializeFMUstate(slave.component, state, bytes.data(), size - 1), fmi2Error);
  EXPECT_EQ(bytes[0], 'x');
  EXPECT_EQ(fmi2SerializeFMUstate(slave.component, state, nullptr, size), fmi2Error);
  EXPECT_EQ(fmi2SerializedFMUstateSize(slave.component, state, nullptr), fmi2Error);
  fmi2FreeFMUstate(slave.component, &state);
}

TEST(Behaviour05Handles, AreReusedFreedAndChecked) {
  Slave slave;
  slave.initialize();
  fmi2FMUstate state = nullptr;
  ASSERT_EQ(fmi2GetFMUstate(slave.component, &state), fmi2OK);
  const fmi2FMUstate first = state;
  slave.run(0.0, 0.4, 2);
  const auto later = slave.all();
  ASSERT_EQ(fmi2GetFMUstate(slave.component, &state), fmi2OK);
  EXPECT_EQ(state, first);
  slave.run(0.4, 0.8, 2);
  ASSERT_EQ(fmi2SetFMUstate(slave.component, state), fmi2OK);
  EXPECT_TRUE(same_values(slave, slave.all(), later)) << "the handle holds the second state";
  ASSERT_EQ(fmi2FreeFMUstate(slave.component, &state), fmi2OK);
  EXPECT_EQ(state, nullptr);
  EXPECT_EQ(fmi2FreeFMUstate(slave.component, &state), fmi2OK) << "freeing null is fine";
  EXPECT_EQ(fmi2FreeFMUstate(slave.component, nullptr), fmi2OK);
  EXPECT_EQ(fmi2SetFMUstate(slave.component, first), fmi2Error) << "freed";
  EXPECT_EQ(fmi2SetFMUstate(slave.component, nullptr), fmi2Error);
  fmi2FMUstate stale = first;
  EXPECT_EQ(fmi2FreeFMUstate(slave.component, &stale), fmi2Error);
  EXPECT_EQ(fmi2GetFMUstate(slave.component, &stale), fmi2Error);
  EXPECT_EQ(fmi2GetFMUstate(slave.component, nullptr), fmi2Error);
  Slave other;
  fmi2FMUstate others = nullptr;
  ASSERT_EQ(fmi2GetFMUstate(other.component, &others), fmi2OK);
  EXPECT_EQ(fmi2SetFMUstate(slave.component, others), fmi2Error);
  EXPECT_EQ(slave.step(0.4, 0.1), fmi2OK);
}

TEST(Behaviour05NoGrowth, SavingAndFreeing) {
  Slave slave;
  slave.initialize();
  slave.run(0.0, 1e-6, 1);
  const auto cycle = [&] {
    fmi2FMUstate state = nullptr;
    ASSERT_EQ(fmi2GetFMUstate(slave.component, &state), fmi2OK);
    ASSERT_EQ(fmi2SetFMUstate(slave.component, state), fmi2OK);
    ASSERT_EQ(fmi2FreeFMUstate(slave.component, &state), fmi2OK);
  };
  for (int k = 0; k < 100; ++k) cycle();
  const std::size_t before = mallinfo2().uordblks;
  for (int k = 0; k < 100'000 / patience; ++k) cycle();
  EXPECT_LE(mallinfo2().uordblks, before + 16384);
}

TEST(Behaviour05NoGrowth, InstantiatingAndFreeing) {
  const auto cycle = [] {
    Slave slave;
    slave.initialize();
    ASSERT_EQ(slave.step(0.0, 0.01), fmi2OK);
    fmi2FMUstate state = nullptr;
    ASSERT_EQ(fmi2GetFMUstate(slave.component, &state), fmi2OK);  // left to the instance
  };
  for (int k = 0; k < 20; ++k) cycle();
  const std::size_t before = mallinfo2().uordblks;
  for (int k = 0; k < 10'000 / patience; ++k) cycle();
  EXPECT_LE(mallinfo2().uordblks, before + 65536);
}

TEST(Behaviour06Reset, EqualsAFreshInstance) {
  const auto course = [](Slave& slave) {
    std::vector<double> seen = slave.all();
    slave.initialize();
    for (int k = 0; k < segments; ++k) {
      const auto values = segment(slave, k);
      seen.insert(seen.end(), values.begin(), values.end());
    }
    return seen;
  };
  Slave fresh;
  const auto expected = course(fresh);

  Slave slave;
  const auto check = [&](const char* from) {
    SCOPED_TRACE(from);
    ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
    EXPECT_EQ(course(slave), expected);
  };
  ASSERT_EQ(slave.set("k1", 9.0), fmi2OK);
  check("instantiated");
  check("step complete, twice");
  ASSERT_EQ(fmi2Terminate(slave.component), fmi2OK);
  check("terminated");
  ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
  ASSERT_EQ(slave.set_boolean("robust", false), fmi2OK);
  ASSERT_EQ(slave.set("tolerance_relative", 1e-3), fmi2OK);
  ASSERT_EQ(fmi2SetupExperiment(slave.component, fmi2True, 1e-4, 3.0, fmi2True, 4.0), fmi2OK);
  ASSERT_EQ(fmi2EnterInitializationMode(slave.component), fmi2OK);
  check("initialization mode");
  EXPECT_EQ(slave.step(99.0, 1.0), fmi2Error);
  check("after a refused call");
}
