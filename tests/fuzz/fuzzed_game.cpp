#include "fuzzed_game.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "resource_location.hpp"

using namespace mixed_order_game;

FuzzedGame::FuzzedGame(const std::string& name)
    : resources(std::string("file://" MIXED_ORDER_GAME_FUZZED_GAMES "/") + name),
      model(content_of(std::string(MIXED_ORDER_GAME_FUZZED_GAMES "/") + name + "/game.toml")) {
  for (int k = 0; k < model.variables.size(); ++k) {
    of_type[static_cast<int>(model.variables.family(k).type)].push_back(static_cast<fmi2ValueReference>(k));
  }
}

static void count_message(fmi2ComponentEnvironment instance, fmi2String name, fmi2Status, fmi2String category,
                          fmi2String message, ...) {
  require(name != nullptr && category != nullptr && message != nullptr && *message != '\0', "messages are whole");
  ++static_cast<FuzzedInstance*>(instance)->messages;
}

const std::vector<FuzzedGame>& fuzzed_games() {
  static const std::vector<FuzzedGame> games = [] {
    std::vector<FuzzedGame> read;
    for (const char* name : {"two_scalar_players", "vector_centers", "small_weight_bound", "five_vehicles",
                             "interleaved_orders", "switching", "one_player", "external_plant"}) {
      read.emplace_back(name);
    }
    return read;
  }();
  return games;
}

FuzzedInstance::FuzzedInstance(const FuzzedGame& of, fmi2Type type) : game(of) {
  callbacks_.componentEnvironment = this;
  callbacks_.logger = count_message;
  component = fmi2Instantiate("fuzzed", type, game.model.guid.c_str(), game.resources.c_str(), &callbacks_, fmi2False,
                              fmi2False);
}

FuzzedInstance::~FuzzedInstance() { fmi2FreeInstance(component); }

void FuzzedInstance::start() {
  require(fmi2SetupExperiment(component, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK &&
              fmi2EnterInitializationMode(component) == fmi2OK && fmi2ExitInitializationMode(component) == fmi2OK,
          "a fresh instance starts");
}

std::optional<std::vector<char>> FuzzedInstance::bytes() const {
  fmi2FMUstate state = nullptr;
  if (fmi2GetFMUstate(component, &state) != fmi2OK) return std::nullopt;
  std::size_t size = 0;
  require(fmi2SerializedFMUstateSize(component, state, &size) == fmi2OK, "a saved state has a size");
  std::vector<char> bytes(size);
  require(fmi2SerializeFMUstate(component, state, bytes.data(), size) == fmi2OK, "a saved state can be serialized");
  require(fmi2FreeFMUstate(component, &state) == fmi2OK && state == nullptr, "a saved state can be freed");
  return bytes;
}

std::vector<double> FuzzedInstance::values() const {
  std::vector<double> all;
  const auto add = [&]<typename Value>(Type type,
                                       fmi2Status (*get)(fmi2Component, const fmi2ValueReference*, size_t, Value*)) {
    const auto& references = game.of_type[static_cast<int>(type)];
    std::vector<Value> values(references.size());
    if (get(component, references.data(), references.size(), values.data()) == fmi2OK) {
      all.insert(all.end(), values.begin(), values.end());
      return;
    }
    for (const fmi2ValueReference& reference : references) {  // those that can be read
      if (get(component, &reference, 1, values.data()) == fmi2OK) all.push_back(values[0]);
    }
  };
  add(Type::real, fmi2GetReal);
  add(Type::integer, fmi2GetInteger);
  add(Type::boolean, fmi2GetBoolean);
  for (const double value : all) require(std::isfinite(value), "what is read under fmi2OK is finite");
  return all;
}

void require(bool kept, const char* promise) {
  if (kept) return;
  std::fprintf(stderr, "broken: %s\n", promise);
  std::abort();
}

bool same(std::span<const double> a, std::span<const double> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}
