// The serial line of one client: the main line in both directions and the reference line, byte-accurate, with
// the faults of the wires and an audit of what passes.
//
// The same code runs in one process with the plant (lockstep), in its own process that is asked over a
// channel (lockstep, distributed), and between real ports (the link node). All times are boot time
// (link/time.h).
//
//   LocalLine line(scenario, sink);
//   line.Transmit(Direction::kToPlant, now, bytes);
//   while (const auto piece = line.TakePiece(Direction::kToPlant, now))
//     if (piece->message != nullptr) server.Receive(client, piece->arrival_ns, *piece->message, reply);
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "faults/schedule.h"
#include "harness/run/event_limit.h"
#include "harness/run/receiving_end.h"
#include "harness/run/record_stream.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"
#include "link/fields.h"
#include "link/wire.h"

namespace tiltproof::harness {

// More bytes were to wait in a direction than link::kLineBytesMax. The direction carries nothing any more.
struct Overfull {
  bool by_faults = false;  // else by the number of bytes sent
  std::string text;
  TILTPROOF_FIELDS(by_faults, text)
};

// `where`: "line to_plant".
Overfull OverfullOf(const std::string& where, const faults::FaultSchedule::Crowd& crowd,
                    const std::vector<std::string>& fault_ids);

// The faults on a client's line, receiver and, where there are signals of the vehicle, samples.
faults::FaultSchedule ClientFaults(const Scenario& scenario, std::size_t client,
                                   const VehicleSignals* signals = nullptr,
                                   const faults::ScheduleUse& use = {});

class Line {
 public:
  // Bytes that have arrived. They and the message are valid until the next call.
  struct Piece {
    BootTime arrival_ns;  // of the last byte
    std::span<const std::uint8_t> bytes;
    // In the direction to_plant: the message that these bytes complete. Null when they complete no accepted
    // message.
    const link::Message* message = nullptr;
    std::span<const std::uint8_t> parity_errors = {};  // link::Chunk::parity_errors of these bytes
  };

  virtual ~Line() = default;
  // See link::Wire for these three. A piece ends at the first flag that may end a frame, so it completes at
  // most one frame.
  virtual BootTime Transmit(link::Direction direction, BootTime now, std::span<const std::uint8_t> bytes) = 0;
  virtual BootTime NextArrival(link::Direction direction) const = 0;
  virtual std::optional<Piece> TakePiece(link::Direction direction, BootTime until) = 0;

  // Called once t = 0 is known: faults on the line use simulation time.
  virtual void SetOrigin(Origin origin) = 0;

  virtual const LineCounts& counts() const = 0;
  // Set once the line is overfull, and never reset.
  virtual const std::optional<Overfull>& overfull() const = 0;
  // Events for faults that wait, see faults/fault_event.h.
  virtual std::vector<faults::FaultEvent> PollEvents() = 0;
  virtual void Hear(std::span<const faults::FaultEvent> events) = 0;
  // Writes the totals; call it once, at the end. A frame that is still awaited at `end` counts as lost. Without t = 0
  // the times of all records count from power-on.
  virtual void Finish(BootTime end) = 0;
};

class LocalLine final : public Line {
 public:
  // `sink`: gets the line's records; it must outlive the line. `client`: place in the scenario of the line's client.
  // `paced`: bytes take their time here. On a line to a real serial port they do not: there the hardware sets the pace.
  // The line keeps the scenario's protocol. `use`: of its schedule of faults.
  LocalLine(const Scenario& scenario, RecordSink& sink, std::size_t client = 0, bool paced = true,
            const faults::ScheduleUse& use = {});

  // One more fault of the scenario, while it flies.
  void Add(const faults::FaultSpec& fault);
  // The open fault of the line's use (FaultSchedule::Give).
  void Give(const faults::FaultSpec& fault) { faults_.Give(fault); }
  // When all that was sent so far, on the whole line, has left its senders.
  BootTime FreeTime() const;

  BootTime Transmit(link::Direction direction, BootTime now, std::span<const std::uint8_t> bytes) override;
  BootTime NextArrival(link::Direction direction) const override;
  std::optional<Piece> TakePiece(link::Direction direction, BootTime until) override;
  void SetOrigin(Origin origin) override;
  const LineCounts& counts() const override;
  const std::optional<Overfull>& overfull() const override { return overfull_; }
  std::vector<faults::FaultEvent> PollEvents() override { return faults_.PollEvents(); }
  void Hear(std::span<const faults::FaultEvent> events) override { faults_.Hear(events); }
  void Finish(BootTime end) override;
  // Writes what faults did since the last call. Finish() does, too.
  void WriteActivations();

  // Arrival at the client of the latest valid reply, or message of the server's own, while its actuators are awaited; otherwise Never().
  BootTime unanswered_reply() const { return replied_ns_; }
  Origin origin() const { return origin_; }

 private:
  template <class Array>
  static auto& At(Array& array, link::Direction direction) {
    return array[static_cast<std::size_t>(direction)];
  }
  // Puts what the faults of this direction have sent back on the way back.
  void SendBack(link::Direction direction, BootTime now);
  void NoteOverfull(link::Direction direction);
  void OnClientMessage(BootTime arrival, const link::Message& message);
  void OnServerMessage(BootTime arrival, const ReceivingEnd::FrameName& name, const link::Message& message);
  void OnReply(BootTime arrival, const ReceivingEnd::FrameName& name);

  std::shared_ptr<const link::Protocol> protocol_;
  std::vector<std::string> fault_ids_;
  faults::FaultSchedule faults_;
  std::array<link::Wire, link::kDirectionCount> wires_;
  std::array<ReceivingEnd, link::kDirectionCount> ends_;
  mutable LineCounts counts_{};
  std::optional<Overfull> overfull_;
  Origin origin_;

  // The latest request. The replies that are on their way or lost, in order of their numbers, with the
  // arrival of the request that each one answers.
  struct Reply {
    ReceivingEnd::FrameName name;
    BootTime requested_ns;  // Never(): it has arrived
  };
  BootTime requested_ns_ = BootTime::Never();
  std::deque<Reply> replies_;
  BootTime replied_ns_ = BootTime::Never();  // arrival of the latest reply that no actuators have answered

  PartRecords records_;
  EventLimit events_;
};

// The lines of a flight's clients.
class LocalLines {
 public:
  LocalLines(const Scenario& scenario, RecordSink& sink, const faults::ScheduleUse& use = {}) {
    for (std::size_t client = 0; client < scenario.client_count(); ++client)
      all_.push_back(&lines_.emplace_back(scenario, sink, client, true, use));
  }
  std::span<Line* const> all() { return all_; }
  std::deque<LocalLine>& local() { return lines_; }

 private:
  std::deque<LocalLine> lines_;
  std::vector<Line*> all_;
};

}  // namespace tiltproof::harness
