// Records on their way to a sink: those of a part that counts in boot time, and those that leave their process.
//
//   PartRecords records(sink, 0);
//   records.Write(now, record::State{3});  // waits until t = 0 is known
//   records.SetOrigin(origin);             // goes to the sink, in simulation time
//
//   PackedRecords packed;                                 // in one process
//   packed.Write(record);
//   ReadPacked(packed.TakeAll(), sink);                   // in another
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "harness/run/archive.h"
#include "harness/run/record.h"

namespace tiltproof::harness {

// Records as bytes, for another process of the same build.
class PackedRecords final : public RecordSink {
 public:
  void Write(const Record& record) override { packer_(record); }
  std::size_t size_bytes() const { return packer_.bytes().size(); }
  // Removes and returns the first bytes.
  std::vector<std::uint8_t> Take(std::size_t size_bytes) { return packer_.Take(size_bytes); }
  std::vector<std::uint8_t> TakeAll() { return Take(size_bytes()); }

 private:
  Packer packer_;
};

// Throws std::runtime_error when the bytes are damaged; `sink` may have got some of the records by then.
void ReadPacked(std::span<const std::uint8_t> bytes, RecordSink& sink);

// The records of a part that counts in boot time. Until t = 0 is known their simulation time is not, so they wait.
class PartRecords {
 public:
  // A chunk that is longer becomes several records.
  static constexpr std::size_t kBytesMax = 0xFFFF;

  // `sink` must outlive it. `client`: of all these records.
  PartRecords(RecordSink& sink, std::optional<std::size_t> client) : sink_(sink) { record_.client = client; }

  void Write(BootTime at, RecordBody body);
  // At once: its simulation time is known.
  void Write(TimeNs at, RecordBody body) { sink_.Write({at, record_.client, std::move(body)}); }
  void WriteBytes(BootTime begin, link::Direction direction, ByteSide side,
                  std::span<const std::uint8_t> bytes);
  // Only the first call counts.
  void SetOrigin(Origin origin);

 private:
  RecordSink& sink_;
  Origin origin_;
  Packer waiting_;  // a line that floods before t = 0 must not need more memory than its bytes
  Record record_{0, {}, record::Bytes{}};  // keeps the memory of its bytes
};

}  // namespace tiltproof::harness
