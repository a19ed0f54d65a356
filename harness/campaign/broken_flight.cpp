#include "harness/campaign/broken_flight.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "faults/random.h"
#include "harness/campaign/hostile_sequence.h"
#include "harness/client/client.h"
#include "harness/engine/flight_job.h"

namespace tiltproof::harness {
namespace {

// A criterion of a campaign, and the kind of what breaks it.
struct FuzzOracle {
  std::string_view criterion, kind;
};
constexpr FuzzOracle kSilence{"talks-again", "silence"};
constexpr FuzzOracle kMessages{"sends-only-messages", "command"};
constexpr FuzzOracle kIgnored{"answers-whole-replies", "ignored"};
constexpr FuzzOracle kStale{"commands-once-a-reply", "stale"};
// The first that is broken names the finding: a client that is silent answers nothing, either.
constexpr std::array kFuzzOracles = {kMessages, kSilence, kIgnored, kStale};

bool IsDigit(char c) { return c >= '0' && c <= '9'; }
bool IsHexDigit(char c) { return IsDigit(c) || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); }
bool IsWord(char c) { return IsHexDigit(c) || (c >= 'g' && c <= 'z') || (c >= 'G' && c <= 'Z') || c == '_'; }

// The first of a kind during the flight; null when there is none.
const FlightEvent* EventOf(const FlightResult& result, std::string_view kind) {
  const auto event = std::ranges::find_if(
      result.events, [&](const FlightEvent& one) { return one.kind == kind && one.time_s > 0; });
  return event == result.events.end() ? nullptr : &*event;
}
bool BrokeBy(const FlightResult& result, FirmwareEndKind kind) {
  return result.firmware_end && result.firmware_end->kind == kind;
}

// The place of a crash in a library. The same mistake has one place and several texts, because the C library reports a damaged
// heap in other words when other memory is allocated. Without a place, the reason without its numbers.
std::string KeyOfCrash(const FlightResult& result, const std::string& how) {
  const bool has_place = result.firmware_end && !result.firmware_end->place.empty();
  return has_place ? result.firmware_end->place : KeyOfReason(how, true);
}

BrokenFlight DamagedMemory(const FlightResult& result) {
  constexpr std::string_view kDamaged = "the firmware damaged memory, noticed outside its code";
  return {.kind = "crash",
          .key = fmt::format("crash: {}", kDamaged),
          .reason = fmt::format("{}: {}", kDamaged, result.score.reason),
          .may_pass =
              "What damaged memory does depends on the process: this flight may pass while the defect is "
              "there. A library built with -fsanitize=address fails where the mistake is made."};
}

BrokenFlight EndedBySignal(const FlightEvent& event) {
  return {.kind = "crash",
          .key = fmt::format("crash: {}", KeyOfReason(event.text)),
          .reason = fmt::format("the firmware ends its process by a signal, again and again: {}", event.text),
          .may_pass =
              "Every other command calls this an error (exit code 3), because one flight alone does not show "
              "who sent the signal."};
}

std::string TextOfEvent(const FlightResult& result, std::string_view kind) {
  const FlightEvent* const event = EventOf(result, kind);
  return event == nullptr ? "" : event->text;
}

}  // namespace

std::string BrokenFlight::Name() const {
  const std::uint64_t hash = faults::StreamKey(0, {key});
  return fmt::format("{}-{:08x}", kind, static_cast<std::uint32_t>(hash ^ hash >> 32));
}

std::vector<CriterionSpec> FuzzCriteria(const link::Protocol& protocol) {
  const double half_tail_ms = static_cast<double>(protocol.control_period_ns) / 1e6 * kTailPeriods / 2;
  const auto at_most = [](const FuzzOracle& oracle, std::string metric, double max) {
    return CriterionSpec{.name = std::string(oracle.criterion),
                         .stl = {},
                         .metric = std::move(metric),
                         .min = std::nullopt,
                         .max = max};
  };
  std::vector<CriterionSpec> criteria = {at_most(kMessages, "protocol.malformed_sent_count", 0),
                                         at_most(kSilence, "timing.silent_at_end_ms", half_tail_ms)};
  if (protocol.streams()) return criteria;  // nothing answers a request
  criteria.push_back(at_most(kIgnored, "protocol.replies_ignored_count", 0));
  criteria.push_back(at_most(kStale, "protocol.commands_without_reply_count", 0));
  return criteria;
}

bool DependsOnDesign(const CriterionSpec& criterion) {
  return criterion.name == kIgnored.criterion || criterion.name == kStale.criterion;
}

std::optional<std::string> WhyByDesign(const CriterionSpec& criterion, const FlightResult& well_formed) {
  const bool holds = std::ranges::none_of(well_formed.score.criteria, [&](const CriterionResult& one) {
    return one.name == criterion.name && one.verdict == Verdict::kFail;
  });
  if (holds || !DependsOnDesign(criterion)) return std::nullopt;
  const bool ignores = criterion.name == kIgnored.criterion;
  return fmt::format("this firmware {} where no frame is broken: that is no finding",
                     ignores ? "ignores whole replies" : "commands without a reply");
}

std::string KeyOfReason(const std::string& reason, bool with_places) {
  std::string key;
  for (std::size_t i = 0; i < reason.size();) {
    // "decoder.so+0x1a2b", "decoder.c:33"
    const bool is_place = with_places && i > 0 && (reason[i - 1] == '+' || reason[i - 1] == ':');
    const bool begins = IsDigit(reason[i]) && !is_place && (i == 0 || !IsWord(reason[i - 1]));
    if (!begins) {
      key += reason[i++];
      continue;
    }
    key += '#';
    if (reason[i] == '0' && i + 1 < reason.size() && reason[i + 1] == 'x')
      for (i += 2; i < reason.size() && IsHexDigit(reason[i]);) ++i;
    else
      while (i < reason.size() &&
             (IsDigit(reason[i]) || (reason[i] == '.' && i + 1 < reason.size() && IsDigit(reason[i + 1]))))
        ++i;
  }
  return key;
}

std::optional<BrokenFlight> BrokenBy(const FlightResult& result) {
  const auto broken = [&](std::string_view kind, const std::string& reason, const std::string& key) {
    return BrokenFlight{std::string(kind), fmt::format("{}: {}", kind, key), reason, {}};
  };
  const std::string& reason = result.score.reason;
  if (result.score.verdict == Verdict::kError) return std::nullopt;
  if (result.outcome == Outcome::kCrashed && BrokeBy(result, FirmwareEndKind::kInCallBack))
    return DamagedMemory(result);
  if (result.outcome == Outcome::kCrashed) {
    BrokenFlight crash = broken("crash", reason, KeyOfCrash(result, reason));
    if (BrokeBy(result, FirmwareEndKind::kInThread))
      crash.may_pass =
          "When a thread crashes depends on the machine: this flight may be over before, and pass, while the "
          "defect is there.";
    return crash;
  }
  // Without an end its process went with it.
  if (result.end_reason == EndReason::kFirmwareHung ||
      (!result.end_reason && result.outcome == Outcome::kHung))
    // The machine's time ends an image that costs too much of it: at another place in each flight.
    return broken(
        "hang", reason,
        BrokeBy(result, FirmwareEndKind::kTooCostly) ? "too much processor time" : KeyOfReason(reason));
  if (result.score.restarts > 0)
    return broken("restart", reason, KeyOfReason(TextOfEvent(result, kResetEvent)));
  if (result.end_reason != EndReason::kCompleted) return std::nullopt;
  for (const FuzzOracle& oracle : kFuzzOracles) {
    const auto criterion =
        std::find_if(result.score.criteria.begin(), result.score.criteria.end(),
                     [&](const CriterionResult& one) { return one.name == oracle.criterion; });
    if (criterion == result.score.criteria.end() || criterion->verdict != Verdict::kFail) continue;
    const std::string text = fmt::format("{}: {}", criterion->name, criterion->explanation);
    if (oracle.criterion != kMessages.criterion) return broken(oracle.kind, text, "");
    // A check that is missing lets wrong values into each field, so that the field does not matter.
    return broken(oracle.kind, text,
                  EventOf(result, kCommandRefusedEvent) == nullptr ? "" : "a refused command");
  }
  if (const std::string end = TextOfEvent(result, kEndFailedEvent); !end.empty()) {
    BrokenFlight crash = broken("crash", fmt::format("after the flight: {}", end), KeyOfCrash(result, end));
    crash.may_pass = "Every other command says this as a warning, and its flight counts as it was.";
    return crash;
  }
  return std::nullopt;
}

std::optional<BrokenFlight> BrokenOutsideCalls(const FlightResult& result, const link::Protocol& protocol) {
  const FlightEvent* const ended = EventOf(result, kEndedBySignalEvent);
  if (ended != nullptr && ended->time_s >= ToSeconds(HostileFrom(protocol))) return EndedBySignal(*ended);
  const FlightEvent* const failed = EventOf(result, kFailedOutsideCallsEvent);
  if (failed == nullptr || failed->time_s < ToSeconds(HostileFrom(protocol))) return std::nullopt;
  return DamagedMemory(result);
}

}  // namespace tiltproof::harness
