// The complete state of an instance, in memory and as portable bytes.
//
// Bytes: magic, format, GUID, payload length, payload, fingerprint of all before it; little-endian, without pointers.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "co_simulation.hpp"
#include "lifecycle.hpp"

namespace mixed_order_game {

/// What the importer said about the run.
struct Experiment {
  std::optional<Real> tolerance;
  Real start_time = 0.0;
  std::optional<Real> stop_time;
};

struct Snapshot {
  Phase phase = Phase::instantiated;
  Experiment experiment;
  std::vector<Real> settings;                        ///< as ModelVariables::save gives them
  std::optional<CoSimulation::Point> co_simulation;  ///< once the run has begun
};

/// The lengths that a snapshot of one model has.
struct SnapshotSizes {
  std::size_t settings = 0;
  std::size_t states = 0;
  std::size_t modes = 0;
};

std::size_t serialized_size(const Snapshot& snapshot, std::string_view guid);
std::vector<char> to_bytes(const Snapshot& snapshot, std::string_view guid);
/// Throws Error, saying why, when the bytes are not a snapshot of this model.
Snapshot from_bytes(std::span<const char> bytes, std::string_view guid, const SnapshotSizes& sizes);

}  // namespace mixed_order_game
