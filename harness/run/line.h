// The serial line of a flight: main line both ways and reference line, byte-accurate, with the wire's faults
// and an audit of what passes.
//
// The same code stands in one process with the plant (lockstep), in a process of its own asked over a channel
// (lockstep, distributed), and between real ports (the link node). All times are the line's: boot time in
// lockstep, the machine's monotonic clock in real time.
//
//   LocalLine line(scenario);
//   line.Transmit(Direction::kToPlant, now, bytes);
//   while (const auto piece = line.TakePiece(Direction::kToPlant, now)) server.Receive(piece->arrival_ns, ...);
//
// t = 0 is the arrival of the first accepted `start` at the plant's end; the line sees it pass.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "faults/schedule.h"
#include "harness/run/event_log.h"
#include "harness/run/receiving_end.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"
#include "link/wire.h"

namespace tiltproof::harness {

// By Direction.
using LineCounts = std::array<DirectionCounts, link::kDirectionCount>;

// Records since the last TakeLog(); counters are totals.
struct LineLog {
  LinkLog link;  // the line's time
  std::vector<TimeNs>
      reply_latency_ns;  // from a request's last byte at the server to its reply's at the client
  std::vector<TimeNs>
      client_round_trip_ns;      // from a reply's last byte at the client to its actuators' at the server
  std::vector<RunEvent> events;  // the line's time
  std::vector<faults::Activation> activations;  // simulation time
  std::vector<std::int64_t> activation_counts;  // one per fault of the scenario
  LineCounts counts{};
  std::int64_t accepted_wrong_count = 0;
  std::int64_t accepted_stale_count = 0;
  TimeNs resync_max_ns = 0;
};

// More was to wait in a direction than link::kLineBytesMax: it carries nothing any more.
struct Overfull {
  bool by_faults = false;  // else by what was sent
  std::string text;
};

// Of the two lines; 0: ideal, bytes take no time.
std::int64_t MainBaud(const LinkSpec& link);
std::int64_t ReferenceBaud(const LinkSpec& link);

class Line {
 public:
  using Piece = link::Wire::Piece;

  virtual ~Line() = default;
  // See link::Wire for these three.
  virtual TimeNs Transmit(link::Direction direction, TimeNs now, std::span<const std::uint8_t> bytes) = 0;
  virtual TimeNs NextArrival(link::Direction direction) const = 0;
  virtual std::optional<Piece> TakePiece(link::Direction direction, TimeNs until) = 0;

  virtual const LineCounts& counts() const = 0;
  // Once it is, for good.
  virtual const std::optional<Overfull>& overfull() const = 0;
  // `end`: when the flight ended, in the line's time; a frame still awaited then counts as lost.
  virtual LineLog TakeLog(TimeNs end) = 0;
};

class LocalLine final : public Line {
 public:
  // `paced`: bytes take their time here. A line to a real serial port is not: there the hardware's bytes
  // do.
  explicit LocalLine(const Scenario& scenario, bool paced = true);

  TimeNs Transmit(link::Direction direction, TimeNs now, std::span<const std::uint8_t> bytes) override;
  TimeNs NextArrival(link::Direction direction) const override;
  std::optional<Piece> TakePiece(link::Direction direction, TimeNs until) override;
  const LineCounts& counts() const override;
  const std::optional<Overfull>& overfull() const override { return overfull_; }
  LineLog TakeLog(TimeNs end) override;

  // Arrival at the client of the latest valid reply, as long as no actuators have come back; else kNever.
  TimeNs unanswered_reply() const { return replied_ns_; }
  // The line's time of t = 0; kNever before.
  TimeNs origin() const { return origin_ns_; }

 private:
  template <class Array>
  static auto& At(Array& array, link::Direction direction) {
    return array[static_cast<std::size_t>(direction)];
  }
  void NoteOverfull(link::Direction direction);
  void OnClientMessage(TimeNs arrival, std::span<const std::uint8_t> payload);
  void OnReply(TimeNs arrival, std::uint64_t number, std::span<const std::uint8_t> payload);

  link::Dialect dialect_;
  std::vector<std::string> fault_ids_;
  faults::FaultSchedule faults_;
  std::array<link::Wire, link::kDirectionCount> wires_;
  std::array<ReceivingEnd, link::kDirectionCount> ends_;
  mutable LineCounts counts_{};
  std::optional<Overfull> overfull_;
  TimeNs origin_ns_ = kNever;

  // The latest request; the replies on their way or lost, in order of their numbers, with the arrival of the request
  // that each answers.
  struct Reply {
    std::uint64_t number;
    std::uint64_t payload_hash;
    TimeNs requested_ns;  // kNever: it has arrived
  };
  TimeNs requested_ns_ = kNever;
  std::deque<Reply> replies_;
  TimeNs replied_ns_ = kNever;  // arrival of the latest reply that no actuators have answered

  LinkLog link_log_;
  std::vector<TimeNs> reply_latency_ns_, client_round_trip_ns_;
  EventLog events_;
};

}  // namespace tiltproof::harness
