#include "harness/score/clean_line.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "faults/activity.h"
#include "faults/registry.h"
#include "harness/run/supervisor_states.h"
#include "harness/score/client_behaviour.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// The time after a fault for which mistakes on the line count as its effects.
constexpr TimeNs kAftermath = 2 * kNsPerS;
// In real time so many of the periods may be unclean: no line and no machine are perfect.
constexpr double kRealTimeShare = 0.03;

bool IsRealTime(const RunLog& log) { return log.harness_overrun_count.has_value(); }

// A firmware may be out of step by these, but not by faults on the vehicle or its actuators.
bool ExcusesTheLine(const faults::FaultType& type) {
  return type.layer() != "harness" && !type.IsOneOf<faults::ActuatorKind, faults::PlantKind>();
}

// When mistakes on one client's line are not its own.
class Excuses {
 public:
  Excuses(const Scenario& scenario, const RunLog& log, std::size_t client)
      : log_(log), period_ns_(scenario.link.protocol->control_period_ns) {
    for (const faults::FaultSpec& spec : FaultsOn(scenario, client)) {
      const faults::FaultType* type = faults::FindFaultType(spec.type);
      if (type != nullptr && ExcusesTheLine(*type)) AddFault(spec, *type);
    }
    if (const std::optional<ClientLoss>& loss = log.clients[client].loss)
      windows_.push_back({loss->time_ns - period_ns_, kNever});
    if (const auto roles = log.trace.Find(RoleColumn(scenario, client)))
      for (std::size_t row = 0; row < log.trace.row_count(); ++row)
        roles_.emplace_back(FromSeconds(log.trace.at(row, 0)), log.trace.at(row, *roles));
    const auto& requests_ns = log.clients[client].sent_request_times_ns;
    for (const Restart& restart : log.clients[client].restarts) {
      const auto first = std::upper_bound(requests_ns.begin(), requests_ns.end(), restart.time_ns);
      const TimeNs limit_ns = restart.time_ns + scenario.start_within_ns;
      windows_.push_back(
          {restart.time_ns, first == requests_ns.end() ? limit_ns : std::min(*first, limit_ns)});
    }
  }

  bool ByFault(TimeNs time_ns) const { return ByFaultWithin(time_ns, time_ns); }
  // An answer is due within a period, in which a fault may begin.
  bool ByFault(LineMistakeKind kind, TimeNs time_ns) const {
    if (kind != LineMistakeKind::kUnanswered) return ByFaultWithin(time_ns, time_ns);
    return IsStandby(time_ns) || ByFaultWithin(time_ns, time_ns + period_ns_);
  }
  // In real time: whether this machine took time from the board or from the harness.
  bool ByMachine(TimeNs time_ns) const {
    const auto touches = [&](const LateSpan& span) {
      return span.begin_ns <= time_ns + period_ns_ && time_ns <= span.end_ns + period_ns_;
    };
    return std::ranges::any_of(log_.board_disturbed, touches) ||
           std::ranges::any_of(log_.harness_late, touches);
  }

 private:
  // Among several clients, one that stands by need not command.
  bool IsStandby(TimeNs time_ns) const {
    const auto after = std::ranges::upper_bound(roles_, time_ns, {}, &std::pair<TimeNs, double>::first);
    return after != roles_.begin() && std::prev(after)->second == 0;
  }
  bool ByFaultWithin(TimeNs begin_ns, TimeNs end_ns) const {
    return std::ranges::any_of(windows_,
                               [&](const faults::Window& window) {
                                 return window.begin_ns <= end_ns && begin_ns <= window.end_ns;
                               }) ||
           std::ranges::any_of(activities_, [&](const faults::Activity& activity) {
             return activity.Touches(begin_ns - kAftermath, end_ns + 1);
           });
  }
  void AddFault(const faults::FaultSpec& spec, const faults::FaultType& type) {
    const faults::Window window = faults::WindowOf(spec);
    if (type.end == faults::Bound::kRefused) {
      const TimeNs end_ns = window.end_ns == kNever ? window.begin_ns : window.end_ns;
      windows_.push_back({window.begin_ns, end_ns + kAftermath});
    } else if (faults::WaitsForEvent(spec)) {
      windows_.push_back({window.begin_ns, window.end_ns == kNever ? kNever : window.end_ns + kAftermath});
    } else {
      activities_.emplace_back(spec, window);
    }
  }

  const RunLog& log_;
  TimeNs period_ns_;
  std::vector<faults::Window> windows_;
  std::vector<faults::Activity> activities_;
  std::vector<std::pair<TimeNs, double>> roles_;  // told, by time
};

struct Kind {
  std::int64_t count = 0;
  TimeNs first_ns = 0;
  std::string text;
};
constexpr std::size_t kKindCount = static_cast<std::size_t>(LastOf(LineMistakeKind())) + 1;

struct Findings {
  std::array<Kind, kKindCount> kinds;  // by LineMistakeKind
  std::int64_t periods = 0;            // that were judged
  std::int64_t disturbed_count = 0;    // periods left out because of this machine
  const Kind& Of(LineMistakeKind kind) const { return kinds[static_cast<std::size_t>(kind)]; }
};

Findings FindMistakes(const Scenario& scenario, const RunLog& log, std::size_t client) {
  CheckIndex(client, log.clients.size(), "a client that is judged has a log");
  Check(log.clients[client].line_mistakes.has_value(),
        "the mistakes of a client that is judged were counted");
  const std::vector<LineMistake>& mistakes = *log.clients[client].line_mistakes;
  Findings findings;
  if (mistakes.empty()) return findings;
  const Excuses excuses(scenario, log, client);
  const TimeNs period_ns = scenario.link.protocol->control_period_ns;
  const TimeNs end_ns = std::min(log.end_ns, scenario.duration_ns);
  // A request that is due within half a period of the end may come after it.
  for (TimeNs time_ns = period_ns; time_ns + period_ns / 2 <= end_ns; time_ns += period_ns) {
    if (excuses.ByFault(time_ns)) continue;
    ++(excuses.ByMachine(time_ns) ? findings.disturbed_count : findings.periods);
  }
  TimeNs missing_until_ns = -1;
  for (const LineMistake& mistake : mistakes) {
    if (mistake.time_ns < 0) continue;
    CheckIndex(static_cast<std::size_t>(mistake.kind), findings.kinds.size(), "a mistake has a known kind");
    Kind& kind = findings.kinds[static_cast<std::size_t>(mistake.kind)];
    TimeNs time_ns = mistake.time_ns;
    std::int64_t count = mistake.count;
    if (mistake.kind == LineMistakeKind::kMissing) {
      // A file of others may name a period twice, and many times as many as there are.
      if (time_ns <= missing_until_ns) {
        const std::int64_t known = (missing_until_ns - time_ns) / period_ns + 1;
        time_ns += known * period_ns;
        count -= known;
      }
    } else {
      count = 1;
    }
    for (std::int64_t i = 0; i < count && time_ns <= end_ns; ++i, time_ns += period_ns) {
      if (mistake.kind == LineMistakeKind::kMissing) missing_until_ns = time_ns;
      if (excuses.ByFault(mistake.kind, time_ns) || excuses.ByMachine(time_ns)) continue;
      if (kind.count++ == 0) {
        kind.first_ns = time_ns;
        kind.text = mistake.text;
      }
    }
  }
  return findings;
}

// All kinds that were seen.
std::string Described(const Scenario& scenario, const Findings& findings, const RunLog& log,
                      std::size_t client) {
  std::vector<std::string> parts;
  const std::string_view message = scenario.link.protocol->streams() ? "command" : "request";
  const auto first = [](const Kind& kind) {
    return fmt::format("the first at {:.3f} s", ToSeconds(kind.first_ns));
  };
  if (const Kind& kind = findings.Of(LineMistakeKind::kMalformed); kind.count > 0)
    parts.push_back(fmt::format("{} malformed frame{}, {} ({})", kind.count, kind.count == 1 ? "" : "s",
                                first(kind), kind.text));
  if (const Kind& kind = findings.Of(LineMistakeKind::kMissing); kind.count > 0)
    parts.push_back(
        fmt::format("{} of {} periods without a {}, {}", kind.count, findings.periods, message, first(kind)));
  if (const Kind& kind = findings.Of(LineMistakeKind::kDoubled); kind.count > 0)
    parts.push_back(fmt::format("{} {}{} less than half a period after the one before, {}", kind.count,
                                message, kind.count == 1 ? "" : "s", first(kind)));
  if (const Kind& kind = findings.Of(LineMistakeKind::kUnanswered); kind.count > 0) {
    const auto& commands_ns = log.clients[client].actuator_times_ns;
    if (!commands_ns.empty() && commands_ns.back() < kind.first_ns && kind.count > 1)
      parts.push_back(fmt::format("answered none of {} good replies since {:.2f} s", kind.count,
                                  ToSeconds(kind.first_ns)));
    else
      // A reply to a request at t = 0 makes one more.
      parts.push_back(fmt::format("{} of {} periods without an actuator message, {}", kind.count,
                                  std::max(findings.periods, kind.count), first(kind)));
  }
  return fmt::format("{}", fmt::join(parts, "; "));
}

CriterionResult Judge(const Scenario& scenario, const RunLog& log, std::size_t client) {
  CriterionResult result;
  result.name = kCleanLineCriterion;
  result.verdict = Verdict::kPass;
  const Findings findings = FindMistakes(scenario, log, client);
  std::int64_t allowed = scenario.clean_line_periods_count;
  if (IsRealTime(log))
    allowed =
        std::max(allowed, static_cast<std::int64_t>(kRealTimeShare * static_cast<double>(findings.periods)));
  for (std::size_t kind = 0; kind < kKindCount; ++kind) {
    const Kind& found = findings.kinds[kind];
    const bool one_is_too_many =
        kind == static_cast<std::size_t>(LineMistakeKind::kMalformed) && allowed <= 1;
    if (found.count > (one_is_too_many ? 0 : allowed)) result.verdict = Verdict::kFail;
    if (found.count > 0)
      result.time_s = std::min(result.time_s.value_or(ToSeconds(log.end_ns)), ToSeconds(found.first_ns));
  }
  const std::string what = Described(scenario, findings, log, client);
  result.explanation =
      Whose(scenario, client) + (what.empty() ? "nothing missing, doubled or malformed" : what);
  if (result.verdict == Verdict::kPass) {
    result.time_s.reset();
  } else if (findings.periods < findings.disturbed_count) {
    result.verdict = Verdict::kInconclusive;
    result.explanation += fmt::format(
        "; but in {} of {} periods this machine took time from the flight: it was too busy to judge a "
        "firmware",
        findings.disturbed_count, findings.disturbed_count + findings.periods);
  } else if (IsRealTime(log) && findings.Of(LineMistakeKind::kMalformed).count > 0) {
    result.explanation += "; on a serial port the cable may be the cause";
  }
  return result;
}

}  // namespace

std::optional<CriterionResult> CleanLine(const Scenario& scenario, const RunLog& log) {
  if (log.end_reason == EndReason::kNeverStarted || log.end_reason == EndReason::kInterrupted ||
      IsOurs(log.end_reason) ||
      std::ranges::none_of(log.clients, [](const ClientLog& own) { return own.line_mistakes.has_value(); }))
    return std::nullopt;
  if (std::ranges::all_of(log.clients, [](const ClientLog& own) { return own.actuator_times_ns.empty(); })) {
    CriterionResult result;
    result.name = kCleanLineCriterion;
    result.verdict = Verdict::kFail;
    result.time_s = 0;
    result.explanation = "no actuator message was accepted in the whole flight";
    for (std::size_t client = 0; client < log.clients.size(); ++client)
      if (log.clients[client].line_mistakes)
        if (const std::string what = Described(scenario, FindMistakes(scenario, log, client), log, client);
            !what.empty())
          result.explanation += "; " + Whose(scenario, client) + what;
    return result;
  }
  std::optional<CriterionResult> found;
  for (std::size_t client = 0; client < log.clients.size(); ++client) {
    if (!log.clients[client].line_mistakes) continue;
    CriterionResult result = Judge(scenario, log, client);
    if (!found || result.verdict > found->verdict) found = std::move(result);
  }
  return found;
}

}  // namespace tiltproof::harness
