// The complete state of an instance, in memory and as portable bytes.
//
// Bytes: magic, format, GUID, payload length, payload, fingerprint of all before it; little-endian, without pointers.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "co_simulation.hpp"
#include "experiment.hpp"
#include "lifecycle.hpp"
#include "model_exchange.hpp"

namespace mixed_order_game {

struct Snapshot {
  Interface interface = Interface::co_simulation;
  Phase phase = Phase::instantiated;
  Experiment experiment;
  std::vector<Real> settings;  ///< as ModelVariables::save gives them
  // once the run has begun, one of them
  std::optional<CoSimulation::Point> co_simulation;
  std::optional<ModelExchange::Point> model_exchange;
};

/// What the snapshots of one instance have in common.
struct SnapshotShape {
  Interface interface = Interface::co_simulation;
  std::size_t settings = 0;
  std::size_t states = 0;
  std::size_t inputs = 0;
  const Parameters* parameters = nullptr;  ///< whose conditions have modes
  std::int64_t steps = 0;                  ///< the most that it can ask to repeat
};

std::size_t serialized_size(const Snapshot& snapshot, std::string_view guid);
std::vector<char> to_bytes(const Snapshot& snapshot, std::string_view guid);
/// Throws Error, saying why, when the bytes are not a snapshot of this model and interface.
Snapshot from_bytes(std::span<const char> bytes, std::string_view guid, const SnapshotShape& shape);

}  // namespace mixed_order_game
