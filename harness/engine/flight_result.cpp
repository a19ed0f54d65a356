#include "harness/engine/flight_result.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "harness/client/client.h"
#include "harness/run/archive.h"

namespace tiltproof::harness {

namespace {

constexpr std::size_t kLastLinesMax = 12;

// The last lines of a log, without their times.
void AddLastLines(std::string_view log, std::vector<std::string>& lines) {
  std::vector<std::string> last;
  while (!log.empty() && last.size() < kLastLinesMax) {
    if (log.back() == '\n') log.remove_suffix(1);
    const std::size_t begin = log.rfind('\n') + 1;  // npos + 1 is 0
    const std::string_view line = log.substr(begin);
    last.emplace_back(line.substr(std::min(line.find(' ') + 1, line.size())));
    log.remove_suffix(line.size());
  }
  lines.insert(lines.end(), last.rbegin(), last.rend());
}

}  // namespace

FlightResult MakeErrorResult(const std::string& name, const Scenario& scenario, const std::string& reason,
                             const std::string& replay) {
  FlightResult result;
  result.name = name;
  result.expected = scenario.expected();
  result.seed = scenario.seed;
  result.replay = replay;
  result.outcome = Outcome::kError;
  result.score.verdict = Verdict::kError;
  result.score.cause = VerdictCause::kHarness;
  result.score.reason = reason;
  return result;
}

FlightResult MakeResult(const std::string& name, const Scenario& scenario, const RunLog& log,
                        const std::string& replay) {
  FlightResult result = MakeErrorResult(name, scenario, "", replay);
  result.trace_hash = TraceHash(log.trace);
  result.wall_s = log.wall_s;
  result.real_time_factor = log.wall_s > 0 ? ToSeconds(log.end_ns) / log.wall_s : 0.0;
  result.score = ScoreRun(scenario, log);
  result.end_reason = log.end_reason;
  result.outcome = OutcomeOf(log, result.score);
  result.firmware_end = log.firmware_end;
  result.events = EventsOf(log);
  for (const ClientLog& client : log.clients) {
    if (log.end_reason == EndReason::kFirmwareLost) AddLastLines(client.firmware_log, result.last_lines);
    for (const StackUse& stack : client.stacks.value_or(std::vector<StackUse>()))
      result.stacks.push_back({client.id.empty() ? std::nullopt : std::optional(client.id), stack.name,
                               stack.size_bytes, stack.used_bytes_max, stack.overflowed});
    if (!client.unmodelled_blocks) continue;
    auto& blocks = result.unmodelled_blocks;
    for (const std::string& block : *client.unmodelled_blocks)
      if (std::ranges::find(blocks, block) == blocks.end()) blocks.push_back(block);
  }
  return result;
}

std::vector<FlightEvent> EventsOf(const RunLog& log) {
  std::vector<FlightEvent> events;
  for (const RunEvent& event : log.events) {
    FlightEvent& out = events.emplace_back();
    out = {ToSeconds(event.time_ns), event.kind, std::nullopt, event.text};
    // The only client has no id.
    if (event.client && !log.clients.at(*event.client).id.empty())
      out.client = log.clients.at(*event.client).id;
  }
  return events;
}

std::vector<std::string> OtherCauses(const FlightResult& result) {
  std::vector<std::string> causes;
  for (const FlightEvent& event : result.events)
    if (event.kind == kSlowAdapterEvent)
      causes.push_back(event.text);
    else if (event.kind == kStackOverflowEvent)
      causes.push_back(fmt::format("{}, at {:.3f} s", event.text, event.time_s));
  for (const FlightStack& stack : result.stacks)
    if (!stack.overflowed && stack.used_bytes_max == stack.size_bytes)
      causes.push_back(
          fmt::format("stack '{}' is full: all of its {} bytes were used, so it may have overflowed",
                      stack.name, stack.size_bytes));
  if (!result.unmodelled_blocks.empty())
    causes.push_back(fmt::format(
        "the firmware uses {}, which the emulated board does not model: on a chip it may do something else "
        "(where: firmware.log)",
        fmt::join(result.unmodelled_blocks, ", ")));
  return causes;
}

std::vector<std::uint8_t> Pack(const FlightResult& result) {
  Packer packer;
  packer(result);
  return {packer.bytes().begin(), packer.bytes().end()};
}

FlightResult UnpackFlightResult(std::span<const std::uint8_t> bytes) {
  return Unpacker(bytes).Next<FlightResult>();
}

}  // namespace tiltproof::harness
