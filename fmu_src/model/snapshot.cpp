#include "snapshot.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <concepts>

#include "errors.hpp"
#include "fingerprint.hpp"

namespace mixed_order_game {

namespace {

constexpr std::string_view magic = "MOGstate";
constexpr std::uint32_t format = 5;
constexpr std::size_t fingerprint_size = 16;

class Writer {
 public:
  void byte(std::uint8_t value) { bytes_.push_back(static_cast<char>(value)); }
  void number(std::uint32_t value) { little_endian(value, 4); }
  void number(std::uint64_t value) { little_endian(value, 8); }
  void number(std::int64_t value) { little_endian(static_cast<std::uint64_t>(value), 8); }
  void number(Real value) { little_endian(std::bit_cast<std::uint64_t>(value), 8); }
  void text(std::string_view text) { bytes_.insert(bytes_.end(), text.begin(), text.end()); }
  template <typename Numbers>
  void numbers(const Numbers& values) {
    number(std::uint64_t{values.size()});
    for (const Real value : values) number(value);
  }
  void optional(const std::optional<Real>& value) {
    byte(value ? 1 : 0);
    number(value.value_or(0.0));
  }
  void seal() {
    Fingerprint fingerprint;
    fingerprint.add({bytes_.data(), bytes_.size()});
    for (const std::uint32_t part : fingerprint.value()) number(part);
  }
  std::vector<char>& bytes() { return bytes_; }

 private:
  void little_endian(std::uint64_t value, int count) {
    for (int k = 0; k < count; ++k) byte(static_cast<std::uint8_t>(value >> (8 * k) & 0xFF));
  }

  std::vector<char> bytes_;
};

class Reader {
 public:
  explicit Reader(std::span<const char> bytes) : bytes_(bytes) {}

  std::uint8_t byte() { return static_cast<std::uint8_t>(take(1)[0]); }
  std::uint64_t number(int count = 8) {
    const auto bytes = take(static_cast<std::size_t>(count));
    std::uint64_t value = 0;
    for (int k = 0; k < count; ++k) {
      value |= std::uint64_t{static_cast<unsigned char>(bytes[static_cast<std::size_t>(k)])} << (8 * k);
    }
    return value;
  }
  Real real() {
    const Real value = std::bit_cast<Real>(number());
    if (!std::isfinite(value)) refuse("a number in it is not finite");
    return value;
  }
  std::string_view text(std::size_t length) {
    const auto bytes = take(length);
    return {bytes.data(), bytes.size()};
  }
  template <typename Numbers>
  void numbers(std::size_t expected, Numbers& values) {
    if (number() != expected) refuse("a list in it has another length");
    values.resize(expected);
    for (Real& value : values) value = real();
  }
  bool boolean() {
    const std::uint8_t value = byte();
    if (value > 1) refuse("a flag in it is neither 0 nor 1");
    return value == 1;
  }
  std::optional<Real> optional() {
    const bool present = boolean();
    const Real value = real();
    return present ? std::optional(value) : std::nullopt;
  }
  [[nodiscard]] std::size_t left() const { return bytes_.size() - position_; }

  [[noreturn]] static void refuse(const std::string& reason) {
    throw Error("the bytes are not a state of this FMU: " + reason);
  }

 private:
  std::span<const char> take(std::size_t count) {
    if (count > left()) refuse("they end too early");
    position_ += count;
    return bytes_.subspan(position_ - count, count);
  }

  std::span<const char> bytes_;
  std::size_t position_ = 0;
};

void write_header(Writer& writer, std::string_view guid, std::uint64_t payload) {
  writer.text(magic);
  writer.number(format);
  writer.number(static_cast<std::uint32_t>(guid.size()));
  writer.text(guid);
  writer.number(payload);
}

constexpr std::uint8_t other_mode = 2;

/// One byte where it is 0 or 1, as nearly always.
void write_modes(Writer& writer, const Modes& modes) {
  writer.number(std::uint64_t{modes.size()});
  for (const Real mode : modes) {
    const bool is_boolean = mode == 0.0 || mode == 1.0;
    writer.byte(is_boolean ? static_cast<std::uint8_t>(mode) : other_mode);
    if (!is_boolean) writer.number(mode);
  }
}

std::size_t size_of(const Modes& modes) {
  const auto others = std::count_if(modes.begin(), modes.end(), [](Real mode) { return mode != 0.0 && mode != 1.0; });
  return 8 + modes.size() + 8 * static_cast<std::size_t>(others);
}

void write_statistics(Writer& writer, const Statistics& statistics) {
  for (const std::int64_t count : {statistics.steps, statistics.rate_evaluations, statistics.newton_setups,
                                   statistics.newton_solves, statistics.events}) {
    writer.number(count);
  }
}

std::size_t size_of(const Judgement& judgement) {
  return 10 * 8 + 1 + 2 * 8 + 8 * (judgement.x_star.size() + judgement.side.size());
}

void write_judgement(Writer& writer, const Judgement& judgement) {
  for (const Real value : {judgement.begun, judgement.until, judgement.last_outside, judgement.control_energy,
                           judgement.control_peak, judgement.error_peak, judgement.farthest_beyond,
                           judgement.errors_from, judgement.squared_band, judgement.largest_deviation}) {
    writer.number(value);
  }
  writer.byte(judgement.outside ? 1 : 0);
  writer.numbers(judgement.x_star);
  writer.numbers(judgement.side);
}

void write_co_simulation(Writer& writer, const CoSimulation::Point& point) {
  const auto& [acting, time, checkpoint] = point;
  writer.numbers(acting);
  writer.number(time);
  writer.number(checkpoint.restart_time);
  writer.numbers(checkpoint.restart_state);
  write_modes(writer, checkpoint.restart_modes);
  write_statistics(writer, checkpoint.restart_statistics);
  write_judgement(writer, checkpoint.restart_judgement);
  writer.number(checkpoint.steps_since_restart);
  writer.number(checkpoint.first_step);
  writer.number(checkpoint.time);
  writer.numbers(checkpoint.state);
  write_modes(writer, checkpoint.modes);
  write_statistics(writer, checkpoint.statistics);
  write_judgement(writer, checkpoint.judgement);
}

void write_model_exchange(Writer& writer, const ModelExchange::Point& point) {
  writer.number(point.time);
  writer.numbers(point.state);
  write_modes(writer, point.modes);
  writer.number(point.events);
  writer.number(point.accepted_time);
  writer.numbers(point.accepted_state);
  writer.numbers(point.accepted_inputs);
  write_judgement(writer, point.judgement);
}

void write_payload(Writer& writer, const Snapshot& snapshot) {
  writer.byte(static_cast<std::uint8_t>(snapshot.interface));
  writer.byte(static_cast<std::uint8_t>(snapshot.phase));
  writer.optional(snapshot.experiment.tolerance);
  writer.number(snapshot.experiment.start_time);
  writer.optional(snapshot.experiment.stop_time);
  writer.numbers(snapshot.settings);
  writer.byte(snapshot.co_simulation || snapshot.model_exchange ? 1 : 0);
  if (snapshot.co_simulation) write_co_simulation(writer, *snapshot.co_simulation);
  if (snapshot.model_exchange) write_model_exchange(writer, *snapshot.model_exchange);
}

bool may_be_saved(Phase phase, Interface interface, bool has_run) {
  switch (phase) {
    case Phase::instantiated:
    case Phase::initialization:
      return !has_run;
    case Phase::step_complete:
      return has_run && interface == Interface::co_simulation;
    case Phase::event_mode:
    case Phase::continuous_time_mode:
      return has_run && interface == Interface::model_exchange;
    case Phase::terminated:
      return has_run;
    case Phase::error:
      return false;
  }
  return false;
}

std::int64_t read_count(Reader& reader) {
  const auto count = static_cast<std::int64_t>(reader.number());
  if (count < 0) Reader::refuse("a count in it is negative");
  return count;
}

void read_modes(Reader& reader, const Parameters& parameters, Modes& modes) {
  const int expected = LocatedConditions::count(parameters);
  if (reader.number() != at(expected)) Reader::refuse("a list in it has another length");
  for (int k = 0; k < expected; ++k) {
    const std::uint8_t byte = reader.byte();
    if (byte > other_mode) Reader::refuse("a mode in it is neither 0 nor 1 nor another number");
    modes.push_back(byte == other_mode ? reader.real() : byte);
    if (!LocatedConditions::can_hold(parameters, k, modes.back())) {
      Reader::refuse("a condition in it holds what it cannot");
    }
  }
}

void read_statistics(Reader& reader, Statistics& statistics) {
  for (std::int64_t* count : {&statistics.steps, &statistics.rate_evaluations, &statistics.newton_setups,
                              &statistics.newton_solves, &statistics.events}) {
    *count = read_count(reader);
  }
}

Judgement read_judgement(Reader& reader, const SnapshotShape& shape) {
  Judgement judgement;
  for (Real* value : {&judgement.begun, &judgement.until, &judgement.last_outside, &judgement.control_energy,
                      &judgement.control_peak, &judgement.error_peak, &judgement.farthest_beyond,
                      &judgement.errors_from, &judgement.squared_band, &judgement.largest_deviation}) {
    *value = reader.real();
  }
  judgement.outside = reader.boolean();
  const Shape& game = shape.parameters->shape;
  const std::size_t entries = game.hosts_all() ? at(game.actions()) : 0;
  reader.numbers(entries, judgement.x_star);
  reader.numbers(entries, judgement.side);
  return judgement;
}

Checkpoint read_checkpoint(Reader& reader, const SnapshotShape& shape) {
  Checkpoint checkpoint;
  checkpoint.restart_time = reader.real();
  reader.numbers(shape.states, checkpoint.restart_state);
  read_modes(reader, *shape.parameters, checkpoint.restart_modes);
  read_statistics(reader, checkpoint.restart_statistics);
  checkpoint.restart_judgement = read_judgement(reader, shape);
  checkpoint.steps_since_restart = read_count(reader);
  if (checkpoint.steps_since_restart > shape.steps) Reader::refuse("it counts too many steps");
  checkpoint.first_step = reader.real();
  if (checkpoint.first_step < 0.0) Reader::refuse("a step in it is negative");
  checkpoint.time = reader.real();
  reader.numbers(shape.states, checkpoint.state);
  read_modes(reader, *shape.parameters, checkpoint.modes);
  read_statistics(reader, checkpoint.statistics);
  checkpoint.judgement = read_judgement(reader, shape);
  if (checkpoint.judgement.until > checkpoint.time || checkpoint.restart_judgement.until > checkpoint.restart_time) {
    Reader::refuse("its times are out of order");
  }
  if (checkpoint.time < checkpoint.restart_time) Reader::refuse("its times are out of order");
  return checkpoint;
}

ModelExchange::Point read_model_exchange(Reader& reader, const SnapshotShape& shape) {
  ModelExchange::Point point;
  point.time = reader.real();
  reader.numbers(shape.states, point.state);
  read_modes(reader, *shape.parameters, point.modes);
  point.events = read_count(reader);
  point.accepted_time = reader.real();
  reader.numbers(shape.states, point.accepted_state);
  reader.numbers(shape.inputs, point.accepted_inputs);
  point.judgement = read_judgement(reader, shape);
  return point;
}

}  // namespace

std::size_t serialized_size(const Snapshot& snapshot, std::string_view guid) {
  // interface, phase, experiment, settings, flag
  std::size_t size = 1 + 1 + 9 + 8 + 9 + 8 + 8 * snapshot.settings.size() + 1;
  if (snapshot.co_simulation) {
    const auto& [acting, time, checkpoint] = *snapshot.co_simulation;
    constexpr std::size_t statistics = 5 * 8;
    size += 8 + 8 * acting.size() + 8 + 8;
    size += 8 + 8 * checkpoint.restart_state.size() + size_of(checkpoint.restart_modes) + statistics + 8 + 8;
    size += 8 + 8 + 8 * checkpoint.state.size() + size_of(checkpoint.modes) + statistics;
    size += size_of(checkpoint.restart_judgement) + size_of(checkpoint.judgement);
  }
  if (snapshot.model_exchange) {
    size += 8 + 8 + 8 * snapshot.model_exchange->state.size() + size_of(snapshot.model_exchange->modes) + 8;
    size += 8 + 8 + 8 * snapshot.model_exchange->accepted_state.size() + 8 +
            8 * snapshot.model_exchange->accepted_inputs.size() + size_of(snapshot.model_exchange->judgement);
  }
  return magic.size() + 4 + 4 + guid.size() + 8 + size + fingerprint_size;
}

std::vector<char> to_bytes(const Snapshot& snapshot, std::string_view guid) {
  const std::size_t size = serialized_size(snapshot, guid);
  const std::size_t header = magic.size() + 4 + 4 + guid.size() + 8;
  Writer writer;
  writer.bytes().reserve(size);
  write_header(writer, guid, size - header - fingerprint_size);
  write_payload(writer, snapshot);
  writer.seal();
  return std::move(writer.bytes());
}

Snapshot from_bytes(std::span<const char> bytes, std::string_view guid, const SnapshotShape& shape) {
  Reader reader(bytes);
  if (reader.text(magic.size()) != magic) Reader::refuse("they do not begin as one");
  if (const auto version = reader.number(4); version != format) {
    Reader::refuse("they have format " + std::to_string(version) + ", expected " + std::to_string(format));
  }
  if (reader.text(static_cast<std::size_t>(reader.number(4))) != guid) Reader::refuse("they carry another GUID");
  const std::uint64_t payload = reader.number();
  if (reader.left() < fingerprint_size || payload != reader.left() - fingerprint_size) {
    Reader::refuse("their length does not match");
  }
  Fingerprint fingerprint;
  fingerprint.add({bytes.data(), bytes.size() - fingerprint_size});
  Reader seal(bytes.last(fingerprint_size));
  for (const std::uint32_t part : fingerprint.value()) {
    if (seal.number(4) != part) Reader::refuse("they are damaged (checksum)");
  }

  Snapshot snapshot;
  if (reader.byte() != static_cast<std::uint8_t>(shape.interface)) {
    Reader::refuse("they do not come from " + std::string(name_of(shape.interface)));
  }
  snapshot.interface = shape.interface;
  const std::uint8_t phase = reader.byte();
  if (phase >= phases) Reader::refuse("its phase is unknown");
  snapshot.phase = static_cast<Phase>(phase);
  snapshot.experiment.tolerance = reader.optional();
  snapshot.experiment.start_time = reader.real();
  snapshot.experiment.stop_time = reader.optional();
  reader.numbers(shape.settings, snapshot.settings);
  const bool has_run = reader.boolean();
  if (!may_be_saved(snapshot.phase, shape.interface, has_run)) Reader::refuse("its phase and content do not match");
  if (has_run && shape.interface == Interface::co_simulation) {
    CoSimulation::Point& point = snapshot.co_simulation.emplace();
    reader.numbers(shape.settings, point.acting);
    point.time = reader.real();
    point.checkpoint = read_checkpoint(reader, shape);
    if (point.checkpoint.time != point.time - snapshot.experiment.start_time) {
      Reader::refuse("its times do not fit together");
    }
  } else if (has_run) {
    snapshot.model_exchange = read_model_exchange(reader, shape);
  }
  if (reader.left() != fingerprint_size) Reader::refuse("they are longer than their content");
  return snapshot;
}

}  // namespace mixed_order_game
