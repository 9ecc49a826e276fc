// Lifecycle, failed integrations, threads, exported symbols, hostile arguments and messages: behaviours 20 to 25.
#include <dlfcn.h>
#include <malloc.h>

#include <cfenv>
#include <clocale>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "errors.hpp"
#include "logger.hpp"
#include "resource_location.hpp"
#include "slave.hpp"

using namespace mixed_order_game;

namespace {

// x' = 1e3 x^2 blows up within milliseconds
std::string exploding_game() {
  return small_game_with({{"dimension = 2\n", "dimension = 2\n[strategy]\nrobust = false\n"},
                          {"square = [[2, [0.05, 0.04]]]", "square = [[1, [1000.0, 0.0]]]"}});
}

std::string output_of(const std::string& command) {
  std::string text;
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return text;
  char line[512];
  while (std::fgets(line, sizeof line, pipe) != nullptr) text += line;
  pclose(pipe);
  return text;
}

std::vector<double> course(Slave& slave) {
  slave.initialize();
  slave.run(0.0, 2.0, 40);
  return slave.all();
}

}  // namespace

TEST(Behaviour20Lifecycle, WrongOrderIsRefusedAndHarmless) {
  Slave slave;
  const fmi2Component c = slave.component;
  const auto refused = [&](fmi2Status status) {
    EXPECT_EQ(status, fmi2Error);
    EXPECT_NE(slave.last_message().find("not allowed in the state"), std::string::npos) << slave.last_message();
    slave.log.clear();
  };
  refused(fmi2ExitInitializationMode(c));
  refused(fmi2DoStep(c, 0.0, 0.1, fmi2True));
  refused(fmi2Terminate(c));
  refused(fmi2CancelStep(c));
  ASSERT_EQ(fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0), fmi2OK);
  ASSERT_EQ(fmi2EnterInitializationMode(c), fmi2OK);
  refused(fmi2EnterInitializationMode(c));
  refused(fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0));
  refused(fmi2DoStep(c, 0.0, 0.1, fmi2True));
  refused(fmi2Terminate(c));
  ASSERT_EQ(fmi2ExitInitializationMode(c), fmi2OK);
  refused(fmi2ExitInitializationMode(c));
  refused(fmi2EnterInitializationMode(c));
  refused(fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0));
  refused(fmi2CancelStep(c));
  ASSERT_EQ(slave.step(0.0, 0.1), fmi2OK) << "the state machine did not move";
  ASSERT_EQ(fmi2Terminate(c), fmi2OK);
  refused(fmi2Terminate(c));
  refused(slave.step(0.1, 0.1));
  refused(slave.set("k1", 1.0));
  refused(slave.set("d_ext[1,1]", 1.0));
  EXPECT_EQ(slave.get("time"), 0.1) << "reading still works";
  ASSERT_EQ(fmi2Reset(c), fmi2OK);
  slave.initialize();
  EXPECT_EQ(slave.step(0.0, 0.1), fmi2OK);
}

TEST(Behaviour20Lifecycle, InputsCanBeSetAndAllReadRightAfterInstantiate) {
  Slave slave;
  EXPECT_EQ(slave.set("d_ext[1,1]", 1.0), fmi2OK);
  EXPECT_EQ(slave.all().size(), static_cast<std::size_t>(slave.model().variables.size()));
}

TEST(Behaviour20FailedIntegration, IsAnErrorFromWhichResetAndRestoreHelp) {
  Slave slave(exploding_game());
  const fmi2Component c = slave.component;
  slave.initialize();
  ASSERT_EQ(slave.step(0.0, 1e-5), fmi2OK) << slave.last_message();
  fmi2FMUstate saved = nullptr;
  ASSERT_EQ(fmi2GetFMUstate(c, &saved), fmi2OK);
  const auto good = slave.all();
  ASSERT_EQ(slave.step(1e-5, 1.0), fmi2Error);
  for (const char* part : {"t = 1e-05", "h = 1", "failed"}) {
    EXPECT_NE(slave.last_message().find(part), std::string::npos) << slave.last_message();
  }
  EXPECT_EQ(slave.step(1e-5, 1e-6), fmi2Error) << "no step from the error state";
  EXPECT_EQ(slave.set("k1", 1.0), fmi2Error);
  EXPECT_EQ(slave.get("time"), 1e-5);
  EXPECT_EQ(slave.get("x[1,1]"), good[slave.reference("x[1,1]")]) << "the last success";
  EXPECT_EQ(slave.output_derivative("x[1,1]"), slave.get("der(x[1,1])"));
  fmi2Status last = fmi2OK;
  ASSERT_EQ(fmi2GetStatus(c, fmi2DoStepStatus, &last), fmi2OK);
  EXPECT_EQ(last, fmi2Error);
  double time = 0.0;
  ASSERT_EQ(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &time), fmi2OK);
  EXPECT_EQ(time, 1e-5);
  const fmi2ValueReference known = slave.reference("d_ext[1,1]");
  const fmi2ValueReference unknown = slave.reference("u[1,1]");
  const double one = 1.0;
  double derivative = 0.0;
  EXPECT_EQ(fmi2GetDirectionalDerivative(c, &unknown, 1, &known, 1, &one, &derivative), fmi2OK);
  fmi2Boolean terminated = fmi2True;
  ASSERT_EQ(fmi2GetBooleanStatus(c, fmi2Terminated, &terminated), fmi2OK);
  EXPECT_EQ(terminated, fmi2False);
  fmi2FMUstate none = nullptr;
  EXPECT_EQ(fmi2GetFMUstate(c, &none), fmi2Error);

  ASSERT_EQ(fmi2SetFMUstate(c, saved), fmi2OK) << slave.last_message();
  EXPECT_TRUE(same_values(slave, slave.all(), good));
  EXPECT_EQ(slave.step(1e-5, 1e-5), fmi2OK);

  ASSERT_EQ(slave.step(2e-5, 1.0), fmi2Error);
  ASSERT_EQ(fmi2Terminate(c), fmi2OK);
  EXPECT_EQ(fmi2GetFMUstate(c, &none), fmi2Error) << "there is nothing whole to save";
  ASSERT_EQ(fmi2Reset(c), fmi2OK);
  slave.initialize();
  ASSERT_EQ(slave.step(0.0, 1e-5), fmi2OK);
  EXPECT_TRUE(same_values(slave, slave.all(), good));
  EXPECT_EQ(fmi2FreeFMUstate(c, &saved), fmi2OK);
}

TEST(Behaviour21Instances, InterleavedOnesAreIndependent) {
  Slave alone_a;
  Slave alone_b(five_vehicles());
  const auto expected_a = course(alone_a);
  const auto expected_b = course(alone_b);
  Slave a;
  Slave b(five_vehicles());
  a.initialize();
  b.initialize();
  for (int k = 0; k < 40; ++k) {
    const double h = 2.0 / 40;
    ASSERT_EQ(a.step(0.0 + k * h, h), fmi2OK);
    ASSERT_EQ(b.step(0.0 + k * h, h), fmi2OK);
  }
  EXPECT_TRUE(same_values(a, a.all(), expected_a));
  EXPECT_TRUE(same_values(b, b.all(), expected_b));
}

TEST(Behaviour21Instances, SixteenThreadsWithThreeEachAreIndependent) {
  constexpr std::size_t threads = 16;
  constexpr int steps = 10;
  constexpr double h = 0.0625;
  const std::vector<std::string> games = {small_game(), five_vehicles(), vector_centers_game()};
  // Every thread has its own gain, so that no two instances do the same; its instances take turns.
  const auto gain = [](std::size_t thread) { return 5.0 + 0.25 * static_cast<double>(thread); };
  const auto run_together = [&](std::size_t thread) {
    std::vector<std::unique_ptr<Slave>> slaves;
    for (const std::string& game : games) {
      slaves.push_back(std::make_unique<Slave>(game));
      EXPECT_EQ(slaves.back()->set("k3", gain(thread)), fmi2OK);
      slaves.back()->initialize();
    }
    for (int k = 0; k < steps; ++k) {
      for (const auto& slave : slaves) EXPECT_EQ(slave->step(k * h, h), fmi2OK);
    }
    std::vector<std::vector<double>> values;
    for (const auto& slave : slaves) values.push_back(slave->all());
    return values;
  };
  std::vector<std::vector<std::vector<double>>> expected;
  for (std::size_t thread = 0; thread < threads; ++thread) {
    expected.emplace_back();
    for (const std::string& game : games) {
      Slave alone(game);
      ASSERT_EQ(alone.set("k3", gain(thread)), fmi2OK);
      alone.initialize();
      alone.run(0.0, steps * h, steps);
      expected.back().push_back(alone.all());
    }
  }
  std::vector<std::vector<std::vector<double>>> seen(threads);
  std::vector<std::thread> running;
  for (std::size_t thread = 0; thread < threads; ++thread) {
    running.emplace_back([&, thread] { seen[thread] = run_together(thread); });
  }
  for (std::thread& thread : running) thread.join();
  for (std::size_t thread = 0; thread < threads; ++thread) {
    for (std::size_t k = 0; k < games.size(); ++k) {
      EXPECT_TRUE(same_values(Slave(games[k]), seen[thread][k], expected[thread][k])) << "thread " << thread;
    }
  }
}

TEST(Behaviour22Symbols, ExactlyTheStandardsFunctionsAreExported) {
  if (MIXED_ORDER_GAME_SANITIZED) GTEST_SKIP() << "sanitizers export their own";
  std::set<std::string> expected;
  for (const char* name : {"GetTypesPlatform",
                           "GetVersion",
                           "SetDebugLogging",
                           "Instantiate",
                           "FreeInstance",
                           "SetupExperiment",
                           "EnterInitializationMode",
                           "ExitInitializationMode",
                           "Terminate",
                           "Reset",
                           "GetReal",
                           "GetInteger",
                           "GetBoolean",
                           "GetString",
                           "SetReal",
                           "SetInteger",
                           "SetBoolean",
                           "SetString",
                           "GetFMUstate",
                           "SetFMUstate",
                           "FreeFMUstate",
                           "SerializedFMUstateSize",
                           "SerializeFMUstate",
                           "DeSerializeFMUstate",
                           "GetDirectionalDerivative",
                           "EnterEventMode",
                           "NewDiscreteStates",
                           "EnterContinuousTimeMode",
                           "CompletedIntegratorStep",
                           "SetTime",
                           "SetContinuousStates",
                           "GetDerivatives",
                           "GetEventIndicators",
                           "GetContinuousStates",
                           "GetNominalsOfContinuousStates",
                           "SetRealInputDerivatives",
                           "GetRealOutputDerivatives",
                           "DoStep",
                           "CancelStep",
                           "GetStatus",
                           "GetRealStatus",
                           "GetIntegerStatus",
                           "GetBooleanStatus",
                           "GetStringStatus"}) {
    expected.insert("fmi2" + std::string(name));
  }
  std::set<std::string> exported;
  std::istringstream lines(output_of("nm -D --defined-only '" MIXED_ORDER_GAME_LIBRARY "'"));
  for (std::string address, kind, name; lines >> address >> kind >> name;) exported.insert(name);
  EXPECT_EQ(exported, expected);
}

namespace {

/// The library loaded once more, with its symbols in everybody's sight.
struct LoadedLibrary {
  explicit LoadedLibrary(const std::string& path) : handle(dlopen(path.c_str(), RTLD_NOW | RTLD_GLOBAL)) {
    EXPECT_NE(handle, nullptr) << dlerror();
  }
  ~LoadedLibrary() { dlclose(handle); }
  LoadedLibrary(const LoadedLibrary&) = delete;
  LoadedLibrary& operator=(const LoadedLibrary&) = delete;

  template <typename Function>
  Function* function(Function*, const char* name) const {
    return reinterpret_cast<Function*>(dlsym(handle, name));
  }

  void* handle;
};

/// An instance of the small game in a loaded library.
struct LoadedInstance {
  LoadedInstance(const LoadedLibrary& in, const Slave& like) : library(in) {
    const std::string uri = "file://" + resources_of(small_game());
    component = library.function(&fmi2Instantiate, "fmi2Instantiate")(
        "loaded", fmi2CoSimulation, like.model().guid.c_str(), uri.c_str(), nullptr, fmi2False, fmi2False);
    EXPECT_EQ(library.function(&fmi2EnterInitializationMode, "fmi2EnterInitializationMode")(component), fmi2OK);
    EXPECT_EQ(library.function(&fmi2ExitInitializationMode, "fmi2ExitInitializationMode")(component), fmi2OK);
  }
  ~LoadedInstance() { library.function(&fmi2FreeInstance, "fmi2FreeInstance")(component); }
  LoadedInstance(const LoadedInstance&) = delete;
  LoadedInstance& operator=(const LoadedInstance&) = delete;

  void step(double t, double h) const {
    EXPECT_EQ(library.function(&fmi2DoStep, "fmi2DoStep")(component, t, h, fmi2True), fmi2OK);
  }
  void expect_values_of(Slave& slave) const {
    for (const char* name : {"x[1,1]", "v[2,2]", "u[3,1]", "nash_error"}) {
      const fmi2ValueReference vr = slave.reference(name);
      double value = 0.0;
      EXPECT_EQ(library.function(&fmi2GetReal, "fmi2GetReal")(component, &vr, 1, &value), fmi2OK);
      EXPECT_EQ(value, slave.get(name)) << name;
    }
  }

  const LoadedLibrary& library;
  fmi2Component component = nullptr;
};

}  // namespace

TEST(Behaviour22Symbols, WorksBesideAForeignSundials) {
  if (MIXED_ORDER_GAME_SANITIZED) GTEST_SKIP() << "loads a second copy of what is linked in";
  void* const vectors = dlopen("libsundials_nvecserial.so", RTLD_NOW | RTLD_GLOBAL);
  void* const solver = dlopen("libsundials_cvode.so", RTLD_NOW | RTLD_GLOBAL);
  if (vectors == nullptr || solver == nullptr) GTEST_SKIP() << "there is no SUNDIALS to load here";
  // what a host does with its own SUNDIALS, by the names that the FMU's own copy has too
  const auto foreign = [&](const char* name) {
    void* const found = dlsym(RTLD_DEFAULT, name);
    EXPECT_NE(found, nullptr) << name;
    return found;
  };
  const auto create_context = reinterpret_cast<int (*)(void*, void**)>(foreign("SUNContext_Create"));
  const auto free_context = reinterpret_cast<int (*)(void**)>(foreign("SUNContext_Free"));
  const auto new_vector = reinterpret_cast<void* (*)(std::int64_t, void*)>(foreign("N_VNew_Serial"));
  const auto fill = reinterpret_cast<void (*)(double, void*)>(foreign("N_VConst"));
  const auto dot = reinterpret_cast<double (*)(void*, void*)>(foreign("N_VDotProd"));
  const auto destroy = reinterpret_cast<void (*)(void*)>(foreign("N_VDestroy"));
  const auto create_solver = reinterpret_cast<void* (*)(int, void*)>(foreign("CVodeCreate"));
  const auto free_solver = reinterpret_cast<void (*)(void**)>(foreign("CVodeFree"));
  void* context = nullptr;
  ASSERT_EQ(create_context(nullptr, &context), 0);
  void* const vector = new_vector(3, context);
  void* memory = create_solver(2, context);
  ASSERT_NE(vector, nullptr);
  ASSERT_NE(memory, nullptr);

  Slave linked;
  linked.initialize();
  linked.run(0.0, 2.0, 4);
  const LoadedLibrary library(MIXED_ORDER_GAME_LIBRARY);
  ASSERT_NE(library.function(&fmi2Instantiate, "fmi2Instantiate"), &fmi2Instantiate) << "the loaded copy is meant";
  const LoadedInstance instance(library, linked);
  for (int k = 0; k < 4; ++k) {
    instance.step(0.5 * k, 0.5);
    fill(0.5 * k, vector);
    EXPECT_EQ(dot(vector, vector), 3.0 * 0.25 * k * k);
  }
  instance.expect_values_of(linked);
  free_solver(&memory);
  destroy(vector);
  EXPECT_EQ(free_context(&context), 0);
}

TEST(Behaviour22Symbols, WorksTwiceUnderDifferentNames) {
  if (MIXED_ORDER_GAME_SANITIZED) GTEST_SKIP() << "loads a second copy of what is linked in";
  const std::string copy = resources_of("title = 'copy'", "copy") + "/AnotherName.so";
  std::filesystem::copy_file(MIXED_ORDER_GAME_LIBRARY, copy, std::filesystem::copy_options::overwrite_existing);
  Slave linked;
  linked.initialize();
  linked.run(0.0, 2.0, 4);
  const LoadedLibrary one(MIXED_ORDER_GAME_LIBRARY);
  const LoadedLibrary other(copy);
  ASSERT_NE(one.function(&fmi2DoStep, "fmi2DoStep"), other.function(&fmi2DoStep, "fmi2DoStep"));
  const LoadedInstance first(one, linked);
  const LoadedInstance second(other, linked);
  for (int k = 0; k < 4; ++k) {
    first.step(0.5 * k, 0.5);
    second.step(0.5 * k, 0.5);
  }
  first.expect_values_of(linked);
  second.expect_values_of(linked);
}

TEST(Behaviour25Memory, LoadingAndUnloadingLeavesNothingBehind) {
  if (MIXED_ORDER_GAME_SANITIZED) GTEST_SKIP() << "sanitizers keep what was freed";
  const Slave like;
  const auto load_and_run = [&] {
    const LoadedLibrary library(MIXED_ORDER_GAME_LIBRARY);
    const LoadedInstance instance(library, like);
    instance.step(0.0, 0.1);
    double value = 0.0;
    const fmi2ValueReference unknown = 0xFFFFFFFF;  // an exception
    EXPECT_EQ(library.function(&fmi2GetReal, "fmi2GetReal")(instance.component, &unknown, 1, &value), fmi2Error);
  };
  for (int k = 0; k < 3; ++k) load_and_run();
  constexpr int loads = 20;
  const std::size_t before = mallinfo2().uordblks;
  for (int k = 0; k < loads; ++k) load_and_run();
  EXPECT_LT(mallinfo2().uordblks, before + loads * 1024);
}

TEST(Behaviour23Libraries, OnlyTheSystemsOwnAreNeeded) {
  if (MIXED_ORDER_GAME_SANITIZED) GTEST_SKIP() << "sanitizers need their own";
  const std::string needed = output_of("objdump -p '" MIXED_ORDER_GAME_LIBRARY "' | grep NEEDED");
  ASSERT_FALSE(needed.empty());
  std::istringstream lines(needed);
  for (std::string word, library; lines >> word >> library;) {
    EXPECT_TRUE(library.starts_with("libc.so") || library.starts_with("libm.so") || library.starts_with("ld-linux"))
        << library;
  }
}

TEST(Behaviour24Instantiate, SurvivesMissingArguments) {
  Slave good;
  const std::string& guid = good.model().guid;
  const std::string uri = "file://" + resources_of(small_game());
  fmi2CallbackFunctions empty{};
  const auto attempt = [&](const char* name, const char* with_guid, const char* with_uri,
                           const fmi2CallbackFunctions* callbacks) {
    const fmi2Component c =
        fmi2Instantiate(name, fmi2CoSimulation, with_guid, with_uri, callbacks, fmi2False, fmi2True);
    if (c == nullptr) return false;
    double value = 0.0;
    const fmi2ValueReference unknown = 0xFFFFFFFF;
    EXPECT_EQ(fmi2GetReal(c, &unknown, 1, &value), fmi2Error);  // tells nobody
    EXPECT_EQ(fmi2EnterInitializationMode(c), fmi2OK);
    EXPECT_EQ(fmi2ExitInitializationMode(c), fmi2OK);
    EXPECT_EQ(fmi2DoStep(c, 0.0, 0.1, fmi2False), fmi2OK);
    fmi2FreeInstance(c);
    return true;
  };
  for (const char* name : {static_cast<const char*>(nullptr), "", "name"}) {
    for (const fmi2CallbackFunctions* callbacks :
         {static_cast<const fmi2CallbackFunctions*>(nullptr), static_cast<const fmi2CallbackFunctions*>(&empty)}) {
      EXPECT_TRUE(attempt(name, guid.c_str(), uri.c_str(), callbacks));
      for (const char* bad_guid : {static_cast<const char*>(nullptr), "", "{00000000-0000-0000-0000-000000000000}"}) {
        EXPECT_FALSE(attempt(name, bad_guid, uri.c_str(), callbacks));
      }
      for (const char* bad_uri : {static_cast<const char*>(nullptr), "", "file:", "file://", "file:///nowhere",
                                  "http://localhost/x", "file://elsewhere/x", "file:///%00", "/", "file:///"}) {
        EXPECT_FALSE(attempt(name, guid.c_str(), bad_uri, callbacks)) << (bad_uri == nullptr ? "null" : bad_uri);
      }
    }
  }
}

TEST(Behaviour24Instantiate, TellsWhyNot) {
  std::vector<LogEntry> told;
  fmi2CallbackFunctions callbacks{};
  callbacks.componentEnvironment = &told;
  callbacks.logger = record;
  const auto reason = [&](const std::string& game, const char* guid) {
    told.clear();
    EXPECT_EQ(fmi2Instantiate("name", fmi2CoSimulation, guid, ("file://" + resources_of(game)).c_str(), &callbacks,
                              fmi2False, fmi2False),
              nullptr);
    EXPECT_EQ(told.size(), 1U);
    if (told.empty()) return std::string();
    EXPECT_EQ(told[0].status, fmi2Error);
    EXPECT_EQ(told[0].category, "logStatusError");
    return told[0].message;
  };
  EXPECT_NE(reason(small_game(), "{wrong}").find("GUID"), std::string::npos);
  const std::string bad = reason(small_game_with({{"k1 = 6.0", "k1 = -6.0"}}), "{any}");
  EXPECT_NE(bad.find("k1"), std::string::npos) << bad;
  EXPECT_NE(bad.find("game.toml"), std::string::npos) << bad;
  EXPECT_FALSE(reason("this is [not TOML", "{any}").empty());
  EXPECT_FALSE(reason("", "{any}").empty());
}

TEST(Behaviour24ResourceLocation, IsDecoded) {
  EXPECT_EQ(path_of("file:///a/b"), "/a/b");
  EXPECT_EQ(path_of("file:/a/b"), "/a/b");
  EXPECT_EQ(path_of("file://localhost/a/b"), "/a/b");
  EXPECT_EQ(path_of("FILE:///A/b"), "/A/b");
  EXPECT_EQ(path_of("File:/A/b"), "/A/b");
  EXPECT_EQ(path_of("file://LocalHost/A/b"), "/A/b");
  EXPECT_EQ(path_of("file:///a%20b/%C3%A9%25"), "/a b/\xC3\xA9%");
  EXPECT_EQ(path_of("file:///a%2"), "/a%2");
  EXPECT_EQ(path_of("file:///100%zz"), "/100%zz");
  EXPECT_EQ(path_of("/a%20b"), "/a%20b") << "a plain path is taken as it is";
  EXPECT_EQ(path_of("a b/c"), "a b/c");
  for (const char* bad : {"", "http://x/y", "file:", "file://", "file://host", "file://host/x", "file:///%00x",
                          "HTTP://x/y", "file://localhosts/x"}) {
    EXPECT_THROW((void)path_of(bad), Error) << bad;
  }
}

TEST(Behaviour24ResourceLocation, BlanksAndLettersBeyondAscii) {
  const std::string folder = resources_of(small_game(), "r\xC3\xA9sum\xC3\xA9 of #1 100%");
  Slave good;
  std::string encoded;
  for (const char character : folder) {
    char code[8];
    const auto byte = static_cast<unsigned char>(character);
    if (byte > 0x7E || byte == ' ' || byte == '#' || byte == '%') {
      std::snprintf(code, sizeof code, "%%%02x", byte);
      encoded += code;
    } else {
      encoded += character;
    }
  }
  for (const std::string& location :
       {"file://" + encoded, "file:" + encoded, "file://localhost" + encoded, "file://" + encoded + "/", folder}) {
    const fmi2Component c = fmi2Instantiate("name", fmi2CoSimulation, good.model().guid.c_str(), location.c_str(),
                                            nullptr, fmi2False, fmi2False);
    EXPECT_NE(c, nullptr) << location;
    fmi2FreeInstance(c);
  }
}

TEST(Behaviour25Messages, AreHarmlessAndHaveACategory) {
  EXPECT_EQ(harmless("100%s of #r1#\n"), "100_s of _r1_ ");
  Slave slave(small_game(), true);
  slave.initialize();
  slave.run(0.0, 0.2, 2);
  EXPECT_EQ(slave.step(0.0, -1.0), fmi2Error);
  EXPECT_EQ(slave.set("k1", -1.0), fmi2Error);
  ASSERT_EQ(fmi2Terminate(slave.component), fmi2OK);
  std::set<std::string> categories;
  for (const LogEntry& entry : slave.log) {
    EXPECT_EQ(entry.message.find_first_of("%#\n"), std::string::npos) << entry.message;
    EXPECT_FALSE(entry.message.empty());
    EXPECT_EQ(entry.instance, "slave");
    EXPECT_EQ(entry.status == fmi2Error, entry.category == "logStatusError");
    categories.insert(entry.category);
  }
  EXPECT_EQ(categories, (std::set<std::string>{"logStatusError", "logEvents"}));
}

TEST(Behaviour25Messages, LoggingOffGivesErrorsOnly) {
  Slave slave(small_game(), false);
  slave.initialize();
  slave.run(0.0, 0.2, 2);
  EXPECT_TRUE(slave.log.empty());
  EXPECT_EQ(slave.step(0.0, -1.0), fmi2Error);
  EXPECT_EQ(slave.log.size(), 1U);
  const char* events = "logEvents";
  ASSERT_EQ(fmi2SetDebugLogging(slave.component, fmi2True, 1, &events), fmi2OK);
  ASSERT_EQ(fmi2Terminate(slave.component), fmi2OK);
  EXPECT_EQ(slave.log.size(), 2U);
  ASSERT_EQ(fmi2SetDebugLogging(slave.component, fmi2False, 0, nullptr), fmi2OK);
  ASSERT_EQ(fmi2Reset(slave.component), fmi2OK);
  slave.initialize();
  EXPECT_EQ(slave.log.size(), 2U);
}

TEST(Behaviour25Surroundings, AreUntouchedAndWithoutInfluence) {
  Slave plain;
  const auto expected = course(plain);
  Slave slave;
  Slave exploding(exploding_game());
  const std::string& guid = slave.model().guid;
  const std::string uri = "file://" + resources_of(small_game());
  const std::string folder = std::filesystem::current_path();

  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  ASSERT_EQ(std::fesetround(FE_UPWARD), 0);
  feclearexcept(FE_ALL_EXCEPT);
  feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
  const fmi2Component other =
      fmi2Instantiate("other", fmi2CoSimulation, guid.c_str(), uri.c_str(), nullptr, fmi2False, fmi2False);
  exploding.initialize();
  const fmi2Status failed = exploding.step(0.0, 1.0);
  slave.initialize();
  fmi2Status fine = fmi2OK;
  double t = 0.0;  // h is exact, so that the host's rounding does not move the communication points
  for (const double h = 0.03125; t < 2.0; t += h) fine = std::max(fine, slave.step(t, h));
  std::vector<double> seen(1);
  const fmi2ValueReference x = slave.reference("x[1,1]");
  fine = std::max(fine, fmi2GetReal(slave.component, &x, 1, seen.data()));
  const int rounding = std::fegetround();
  const int traps = fegetexcept();
  const int raised = std::fetestexcept(FE_ALL_EXCEPT);
  fedisableexcept(FE_ALL_EXCEPT);
  std::fesetround(FE_TONEAREST);
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");

  EXPECT_NE(other, nullptr) << "the GUID does not depend on the host's rounding";
  fmi2FreeInstance(other);
  EXPECT_EQ(failed, fmi2Error);
  EXPECT_EQ(fine, fmi2OK);
  EXPECT_EQ(rounding, FE_UPWARD);
  EXPECT_EQ(traps, FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
  EXPECT_EQ(raised, 0);
  EXPECT_EQ(seen[0], expected[x]) << "the host's rounding and traps do not reach the calculation";
  EXPECT_EQ(std::filesystem::current_path(), folder);
  EXPECT_STREQ(std::setlocale(LC_ALL, nullptr), "C");
}

TEST(Behaviour25Surroundings, ALocaleWithDecimalCommasHasNoInfluence) {
  const std::string folder = resources_of("title = 'locale'", "locales");
  output_of("localedef -i de_DE -f UTF-8 '" + folder + "/de_DE.UTF-8' 2> /dev/null");
  Slave plain;
  const auto expected = course(plain);
  Slave exploding(exploding_game());
  exploding.initialize();
  exploding.step(0.0, 0.0625);
  setenv("LOCPATH", folder.c_str(), 1);
  const bool found = std::setlocale(LC_ALL, "de_DE.UTF-8") != nullptr && std::localeconv()->decimal_point[0] == ',';
  Slave slave;
  const auto seen = course(slave);
  Slave failing(exploding_game());
  failing.initialize();
  const fmi2Status failed = failing.step(0.0, 0.0625);
  const Model again(small_game());
  std::setlocale(LC_ALL, "C");
  unsetenv("LOCPATH");
  if (!found) GTEST_SKIP() << "this machine makes no locale with decimal commas";
  EXPECT_TRUE(same_values(slave, seen, expected));
  EXPECT_EQ(failed, fmi2Error);
  EXPECT_EQ(failing.last_message(), exploding.last_message());
  EXPECT_EQ(again.guid, plain.model().guid);
}

namespace {

/// What a callback finds.
struct Surroundings {
  int rounding = std::fegetround();
  int traps = fegetexcept();
  int flags = std::fetestexcept(FE_ALL_EXCEPT);
  friend bool operator==(const Surroundings&, const Surroundings&) = default;
};

struct Told {
  fmi2Status status;
  Surroundings surroundings;
};

void record_surroundings(fmi2ComponentEnvironment told, fmi2String, fmi2Status status, fmi2String, fmi2String, ...) {
  const Surroundings now;
  static_cast<std::vector<Told>*>(told)->push_back({status, now});
}

}  // namespace

TEST(Behaviour25Callbacks, OfTheLoggerRunInTheHostsFloatingPointEnvironmentAndOthersNever) {
  std::vector<Told> told;
  fmi2CallbackFunctions callbacks{};
  callbacks.componentEnvironment = &told;
  callbacks.logger = record_surroundings;
  callbacks.allocateMemory = [](std::size_t, std::size_t) -> void* { throw std::logic_error("allocateMemory"); };
  callbacks.freeMemory = [](void*) { throw std::logic_error("freeMemory"); };
  callbacks.stepFinished = [](fmi2ComponentEnvironment, fmi2Status) { throw std::logic_error("stepFinished"); };
  const Slave like;
  const std::string uri = "file://" + resources_of(small_game());
  const auto make = [&](fmi2Type type, const std::string& guid) {
    return fmi2Instantiate("name", type, guid.c_str(), uri.c_str(), &callbacks, fmi2False, fmi2True);
  };
  const std::size_t states = like.model().variables.states().size();
  const std::vector<double> huge(states, 1.5e308);
  std::vector<double> rates(states);
  const fmi2ValueReference k1 = like.reference("k1");
  const double negative = -1.0;

  std::feclearexcept(FE_ALL_EXCEPT);
  std::feraiseexcept(FE_OVERFLOW);
  ASSERT_EQ(std::fesetround(FE_DOWNWARD), 0);
  feenableexcept(FE_DIVBYZERO | FE_INVALID);
  const Surroundings host;
  const fmi2Component none = make(fmi2CoSimulation, "{another}");
  const fmi2Component slave = make(fmi2CoSimulation, like.model().guid);
  fmi2EnterInitializationMode(slave);
  fmi2ExitInitializationMode(slave);
  fmi2SetReal(slave, &k1, 1, &negative);
  const fmi2Status step = fmi2DoStep(slave, 0.0, 1.0, fmi2True);
  fmi2DoStep(slave, 0.0, 1.0, fmi2True);
  fmi2Terminate(slave);
  fmi2FreeInstance(slave);
  const fmi2Component model = make(fmi2ModelExchange, like.model().guid);
  fmi2EnterInitializationMode(model);
  fmi2ExitInitializationMode(model);
  fmi2EventInfo info{};
  fmi2NewDiscreteStates(model, &info);
  fmi2EnterContinuousTimeMode(model);
  fmi2SetContinuousStates(model, huge.data(), states);
  const fmi2Status derivatives = fmi2GetDerivatives(model, rates.data(), states);
  fmi2FreeInstance(model);
  const Surroundings afterwards;
  fedisableexcept(FE_ALL_EXCEPT);
  std::fesetround(FE_TONEAREST);
  std::feclearexcept(FE_ALL_EXCEPT);

  EXPECT_EQ(none, nullptr);
  EXPECT_EQ(step, fmi2OK);
  EXPECT_EQ(derivatives, fmi2Discard);
  EXPECT_EQ(afterwards, host);
  std::vector<fmi2Status> statuses;
  for (const Told& one : told) {
    statuses.push_back(one.status);
    EXPECT_EQ(one.surroundings, host) << "message " << statuses.size();
  }
  EXPECT_EQ(statuses, (std::vector{fmi2Error, fmi2OK, fmi2Error, fmi2Error, fmi2OK, fmi2OK, fmi2Discard}));
}
