// Frames on a line with faults, without a wire: what the tests of fault models have in common.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <map>
#include <numeric>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "faults/registry.h"
#include "faults/schedule.h"
#include "firmware/signals.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/chunk.h"
#include "link/length_framing.h"
#include "tests/support/origins.h"
#include "tests/support/tiny_framings.h"

namespace tiltproof::faults {

inline constexpr TimeNs kPeriod = 12 * kNsPerMs;

// Prints a parameter for GoogleTest.
inline void PrintTo(const FaultType& type, std::ostream* os) { *os << type.name; }

using Bytes = std::vector<std::uint8_t>;

// The place of a message in the table of `paper`.
inline std::uint8_t PlaceInPaper(const std::string& message) {
  static const auto paper = harness::FindProtocol("paper");
  return static_cast<std::uint8_t>(paper->Find(message) - paper->messages.data());
}

// A fault on to_client (if it is one for a line) without window.
inline FaultSpec Spec(const std::string& type, std::map<std::string, ParameterValue> parameters = {},
                      const std::string& id = "fault") {
  FaultSpec spec;
  spec.id = id;
  spec.type = type;
  spec.parameters = std::move(parameters);
  const FaultType* found = FindFaultType(type);
  if (found != nullptr && found->has_target()) spec.target = Target::kToClient;
  return spec;
}

// The type's example with as little of a window as it needs, of which the registry says that it acts.
inline FaultSpec ExampleSpec(const FaultType& type) {
  FaultSpec spec = Spec(std::string(type.name));
  for (const ParameterInfo& info : type.parameters) spec.parameters[std::string(info.name)] = info.example;
  if (type.start == Bound::kRequired) spec.start_ns = 2 * kNsPerS;
  if (type.end == Bound::kRequired) spec.end_ns = 5 * kNsPerS;
  return spec;
}

// The tilt-rotor's tables, and what a schedule does to its named values.
inline VehicleSignals TiltrotorSignals() {
  std::vector<Signal> sensors, inputs;
  for (const auto& field : kSensorFields)
    sensors.push_back(SignalNamed(std::string(field.column), SignalFrame::kWorld));
  for (const auto& field : kActuatorFields)
    inputs.push_back(SignalNamed(std::string(field.column), SignalFrame::kRotor));
  for (Signal& input : inputs) {  // as the shipped model
    const bool is_thrust = input.name.starts_with("f_");
    input.min = is_thrust ? 0.0 : -2.0;
    input.max = is_thrust ? 30.0 : 2.0;
  }
  return {.states = SignalTable(sensors),
          .sensors = SignalTable(sensors),
          .inputs = SignalTable(inputs),
          .rotors = {"right", "left"},
          .joints = {"hinge_right", "hinge_left"}};
}

// The paper's protocol; but for a fault on a part that its frames do not have, with a length in front of each frame.
inline std::shared_ptr<const link::Protocol> ProtocolFor(const std::vector<FaultSpec>& specs) {
  const std::shared_ptr<const link::Protocol> paper = harness::FindProtocol("paper");
  for (const FaultSpec& spec : specs) {
    const auto* wire = ValidType(spec).As<WireKind>();
    if (wire != nullptr && wire->needs_role && !paper->framing->Has(*wire->needs_role))
      return link::PaperOver(link::MakeLengthFraming({.sync = {0xAA, 0x55}}, link::CheckKind::kCrc16Ibm3740));
  }
  return paper;
}

inline FaultSchedule AtTheLine(const std::vector<FaultSpec>& specs, std::uint64_t seed,
                               FaultSchedule::Place place = {}) {
  place.protocol = ProtocolFor(specs);
  return {specs, seed, place};
}

inline FaultSchedule AtThePlant(const std::vector<FaultSpec>& specs, std::uint64_t seed = 1) {
  return AtTheLine(specs, seed, {.signals = TiltrotorSignals()});
}

inline void EditSensors(FaultSchedule& schedule, TimeNs t, Sensors& sensors, BootTime boot_time = {}) {
  std::vector<double> row;
  for (const auto& field : kSensorFields) row.push_back(static_cast<double>(sensors.*field.in_float));
  schedule.EditSensors(t, row, boot_time);
  for (std::size_t i = 0; i < row.size(); ++i)
    sensors.*kSensorFields[i].in_float = static_cast<float>(row[i]);
}

inline void EditActuators(FaultSchedule& schedule, TimeNs t, ActuatorsTruth& input, bool new_command = true) {
  std::vector<double> row;
  for (const auto& field : kActuatorFields) row.push_back(input.*field.in_double);
  schedule.EditInput(t, row, new_command);
  for (std::size_t i = 0; i < row.size(); ++i) input.*kActuatorFields[i].in_double = row[i];
}

// When frame n of a line begins that sends one every 12 ms. The line's boot time 0 is t = 0.
constexpr TimeNs FrameTime(std::int64_t n) { return n * 12 * kNsPerMs; }

// Frame n of that line; no two are alike. Interior bytes are never flags.
inline link::Chunk Frame(std::int64_t n, std::size_t size = 68) {
  link::Chunk chunk;
  chunk.begin_ns = kOriginAtPowerOn.ToBootTime(FrameTime(n));
  chunk.number = static_cast<std::uint64_t>(n);
  chunk.message = PlaceInPaper("reply");
  chunk.bytes.assign(size, 0x7E);
  for (std::size_t i = 1; i + 1 < size; ++i) {
    const auto byte = static_cast<std::uint8_t>(chunk.number * 31 + i * 7 + (chunk.number >> 8));
    chunk.bytes[i] = byte == 0x7E || byte == 0x7D ? 0 : byte;
  }
  // The number itself, in base 64.
  for (std::size_t i = 1; i < 5 && i + 1 < size; ++i) {
    chunk.bytes[i] = static_cast<std::uint8_t>(n >> (6 * (i - 1)) & 0x3F);
  }
  return chunk;
}

// Sends frames 0 to count - 1 through a schedule, by default on to_client: the chunks that came out at each of them, and behind
// them those that were sent back.
inline std::vector<std::vector<link::Chunk>> Send(FaultSchedule& schedule, std::int64_t count,
                                                  std::size_t size = 68,
                                                  link::Direction direction = link::Direction::kToClient) {
  schedule.SetOrigin(kOriginAtPowerOn);
  link::ChunkFilter* filter = schedule.Filter(direction);
  std::vector<std::vector<link::Chunk>> out;
  for (std::int64_t n = 0; n < count; ++n) {
    out.push_back({Frame(n, size)});
    if (filter != nullptr) filter->Apply(out.back());
    for (link::Chunk& chunk : schedule.TakeSentBack(direction)) out.back().push_back(std::move(chunk));
  }
  return out;
}

// The same with one fault.
inline std::vector<std::vector<link::Chunk>> Send(const FaultSpec& spec, std::int64_t count,
                                                  std::size_t size = 68, std::uint64_t seed = 1) {
  FaultSchedule schedule = AtTheLine({spec}, seed);
  return Send(schedule, count, size);
}

// Sends frames through a fault. They all have these bytes, and follow each other without a pause, as one line of
// 921600 baud carries them.
inline std::vector<std::vector<link::Chunk>> SendWithoutPause(const FaultSpec& spec, const Bytes& bytes,
                                                              std::int64_t count) {
  FaultSchedule schedule = AtTheLine({spec}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  std::vector<std::vector<link::Chunk>> out;
  for (std::int64_t n = 0; n < count; ++n) {
    out.push_back(
        {{.begin_ns = BootTime(link::BytesTime(921'600, n * static_cast<std::int64_t>(bytes.size()))),
          .bytes = bytes,
          .message = PlaceInPaper("reply"),
          .number = static_cast<std::uint64_t>(n)}});
    schedule.Filter(link::Direction::kToClient)->Apply(out.back());
  }
  return out;
}

// 100 bytes, no two alike: what comes out says where each of them went.
inline Bytes DistinctBytes() {
  Bytes bytes(100);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{1});
  return bytes;
}

// As the log of the flight has them.
inline std::vector<link::LogChunk> InLog(const std::vector<link::Chunk>& chunks) {
  std::vector<link::LogChunk> in_log;
  for (const link::Chunk& chunk : chunks)
    in_log.push_back(
        {kOriginAtPowerOn.SimulationTime(chunk.begin_ns), chunk.bytes, chunk.message, chunk.number});
  return in_log;
}

template <class Time>
bool Same(const link::TimedChunk<Time>& a, const link::TimedChunk<Time>& b) {
  return a.begin_ns == b.begin_ns && a.bytes == b.bytes;
}

template <class Time>
bool Same(const std::vector<link::TimedChunk<Time>>& a, const std::vector<link::TimedChunk<Time>>& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!Same(a[i], b[i])) return false;
  }
  return true;
}

inline bool Unchanged(const std::vector<link::Chunk>& out, std::int64_t n, std::size_t size = 68) {
  return out.size() == 1 && Same(out[0], Frame(n, size));
}

// Counts the frames that went on, whole and as they were.
inline int CountUnchanged(const std::vector<std::vector<link::Chunk>>& out, std::size_t size = 68) {
  int count = 0;
  for (std::size_t n = 0; n < out.size(); ++n) {
    if (Unchanged(out[n], static_cast<std::int64_t>(n), size)) ++count;
  }
  return count;
}

// The data bits that differ between a frame and what came of it, both of the same size.
template <class Time>
std::vector<std::size_t> FlippedBits(const link::TimedChunk<Time>& before,
                                     const link::TimedChunk<Time>& after) {
  std::vector<std::size_t> bits;
  for (std::size_t bit = 0; bit < 8 * before.bytes.size(); ++bit) {
    if (((before.bytes[bit / 8] ^ after.bytes.at(bit / 8)) >> (bit % 8) & 1) != 0) bits.push_back(bit);
  }
  return bits;
}

inline FaultSpec At(FaultSpec spec, TimeNs start_ns, TimeNs end_ns = kNever) {
  spec.start_ns = start_ns;
  spec.end_ns = end_ns;
  return spec;
}

// The name of the test of one type, with underscores: GoogleTest takes no dots.
inline std::string TestName(const ::testing::TestParamInfo<FaultType>& info) {
  std::string name(info.param.name);
  std::replace(name.begin(), name.end(), '.', '_');
  return name;
}

}  // namespace tiltproof::faults
