// A serial line between two clients, byte-accurate, with the faults on it. It has no end at the plant: what one client
// transmits, the other one receives.
//
//   BoardLine line(scenario, 0, sink);
//   line.Transmit(0, now, bytes);                 // by the first client of `between`
//   while (const auto piece = line.TakePiece(1, until)) Receive(piece->arrival_ns, piece->bytes, piece->marks);
//
// Bytes are 8N1 and take their time by the rules of link/wire.h. Times are boot time. In lockstep a line is in the process
// of the conductor, also in a distributed flight; in real time it has a node of its own.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "faults/schedule.h"
#include "harness/run/line.h"
#include "harness/run/record_stream.h"
#include "harness/scenario/scenario.h"
#include "link/wire.h"

namespace tiltproof::harness {

class BoardLine {
 public:
  // `line`: its place in the scenario. `sink`: gets its records; it must outlive the line. `paced`: as of LocalLine. `use`: of
  // its schedule of faults.
  BoardLine(const Scenario& scenario, std::size_t line, RecordSink& sink, bool paced = true,
            const faults::ScheduleUse& use = {});
  // Not movable: its wires hold its address.
  BoardLine(const BoardLine&) = delete;
  BoardLine& operator=(const BoardLine&) = delete;

  // The client at that end, 0 or 1, gives bytes to its transmitter. Returns when the last stop bit has left.
  BootTime Transmit(std::size_t end, BootTime now, std::span<const std::uint8_t> bytes);
  // When the receiver at that end should be woken: link::Wire::NextArrival().
  BootTime NextArrival(std::size_t end) const { return WireTo(end).NextArrival(); }
  // Bytes that have arrived at that end; valid until the next call.
  struct Piece {
    BootTime arrival_ns;  // of the last byte
    std::span<const std::uint8_t> bytes;
    std::span<const faults::ReceiveMark> marks;  // one for each byte
  };
  std::optional<Piece> TakePiece(std::size_t end, BootTime until);
  // The time of the first byte that is transmitted to its arrival at the other end, at least.
  TimeNs ByteTime() const { return rate_.BytesTime(1); }

  // Set once more was to wait on the way from this end than a line holds, and never reset.
  const std::optional<Overfull>& overfull(std::size_t end) const { return overfull_[end]; }

  // A fault of the flight that is added while it flies.
  void Add(const faults::FaultSpec& fault);
  // When everything that has been transmitted will have left.
  BootTime FreeTime() const;

  void SetOrigin(Origin origin);
  Origin origin() const { return origin_; }
  std::vector<faults::FaultEvent> PollEvents() { return faults_.PollEvents(); }
  void Hear(std::span<const faults::FaultEvent> events) { faults_.Hear(events); }
  // Writes what faults did since the last call. Finish() does, too.
  void WriteActivations();
  // Call it once, when the flight is over.
  void Finish(BootTime end);

 private:
  // The wire to the first end is that to the client of a client's line, the other one that to the plant.
  static link::Direction DirectionTo(std::size_t end) {
    return end == 0 ? link::Direction::kToClient : link::Direction::kToPlant;
  }
  const link::Wire& WireTo(std::size_t end) const { return end == 0 ? to_first_ : to_second_; }
  link::Wire& WireTo(std::size_t end) { return end == 0 ? to_first_ : to_second_; }
  void AfterWire(std::size_t to, BootTime now);
  void NoteOverfull(std::size_t to);

  std::string id_;
  std::vector<std::string> ends_, fault_ids_;
  std::shared_ptr<const link::Protocol> protocol_;
  link::LineRate rate_;
  faults::FaultSchedule faults_;
  link::Wire to_first_, to_second_;
  std::array<std::optional<Overfull>, 2> overfull_;
  std::vector<faults::ReceiveMark> marks_;
  Origin origin_;
  PartRecords bytes_, records_;
};

}  // namespace tiltproof::harness
