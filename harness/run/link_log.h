// The raw bytes of a flight with their times, both directions and the reference line, as they are kept in
// link.bin (docs/wire.md).
//
// File format, little endian: the 8 bytes "TPLINK2\n", then records:
//   int64  begin_ns   simulation time at which the first byte's start bit enters the wire
//   uint8  client     its place among the scenario's clients
//   uint8  direction  0 to_plant, 1 to_client, 2 reference
//   uint8  side       0 as sent, 1 as it went on after the faults, 2 as the buffer of an adapter passed it on at once
//   uint16 size       number of bytes that follow
//   bytes
// Bytes of a record follow each other without gaps, at the line's byte time. In files with the older magic
// TPLINK1 records have no client: the flight has only one.
#pragma once

#include <concepts>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "link/chunk.h"

namespace tiltproof::harness {

inline constexpr std::string_view kLinkLogMagic = "TPLINK2\n";

// Each client of a flight has three wires.
struct WireId {
  std::size_t client = 0;  // its place among the scenario's clients
  link::Direction direction{};
  friend bool operator==(const WireId&, const WireId&) = default;
};

template <class Time>
struct TimedLinkRecord {
  Time begin_ns{};
  WireId wire;
  bool delivered = false;
  bool passed_on = false;
  std::span<const std::uint8_t> bytes;
};
using LinkRecord = TimedLinkRecord<TimeNs>;

// A line collects in boot time; readers want simulation time. A file has simulation time.
template <class Time>
class TimedLinkLog {
 public:
  TimedLinkLog() = default;

  // Takes the content of a file, of this version or the previous one. Throws std::runtime_error with the
  // offset of the damage.
  explicit TimedLinkLog(std::vector<std::uint8_t> content);

  void Append(const link::TimedChunk<Time>& chunk, WireId wire, bool delivered);
  // Bytes that the buffer of an adapter has passed on at that time.
  void AppendPassedOn(Time at, std::span<const std::uint8_t> bytes, WireId wire);
  // The records of another log, after its own.
  void Append(TimedLinkLog&& other);

  // The file's content.
  const std::vector<std::uint8_t>& content() const { return content_; }

  // The same records in simulation time, without copying their bytes.
  TimedLinkLog<TimeNs> Shifted(Origin origin) && requires std::same_as<Time, BootTime>;

  // Iterates over the records of what was sent and what went on after the faults: `offset` starts at 0 and is advanced;
  // nullopt at the end.
  std::optional<TimedLinkRecord<Time>> Next(std::size_t& offset) const;
  // The same, with the records of what adapters passed on.
  std::optional<TimedLinkRecord<Time>> NextOfAll(std::size_t& offset) const;

 private:
  template <class Other>
  friend class TimedLinkLog;

  void AppendRecords(Time begin, std::span<const std::uint8_t> bytes, WireId wire, std::uint8_t side);

  std::vector<std::uint8_t> content_{kLinkLogMagic.begin(), kLinkLogMagic.end()};
};
using LinkLog = TimedLinkLog<TimeNs>;
using BootLinkLog = TimedLinkLog<BootTime>;

}  // namespace tiltproof::harness
