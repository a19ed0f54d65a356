#include "harness/run/client_history.h"

#include <fmt/format.h>

#include <map>

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

// What the server heard of a client that it could not start with.
std::string Heard(const LinkLog& link, std::size_t client, const link::Protocol& protocol) {
  MessageReceiver receiver(protocol, link::Direction::kToPlant);
  std::map<std::string, std::size_t, std::less<>> messages, refused;
  std::size_t offset = 0, bytes_count = 0;
  while (const auto record = link.Next(offset)) {
    if (!record->delivered || record->wire != WireId{client, link::Direction::kToPlant}) continue;
    bytes_count += record->bytes.size();
    receiver.ReceiveFrames(0, record->bytes, [&](const MessageReceiver::Frame& frame) {
      frame.message != nullptr ? ++messages[frame.message->type->name]
                               : ++refused[std::string(frame.rejected)];
    });
  }
  if (bytes_count == 0) return "not a byte arrived from the firmware";
  std::string text = fmt::format("{} bytes arrived", bytes_count);
  for (const auto& [name, count] : messages) text += fmt::format(", {} x `{}`", count, name);
  for (const auto& [why, count] : refused)
    text += fmt::format(", {} frame{} refused ({})", count, count == 1 ? "" : "s", why);
  if (messages.empty() && refused.empty()) text += ", and no frame among them";
  if (!messages.empty()) text += "; if it was running already, reset it: a flight begins with `start`";
  return text;
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

void ExplainNeverStarted(RunLog& log, const link::Protocol& protocol) {
  if (log.end_reason != EndReason::kNeverStarted) return;
  for (std::size_t client = 0; client < log.clients.size(); ++client) {
    if (log.clients[client].starts_accepted_count != 0) continue;
    log.end_text += log.clients.size() == 1 ? "; " : fmt::format("; client {}: ", client + 1);
    log.end_text += Heard(log.link, client, protocol);
  }
  for (const RunEvent& event : log.events)
    if (event.kind == kLineTroubleEvent || event.kind == kBoardStateEvent) log.end_text += "; " + event.text;
}

}  // namespace tiltproof::harness
