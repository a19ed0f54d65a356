#include "harness/run/protocol_use.h"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <string>
#include <vector>

#include "harness/run/message_receiver.h"

namespace tiltproof::harness {
namespace {

using link::Direction;

// In the order in which they follow each other where no byte takes time.
enum class Kind : std::uint8_t { kRequest, kReply, kActuators };
struct Happening {
  TimeNs time_ns;
  Kind kind;
};

// Calls on_frame(begin of its last chunk, end of that, frame) for each frame of one direction, on one side of the faults.
template <class OnFrame>
void ForEachFrame(const LinkLog& link, WireId wire, bool delivered, const link::Protocol& protocol,
                  std::int64_t baud, const OnFrame& on_frame) {
  MessageReceiver receiver(protocol, wire.direction);
  std::size_t offset = 0;
  while (const auto record = link.Next(offset)) {
    if (record->delivered != delivered || record->wire != wire) continue;
    const TimeNs end_ns =
        record->begin_ns + link::BytesTime(baud, static_cast<std::int64_t>(record->bytes.size()));
    receiver.ReceiveFrames(0, record->bytes, [&](const MessageReceiver::Frame& frame) {
      on_frame(record->begin_ns, end_ns, frame);
    });
  }
}

std::int64_t RequestsPerPeriod(const std::vector<Happening>& happenings, TimeNs period_ns) {
  // A clock may be off by some percent: one request a period is one in nine tenths of it.
  const TimeNs span_ns = period_ns / 10 * 9;
  std::deque<TimeNs> recent;
  std::size_t most = 0;
  for (const Happening& happening : happenings) {
    if (happening.kind != Kind::kRequest) continue;
    recent.push_back(happening.time_ns);
    while (happening.time_ns - recent.front() >= span_ns) recent.pop_front();
    most = std::max(most, recent.size());
  }
  return static_cast<std::int64_t>(most);
}

// Of a whole message: its first field that is not plausible.
std::string ImplausibleField(const link::MessageType& type, std::span<const std::uint8_t> payload) {
  for (std::size_t i = 0; i < type.fields.size(); ++i) {
    const link::MessageField& field = type.fields[i];
    const float value = link::FieldValue(type, payload, i);
    if (!(field.min <= value && value <= field.max))
      return fmt::format("{} = {}, plausible is {} to {}", field.signal, value, field.min, field.max);
  }
  return "a message that it refuses";
}

// Of the firmware's own making, which no server takes.
void AddEvent(RunLog& log, std::size_t client, TimeNs time_ns, std::string_view kind, std::string text) {
  const auto later =
      std::upper_bound(log.events.begin(), log.events.end(), time_ns,
                       [](TimeNs time, const RunEvent& event) { return time < event.time_ns; });
  log.events.insert(later, {time_ns, std::string(kind), std::move(text),
                            log.clients.size() > 1 ? std::optional(client) : std::nullopt});
}

}  // namespace

void AddProtocolUse(RunLog& log, std::size_t client, const link::Protocol& protocol, std::int64_t baud) {
  const LinkLog& link = log.link;
  ProtocolUse use{.refused_commands = 0};
  std::vector<Happening> happenings;
  ForEachFrame(link, {client, Direction::kToPlant}, false, protocol, baud,
               [&](TimeNs begin_ns, TimeNs /*end_ns*/, const MessageReceiver::Frame& frame) {
                 if (frame.message == nullptr) {
                   const std::int64_t others = use.malformed_sent++ - *use.refused_commands;
                   const link::MessageType* type = protocol.Classify(Direction::kToPlant, frame.payload);
                   if (type == nullptr || type->kind != link::MessageKind::kActuators) {
                     if (others > 0) return;
                     AddEvent(
                         log, client, begin_ns, kMalformedSentEvent,
                         fmt::format("the firmware sent a frame that is no message: {}", frame.rejected));
                   } else if ((*use.refused_commands)++ == 0) {
                     // It is dropped and the command before stays in force, so that nothing else shows it.
                     AddEvent(log, client, begin_ns, kCommandRefusedEvent,
                              "the server refused a command: " + ImplausibleField(*type, frame.payload));
                   }
                 } else if (!frame.message->type->reply.empty()) {
                   happenings.push_back({begin_ns, Kind::kRequest});
                 } else if (frame.message->type->kind == link::MessageKind::kActuators) {
                   happenings.push_back({begin_ns, Kind::kActuators});
                 }
               });
  ForEachFrame(link, {client, Direction::kToClient}, true, protocol, baud,
               [&](TimeNs /*begin_ns*/, TimeNs end_ns, const MessageReceiver::Frame& frame) {
                 if (frame.message != nullptr) happenings.push_back({end_ns, Kind::kReply});
               });
  std::stable_sort(happenings.begin(), happenings.end(), [](const Happening& a, const Happening& b) {
    return a.time_ns != b.time_ns ? a.time_ns < b.time_ns : a.kind < b.kind;
  });
  use.requests_per_period_max = RequestsPerPeriod(happenings, protocol.control_period_ns);

  bool asked = false, replied = false, answered = false;
  std::int64_t actuators = 0, early = 0;
  for (const Happening& happening : happenings) {
    switch (happening.kind) {
      case Kind::kRequest:
        use.actuators_per_request_max = std::max(use.actuators_per_request_max, actuators);
        use.actuators_before_reply += early;
        use.replies_unanswered += asked && replied && !answered ? 1 : 0;
        asked = true;
        replied = answered = false;
        actuators = early = 0;
        break;
      case Kind::kReply:
        replied = true;
        break;
      case Kind::kActuators:
        ++actuators;
        early += asked && !replied ? 1 : 0;
        answered = answered || replied;
        break;
    }
  }
  log.clients.at(client).protocol = use;
}

}  // namespace tiltproof::harness
