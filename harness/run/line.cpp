#include "harness/run/line.h"

#include <algorithm>
#include <string>
#include <utility>

namespace tiltproof::harness {
namespace {

using link::Direction;
using link::kDirections;

// Ten minutes of them: more than any line holds back.
constexpr std::size_t kRepliesMax = 50'000;

}  // namespace

Overfull OverfullOf(const std::string& where, const faults::FaultSchedule::Crowd& crowd,
                    const std::vector<std::string>& fault_ids) {
  Overfull overfull;
  overfull.text = "more than " + std::to_string(link::kLineBytesMax >> 20) + " MiB wait on the " + where;
  const auto name = [&](std::string_view deed, const std::vector<std::size_t>& faults) {
    for (std::size_t i = 0; i < faults.size(); ++i)
      overfull.text.append(i > 0 ? ", '" : (overfull.by_faults ? "; " : ": ") + std::string(deed) + " '")
          .append(fault_ids[faults[i]])
          .append("'");
    overfull.by_faults = overfull.by_faults || !faults.empty();
  };
  name("multiplied by", crowd.multipliers);
  name("held back by", crowd.holders);
  if (!overfull.by_faults) overfull.text += ": more is sent than it carries";
  return overfull;
}

faults::FaultSchedule ClientFaults(const Scenario& scenario, std::size_t client,
                                   const VehicleSignals* signals, const faults::ScheduleUse& use) {
  const std::string id = scenario.has_several_clients() ? scenario.client_id(client) : "";
  faults::FaultSchedule::Place place{.baud = scenario.link.main_rate().baud,
                                     .reference_baud = scenario.link.reference_rate().baud,
                                     .character = scenario.link.character};
  place.protocol = scenario.link.protocol;
  place.step_ns = scenario.step_ns;
  place.client = id;
  place.use = use;
  if (signals != nullptr) place.signals = *signals;
  return {scenario.faults, scenario.seed_of(client), place};
}

LocalLine::LocalLine(const Scenario& scenario, RecordSink& sink, std::size_t client, bool paced,
                     const faults::ScheduleUse& use)
    : protocol_(scenario.link.protocol),
      fault_ids_([&] {
        std::vector<std::string> ids;
        for (const auto& fault : scenario.faults) ids.push_back(fault.id);
        return ids;
      }()),
      faults_(ClientFaults(scenario, client, nullptr, use)),
      wires_{[&] {
        const auto wire = [&](Direction direction, double latency_ms) {
          const link::LineRate rate =
              direction == Direction::kReference ? scenario.link.reference_rate() : scenario.link.main_rate();
          link::WireConfig config{.baud = paced ? rate.baud : 0,
                                  .adapter_latency_ns = FromSeconds(latency_ms * 1e-3),
                                  .character = rate.character};
          if (scenario.link.adapter && direction != Direction::kReference) {
            config.adapter_latency_ns = FromSeconds(scenario.link.adapter->latency_ms * 1e-3);
            config.adapter_bytes_count = scenario.link.adapter->bytes_count;
          }
          return link::Wire(config, direction, *protocol_, faults_.Filter(direction));
        };
        // The adapter's receive buffer is between the firmware and the server; in the other direction it
        // sends at once.
        return std::array{wire(Direction::kToPlant, scenario.link.adapter_latency_ms),
                          wire(Direction::kToClient, 0), wire(Direction::kReference, 0)};
      }()},
      ends_{[&] {
        const auto end = [&](Direction direction) {
          return ReceivingEnd(*protocol_, direction, faults_.MayAlter(direction));
        };
        return std::array{end(Direction::kToPlant), end(Direction::kToClient), end(Direction::kReference)};
      }()},
      records_(sink, client) {
  for (const Direction direction : kDirections) {
    ReceivingEnd& end = At(ends_, direction);
    At(wires_, direction)
        .SetTaps({.sent =
                      [this, &end, direction](const link::Chunk& chunk) {
                        records_.WriteBytes(chunk.begin_ns, direction, ByteSide::kSent, chunk.bytes);
                        end.OnSent(chunk);
                      },
                  .delivered =
                      [this, &end, direction](const link::Chunk& chunk) {
                        records_.WriteBytes(chunk.begin_ns, direction, ByteSide::kDelivered, chunk.bytes);
                        end.OnDelivered(chunk);
                      },
                  .passed_on =
                      [this, direction](BootTime at, std::span<const std::uint8_t> bytes) {
                        records_.WriteBytes(at, direction, ByteSide::kPassedOn, bytes);
                      }});
  }
  At(ends_, Direction::kToClient).SetOnSentFrame([this](const ReceivingEnd::FrameName& name) {
    // The authors' server answers before t = 0 too; that is not timed.
    if (protocol_->streams() || !origin_.known() || requested_ns_ == BootTime::Never()) return;
    if (replies_.size() == kRepliesMax) replies_.pop_front();
    replies_.push_back({name, requested_ns_});
  });
}

void LocalLine::Add(const faults::FaultSpec& fault) {
  faults_.Add(fault);
  fault_ids_.push_back(fault.id);
}

BootTime LocalLine::FreeTime() const {
  BootTime free = BootTime::Earliest();
  for (const link::Wire& wire : wires_) free = std::max(free, wire.free_ns());
  return free;
}

BootTime LocalLine::Transmit(Direction direction, BootTime now, std::span<const std::uint8_t> bytes) {
  const BootTime sent = At(wires_, direction).Transmit(now, bytes);
  SendBack(direction, now);
  NoteOverfull(direction);
  return sent;
}

// Nothing comes back before all of it has left, nor before the line knew of it: the sender's time may be `now`.
void LocalLine::SendBack(Direction direction, BootTime now) {
  for (const link::Chunk& chunk : faults_.TakeSentBack(direction)) {
    const Direction back = *link::Opposite(direction);
    link::Wire& wire = At(wires_, back);
    const TimeNs duration = wire.BytesTime(static_cast<std::int64_t>(chunk.bytes.size()));
    wire.Insert(std::max(chunk.begin_ns + duration, now), chunk.bytes);
    NoteOverfull(back);
  }
}

void LocalLine::NoteOverfull(Direction direction) {
  if (overfull_ || !At(wires_, direction).overfull()) return;
  overfull_ = OverfullOf("line " + std::string(Name(direction)), faults_.CrowdOf(direction), fault_ids_);
}

BootTime LocalLine::NextArrival(Direction direction) const { return At(wires_, direction).NextArrival(); }

std::optional<Line::Piece> LocalLine::TakePiece(Direction direction, BootTime until) {
  const auto taken = At(wires_, direction).TakePiece(until);
  SendBack(direction, until);  // bytes that end no frame
  NoteOverfull(direction);
  if (!taken) return std::nullopt;
  Piece piece{taken->arrival_ns, taken->bytes, nullptr, taken->parity_errors};
  At(ends_, direction)
      .Receive(
          *taken,
          [&](const ReceivingEnd::FrameName& name, const link::Message& message) {
            if (direction == Direction::kToPlant) {
              OnClientMessage(piece.arrival_ns, message);
              piece.message = &message;
            }
            if (direction == Direction::kToClient) OnServerMessage(piece.arrival_ns, name, message);
          },
          [&](std::string_view reason) {
            if (auto event =
                    events_.Pass("rejected", std::string(Name(direction)) + ": " + std::string(reason)))
              records_.Write(piece.arrival_ns, *std::move(event));
          });
  return piece;
}

void LocalLine::SetOrigin(Origin origin) {
  origin_ = origin;
  faults_.SetOrigin(origin);
  records_.SetOrigin(origin);
}

void LocalLine::OnClientMessage(BootTime arrival, const link::Message& message) {
  if (!message.type->reply.empty()) requested_ns_ = arrival;
  if (message.type->has_signals() && replied_ns_ != BootTime::Never()) {
    records_.Write(arrival, record::Answer{arrival - replied_ns_});
    replied_ns_ = BootTime::Never();
  }
}

// Without requests, the client answers what the server sends once in each period or more often.
void LocalLine::OnServerMessage(BootTime arrival, const ReceivingEnd::FrameName& name,
                                const link::Message& message) {
  if (!protocol_->streams()) return OnReply(arrival, name);
  const TimeNs period_ns = message.type->period_ns;
  if (origin_.known() && period_ns > 0 && period_ns <= protocol_->control_period_ns) replied_ns_ = arrival;
}

// Late, repeated and lost replies are distinguished by the number of their frame, whatever their content. A
// reply whose content differs from what was sent under its number does not count.
void LocalLine::OnReply(BootTime arrival, const ReceivingEnd::FrameName& name) {
  const auto found =
      std::lower_bound(replies_.begin(), replies_.end(), name.number,
                       [](const Reply& reply, std::uint64_t number) { return reply.name.number < number; });
  if (found == replies_.end() || found->requested_ns == BootTime::Never() || found->name != name) return;
  records_.Write(arrival, record::Reply{arrival - found->requested_ns});
  replied_ns_ = arrival;
  found->requested_ns = BootTime::Never();
  while (!replies_.empty() && replies_.front().requested_ns == BootTime::Never()) replies_.pop_front();
}

const LineCounts& LocalLine::counts() const {
  for (const Direction direction : kDirections) At(counts_, direction) = At(ends_, direction).counts();
  return counts_;
}

void LocalLine::WriteActivations() {
  for (faults::Activation& activation : faults_.TakeActivations(origin_)) {
    const TimeNs time_ns = activation.time_ns;
    records_.Write(time_ns, std::move(activation));
  }
}

void LocalLine::Finish(BootTime end) {
  records_.SetOrigin(origin_.OrPowerOn());
  WriteActivations();
  records_.Write(end, record::ActivationCounts{faults_.ActivationCounts()});
  record::LineEnd totals{.counts = counts()};
  for (const ReceivingEnd& receiving : ends_) {
    totals.resync_max_ns = std::max(totals.resync_max_ns, receiving.ResyncMax(end));
    totals.accepted_wrong_count += receiving.wrong_count();
    totals.accepted_stale_count += receiving.stale_count();
  }
  records_.Write(end, totals);
}

}  // namespace tiltproof::harness
