#include "harness/run/client_history.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

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

// Describes the bytes that the server got from a client that it could not start with.
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
  if (!messages.empty()) text += "; if it was running already, reset it: a flight starts with `start`";
  return text;
}

// A sign of a client's boots; signs are kept in order of time.
struct Sign {
  TimeNs time_ns = 0;
  enum Kind : std::uint8_t { kReset, kStart, kActuators } kind = kReset;
  std::string text;
};

// In real time, a reset may be reported some periods after the `start` that follows it.
constexpr TimeNs kReportedLateMax = 50 * kNsPerMs;

std::vector<Restart> RestartsFrom(const std::vector<Sign>& signs, TimeNs first_answer_ns) {
  std::vector<Restart> restarts;
  enum : std::uint8_t { kFlies, kWasReset, kHasStarted } state = kHasStarted;
  // A reset that is reported until then is the restart that a `start` has shown.
  TimeNs reported_until_ns = -kNever;
  for (const Sign& sign : signs) {
    switch (sign.kind) {
      case Sign::kReset:
        if (sign.time_ns <= reported_until_ns) {
          restarts.back().cause = sign.text;
        } else {
          restarts.push_back({sign.time_ns, sign.text});
          state = kWasReset;
        }
        reported_until_ns = -kNever;
        break;
      case Sign::kStart:
        if (state == kFlies && sign.time_ns > first_answer_ns) {
          restarts.push_back({sign.time_ns, sign.text});
          reported_until_ns = sign.time_ns + kReportedLateMax;
        }
        state = kHasStarted;
        break;
      case Sign::kActuators:
        if (state == kHasStarted) state = kFlies;
        break;
    }
  }
  return restarts;
}

}  // namespace

void AddClientHistory(RunLog& log, std::size_t client, const link::Protocol& protocol) {
  ClientLog& own = log.clients.at(client);
  own.sent_request_times_ns.clear();
  std::vector<Sign> signs;
  if (own.starts_accepted_count != 0) {
    for (const RunEvent& event : log.events)
      if (event.kind == kResetEvent && event.client.value_or(0) == client && event.time_ns > 0)
        signs.push_back({event.time_ns, Sign::kReset, event.text});
  }
  const link::MessageType& period_message = protocol.PeriodMessage();
  ForEachSentMessage(log.link, client, protocol, [&](TimeNs time_ns, const link::Message& message) {
    if (message.type == &period_message) own.sent_request_times_ns.push_back(time_ns);
    if (!protocol.repeated_start_is_boot) return;
    if (message.type->starts) signs.push_back({time_ns, Sign::kStart, "it sent `start` again"});
    if (message.type->has_signals()) signs.push_back({time_ns, Sign::kActuators, {}});
  });
  std::stable_sort(signs.begin(), signs.end(),
                   [](const Sign& a, const Sign& b) { return a.time_ns < b.time_ns; });
  own.restarts = RestartsFrom(signs, own.actuator_times_ns.empty() ? kNever : own.actuator_times_ns.front());
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
