// The games that are fuzzed, and what both fuzz targets ask of an instance.
#pragma once

#include <fmi2Functions.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "model.hpp"

struct FuzzedGame {
  explicit FuzzedGame(const std::string& name);

  std::string resources;  ///< URI
  mixed_order_game::Model model;
  std::vector<fmi2ValueReference> of_type[3];  ///< value references by mixed_order_game::Type
};

/// Of different sizes: one and two coordinates, two to six players, one to eleven neurons, weights that reach the
/// sphere, controls that reach their bounds, a player apart, a plant outside.
const std::vector<FuzzedGame>& fuzzed_games();

/// An instance whose messages are counted; null when fmi2Instantiate refused it.
struct FuzzedInstance {
  explicit FuzzedInstance(const FuzzedGame& of, fmi2Type type = fmi2CoSimulation);
  ~FuzzedInstance();
  FuzzedInstance(const FuzzedInstance&) = delete;
  FuzzedInstance& operator=(const FuzzedInstance&) = delete;

  /// From instantiated to running.
  void start();
  /// The state now; nothing when it cannot be saved.
  [[nodiscard]] std::optional<std::vector<char>> bytes() const;
  /// Every variable that can be read, bit for bit; aborts when one is read as not finite.
  [[nodiscard]] std::vector<double> values() const;

  const FuzzedGame& game;
  long messages = 0;
  fmi2Component component = nullptr;

 private:
  fmi2CallbackFunctions callbacks_{};
};

/// Aborts with a sentence when a promise of the FMU is broken.
void require(bool kept, const char* promise);

/// Bit for bit.
bool same(std::span<const double> a, std::span<const double> b);
