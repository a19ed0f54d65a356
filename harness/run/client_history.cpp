#include "harness/run/client_history.h"

#include "harness/client/client.h"
#include "link/frame.h"

namespace tiltproof::harness {
namespace {

// The messages of the client as it sent them. Calls visit(begin_ns, message).
template <class Visit>
void ForEachSentMessage(const LinkLog& link, link::Dialect dialect, const Visit& visit) {
  link::FrameDecoder decoder;
  std::size_t offset = 0;
  while (const auto record = link.Next(offset)) {
    if (record->delivered || record->direction != link::Direction::kToPlant) continue;
    std::span<const std::uint8_t> bytes = record->bytes;
    while (const auto event = decoder.Next(bytes)) {
      link::ClientMessage message;
      if (event->status == link::FrameStatus::kOk &&
          DecodeClientMessage(dialect, event->payload, message) == link::MessageStatus::kOk)
        visit(record->begin_ns, message);
    }
  }
}

}  // namespace

void AddClientHistory(RunLog& log, link::Dialect dialect, BootSign sign) {
  log.restarts.clear();
  log.sent_request_times_ns.clear();
  // In `provant` each actuator message may say `start`.
  const bool by_start = sign == BootSign::kStart && dialect == link::Dialect::kPaper;
  const TimeNs answered_ns = log.actuator_times_ns.empty() ? kNever : log.actuator_times_ns.front();
  ForEachSentMessage(log.link, dialect, [&](TimeNs time_ns, const link::ClientMessage& message) {
    if (message.read_sensors) log.sent_request_times_ns.push_back(time_ns);
    if (by_start && message.start && time_ns > answered_ns)
      log.restarts.push_back({time_ns, "it sent `start` again"});
  });
  if (sign != BootSign::kReset || log.starts_accepted_count == 0) return;
  for (const RunEvent& event : log.events)
    if (event.kind == kResetEvent && event.time_ns > 0) log.restarts.push_back({event.time_ns, event.text});
}

void ExplainNeverStarted(RunLog& log) {
  if (log.end_reason != EndReason::kNeverStarted) return;
  for (const RunEvent& event : log.events)
    if (event.kind == kLineTroubleEvent) log.end_text += "; " + event.text;
}

}  // namespace tiltproof::harness
