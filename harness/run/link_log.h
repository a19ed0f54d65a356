// The raw bytes of a flight with their times, both directions and the reference line, as they are kept in
// link.bin (docs/wire.md).
//
// File format, little endian: the 8 bytes "TPLINK1\n", then records:
//   int64  begin_ns   simulation time at which the first byte's start bit enters the wire
//   uint8  direction  0 to_plant, 1 to_client, 2 reference
//   uint8  side       0 as sent, 1 as it went on after the faults
//   uint16 size       number of bytes that follow
//   bytes
// Bytes of a record follow each other without gap, at the line's byte time.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "link/chunk.h"

namespace tiltproof::harness {

inline constexpr std::string_view kLinkLogMagic = "TPLINK1\n";

struct LinkRecord {
  TimeNs begin_ns = 0;
  link::Direction direction{};
  bool delivered = false;
  std::span<const std::uint8_t> bytes;
};

class LinkLog {
 public:
  LinkLog() = default;

  // Takes the content of a file. Throws std::runtime_error naming the offset of what is wrong.
  explicit LinkLog(std::vector<std::uint8_t> content);

  void Append(const link::Chunk& chunk, link::Direction direction, bool delivered);
  // The records of another log, after its own.
  void Append(LinkLog&& other);

  // Subtracts the boot time of t = 0 from every record: a flight logs in boot time, readers want simulation
  // time.
  void ShiftOrigin(TimeNs origin_ns);

  // The file's content.
  const std::vector<std::uint8_t>& content() const { return content_; }

  // Walks over the records: `offset` starts at 0 and is advanced; nullopt at the end.
  std::optional<LinkRecord> Next(std::size_t& offset) const;

 private:
  std::vector<std::uint8_t> content_{kLinkLogMagic.begin(), kLinkLogMagic.end()};
};

}  // namespace tiltproof::harness
