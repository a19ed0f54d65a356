// The raw bytes of a flight with their times, both directions and the reference line, as they are kept in
// link.bin (docs/wire.md).
//
// File format, little endian: the 8 bytes "TPLINK2\n", then records:
//   int64  begin_ns   simulation time at which the first byte's start bit enters the wire
//   uint8  client     its place among the scenario's clients; behind these, the lines between boards
//   uint8  direction  0 to_plant, 1 to_client, 2 reference; of a line 0 to its second end, 1 to its first
//   uint8  side       0 as sent, 1 as it went on after the faults, 2 as the buffer of an adapter passed it on at once
//   uint16 size       number of bytes that follow
//   bytes
// Bytes of a record follow each other without gaps, at the line's byte time. In files with the older magic
// TPLINK1 records have no client: the flight has only one.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "link/chunk.h"

namespace tiltproof::harness {

inline constexpr std::string_view kLinkLogMagic = "TPLINK2\n";

// Bytes as they were sent, as they went on after the faults, and as the buffer of an adapter passed them on.
enum class ByteSide : std::uint8_t { kSent, kDelivered, kPassedOn };

// Each client of a flight has three wires. A line between boards has two, and its place follows those of the clients:
// to_client is then the way to the first of its ends, to_plant that to the second.
struct WireId {
  std::size_t client = 0;  // its place among the scenario's clients and lines
  link::Direction direction{};
  friend bool operator==(const WireId&, const WireId&) = default;
};

struct LinkRecord {
  TimeNs begin_ns = 0;
  WireId wire;
  bool delivered = false;
  bool passed_on = false;
  std::span<const std::uint8_t> bytes;
};
class LinkLog {
 public:
  LinkLog() = default;

  // Takes the content of a file, of this version or the previous one. Throws std::runtime_error with the
  // offset of the damage.
  explicit LinkLog(std::vector<std::uint8_t> content);

  void Append(const link::LogChunk& chunk, WireId wire, bool delivered) {
    Append(chunk.begin_ns, chunk.bytes, wire, delivered ? ByteSide::kDelivered : ByteSide::kSent);
  }
  // Bytes that follow each other on a wire from `begin` on.
  void Append(TimeNs begin, std::span<const std::uint8_t> bytes, WireId wire, ByteSide side);
  // The records of another log, after its own.
  void Append(LinkLog&& other);

  // The file's content.
  const std::vector<std::uint8_t>& content() const { return content_; }

  // Iterates over the records of what was sent and what went on after the faults: `offset` starts at 0 and is advanced;
  // nullopt at the end.
  std::optional<LinkRecord> Next(std::size_t& offset) const;
  // The same, with the records of what adapters passed on.
  std::optional<LinkRecord> NextOfAll(std::size_t& offset) const;

 private:
  std::vector<std::uint8_t> content_{kLinkLogMagic.begin(), kLinkLogMagic.end()};
};

}  // namespace tiltproof::harness
