#include "harness/run/client_history.h"

#include "harness/client/client.h"
#include "harness/run/message_receiver.h"

namespace tiltproof::harness {
namespace {

// The messages of the client as it sent them. Calls visit(begin_ns, message).
template <class Visit>
void ForEachSentMessage(const LinkLog& link, std::size_t client, const link::Protocol& protocol,
                        const Visit& visit) {
  MessageReceiver receiver(protocol, link::Direction::kToPlant);
  std::size_t offset = 0;
  while (const auto record = link.Next(offset)) {
    if (record->delivered || record->wire != WireId{client, link::Direction::kToPlant}) continue;
    receiver.Receive(record->bytes, [&](const link::Message& message) { visit(record->begin_ns, message); });
  }
}

}  // namespace

void AddClientHistory(RunLog& log, std::size_t client, const link::Protocol& protocol, BootSign sign) {
  ClientLog& own = log.clients.at(client);
  own.restarts.clear();
  own.sent_request_times_ns.clear();
  const bool by_start = sign == BootSign::kStart && protocol.repeated_start_is_boot;
  const TimeNs answered_ns = own.actuator_times_ns.empty() ? kNever : own.actuator_times_ns.front();
  ForEachSentMessage(log.link, client, protocol, [&](TimeNs time_ns, const link::Message& message) {
    if (!message.type->reply.empty()) own.sent_request_times_ns.push_back(time_ns);
    if (by_start && message.type->starts && time_ns > answered_ns)
      own.restarts.push_back({time_ns, "it sent `start` again"});
  });
  if (sign != BootSign::kReset || own.starts_accepted_count == 0) return;
  for (const RunEvent& event : log.events)
    if (event.kind == kResetEvent && event.client.value_or(0) == client && event.time_ns > 0)
      own.restarts.push_back({event.time_ns, event.text});
}

void ExplainNeverStarted(RunLog& log) {
  if (log.end_reason != EndReason::kNeverStarted) return;
  for (const RunEvent& event : log.events)
    if (event.kind == kLineTroubleEvent || event.kind == kBoardStateEvent) log.end_text += "; " + event.text;
}

}  // namespace tiltproof::harness
