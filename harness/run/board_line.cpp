#include "harness/run/board_line.h"

#include <algorithm>
#include <string>
#include <utility>

#include "link/raw_framing.h"

namespace tiltproof::harness {
namespace {

using link::Direction;

faults::FaultSchedule FaultsOf(const Scenario& scenario, std::size_t line,
                               const std::shared_ptr<const link::Protocol>& protocol,
                               const faults::ScheduleUse& use) {
  const LineEntry& entry = scenario.lines.at(line);
  faults::FaultSchedule::Place place{.baud = entry.baud, .reference_baud = entry.baud};
  place.protocol = protocol;
  place.step_ns = scenario.step_ns;
  place.line = entry.id;
  place.use = use;
  return {scenario.faults, scenario.seed_of_line(line), place};
}

}  // namespace

BoardLine::BoardLine(const Scenario& scenario, std::size_t line, RecordSink& sink, bool paced,
                     const faults::ScheduleUse& use)
    : id_(scenario.lines.at(line).id),
      ends_(scenario.lines[line].between),
      protocol_(scenario.lines[line].protocol == nullptr ? link::RawProtocol()
                                                         : scenario.lines[line].protocol),
      rate_(scenario.lines[line].rate()),
      faults_(FaultsOf(scenario, line, protocol_, use)),
      // A client that runs on may be a byte time ahead of the others (Conductor::Horizon).
      to_first_({.baud = paced ? rate_.baud : 0, .least_latency_ns = paced ? rate_.BytesTime(1) : 0},
                DirectionTo(0), *protocol_, faults_.Filter(DirectionTo(0))),
      to_second_({.baud = paced ? rate_.baud : 0, .least_latency_ns = paced ? rate_.BytesTime(1) : 0},
                 DirectionTo(1), *protocol_, faults_.Filter(DirectionTo(1))),
      bytes_(sink, scenario.client_count() + line),
      records_(sink, std::nullopt) {
  for (const faults::FaultSpec& fault : scenario.faults) fault_ids_.push_back(fault.id);
  for (std::size_t end = 0; end < 2; ++end) {
    const Direction direction = DirectionTo(end);
    const auto tap = [this, direction](ByteSide side) {
      return [this, direction, side](const link::Chunk& chunk) {
        bytes_.WriteBytes(chunk.begin_ns, direction, side, chunk.bytes);
      };
    };
    WireTo(end).SetTaps({.sent = tap(ByteSide::kSent), .delivered = tap(ByteSide::kDelivered)});
  }
}

BootTime BoardLine::Transmit(std::size_t end, BootTime now, std::span<const std::uint8_t> bytes) {
  const BootTime sent = WireTo(1 - end).Transmit(now, bytes);
  AfterWire(1 - end, now);
  return sent;
}

std::optional<BoardLine::Piece> BoardLine::TakePiece(std::size_t end, BootTime until) {
  const auto taken = WireTo(end).TakePiece(until);
  AfterWire(end, until);  // bytes that end no frame
  if (!taken) return std::nullopt;
  faults_.MarkReceived(DirectionTo(end), taken->arrival_ns, taken->bytes, marks_, taken->parity_errors);
  return Piece{taken->arrival_ns, taken->bytes, marks_};
}

// Nothing comes back before all of it has left, nor before the line knew of it.
void BoardLine::AfterWire(std::size_t to, BootTime now) {
  for (const link::Chunk& chunk : faults_.TakeSentBack(DirectionTo(to))) {
    link::Wire& back = WireTo(1 - to);
    const TimeNs duration = rate_.BytesTime(static_cast<std::int64_t>(chunk.bytes.size()));
    back.Insert(std::max(chunk.begin_ns + duration, now), chunk.bytes);
    NoteOverfull(1 - to);
  }
  NoteOverfull(to);
}

void BoardLine::NoteOverfull(std::size_t to) {
  if (overfull_[1 - to] || !WireTo(to).overfull()) return;
  overfull_[1 - to] =
      OverfullOf("line " + id_ + " to " + ends_[to], faults_.CrowdOf(DirectionTo(to)), fault_ids_);
}

void BoardLine::Add(const faults::FaultSpec& fault) {
  faults_.Add(fault);
  fault_ids_.push_back(fault.id);
}

BootTime BoardLine::FreeTime() const { return std::max(to_first_.free_ns(), to_second_.free_ns()); }

void BoardLine::SetOrigin(Origin origin) {
  origin_ = origin;
  faults_.SetOrigin(origin);
  bytes_.SetOrigin(origin);
  records_.SetOrigin(origin);
}

void BoardLine::WriteActivations() {
  for (faults::Activation& activation : faults_.TakeActivations(origin_)) {
    const TimeNs time_ns = activation.time_ns;
    records_.Write(time_ns, std::move(activation));
  }
}

void BoardLine::Finish(BootTime end) {
  bytes_.SetOrigin(origin_.OrPowerOn());
  records_.SetOrigin(origin_.OrPowerOn());
  WriteActivations();
  records_.Write(end, record::ActivationCounts{faults_.ActivationCounts()});
}

}  // namespace tiltproof::harness
