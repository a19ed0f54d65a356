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

using Sign = ClientHistory::Sign;

// In real time, a reset may be reported some periods after the `start` that follows it.
constexpr TimeNs kReportedLateMax = 50 * kNsPerMs;

// `signs`: in order of time.
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

ClientHistory::ClientHistory(const link::Protocol& protocol)
    : protocol_(protocol), receiver_(protocol, link::Direction::kToPlant) {}

void ClientHistory::Receive(TimeNs begin_ns, std::span<const std::uint8_t> bytes) {
  receiver_.Receive(bytes, [&](const link::Message& message) {
    if (message.type == &protocol_.PeriodMessage()) requests_ns_.push_back(begin_ns);
    if (!protocol_.repeated_start_is_boot) return;
    if (message.type->starts) signs_.push_back({begin_ns, Sign::kStart, "it sent `start` again"});
    // Only the first command after a `start` shows anything.
    const bool is_first = signs_.empty() || signs_.back().kind == Sign::kStart;
    if (message.type->has_signals() && is_first) signs_.push_back({begin_ns, Sign::kActuators, {}});
  });
}

void ClientHistory::AddTo(RunLog& log, std::size_t client) const {
  ClientLog& own = log.clients.at(client);
  own.sent_request_times_ns = requests_ns_;
  std::vector<Sign> signs;
  if (own.starts_accepted_count != 0) {
    for (const RunEvent& event : log.events)
      if (event.kind == kResetEvent && event.client.value_or(0) == client && event.time_ns > 0)
        signs.push_back({event.time_ns, Sign::kReset, event.text});
  }
  signs.insert(signs.end(), signs_.begin(), signs_.end());
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
