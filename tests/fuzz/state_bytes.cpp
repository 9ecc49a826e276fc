// Serialized states from hostile bytes: refused, or restored to something that is finite and goes on. Either way the
// instance keeps working. The first byte chooses the game; the rest is tried as it is and with its checksum mended.
#include <algorithm>
#include <cmath>

#include "fingerprint.hpp"
#include "fuzzed_game.hpp"

using namespace mixed_order_game;

namespace {

/// An instance in the middle of a run, to which every input returns it.
struct Runner {
  explicit Runner(const FuzzedGame& game) : instance(game) {
    instance.start();
    require(fmi2DoStep(instance.component, 0.0, 0.25, fmi2True) == fmi2OK, "a fresh instance runs");
    require(fmi2GetFMUstate(instance.component, &home) == fmi2OK, "a running instance can be saved");
    values = instance.values();
  }

  FuzzedInstance instance;
  fmi2FMUstate home = nullptr;
  std::vector<double> values;
};

/// Puts the right GUID, length and checksum around the content.
std::vector<char> mended(std::span<const char> bytes, std::span<const char> whole) {
  constexpr std::size_t seal = 16;
  const std::size_t header = std::min<std::size_t>(whole.size(), 8 + 4 + 4 + 38 + 8);
  std::vector<char> result(bytes.begin(), bytes.end());
  if (result.size() < header + seal) return result;
  std::copy_n(whole.begin(), header - 8, result.begin());
  const std::size_t payload = result.size() - header - seal;
  for (std::size_t k = 0; k < 8; ++k) result[header - 8 + k] = static_cast<char>(payload >> (8 * k) & 0xFF);
  Fingerprint fingerprint;
  fingerprint.add({result.data(), result.size() - seal});
  std::size_t position = result.size() - seal;
  for (const std::uint32_t part : fingerprint.value()) {
    for (int k = 0; k < 4; ++k) result[position++] = static_cast<char>(part >> (8 * k) & 0xFF);
  }
  return result;
}

void attempt(Runner& runner, std::span<const char> bytes) {
  const fmi2Component c = runner.instance.component;
  fmi2FMUstate state = nullptr;
  if (fmi2DeSerializeFMUstate(c, bytes.data(), bytes.size(), &state) != fmi2OK) {
    require(state == nullptr, "refused bytes make no state");
    return;
  }
  if (fmi2SetFMUstate(c, state) == fmi2OK) {
    (void)runner.instance.values();
    double t = 0.0;
    if (fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &t) == fmi2OK && fmi2DoStep(c, t, 1e-3, fmi2True) == fmi2OK) {
      (void)runner.instance.values();
    }
  }
  require(fmi2FreeFMUstate(c, &state) == fmi2OK, "a state can be freed");
  require(fmi2SetFMUstate(c, runner.home) == fmi2OK, "the own state can be restored");
  require(same(runner.instance.values(), runner.values), "the own state is restored bit for bit");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<std::unique_ptr<Runner>> runners = [] {
    std::vector<std::unique_ptr<Runner>> made;
    for (const FuzzedGame& game : fuzzed_games()) made.push_back(std::make_unique<Runner>(game));
    return made;
  }();
  if (size == 0) return 0;
  Runner& runner = *runners[data[0] % runners.size()];
  const std::span<const char> bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  attempt(runner, bytes);
  attempt(runner, mended(bytes, *runner.instance.bytes()));
  return 0;
}
