#include "harness/score/score.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>

#include "faults/registry.h"
#include "harness/run/late_periods.h"
#include "harness/score/clean_line.h"
#include "harness/score/client_behaviour.h"
#include "harness/score/headline.h"
#include "harness/score/signals.h"
#include "harness/score/stl.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string Counted(std::size_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

// To the millisecond: rows lie on a grid of 12 ms.
std::string AtTime(double time_s) {
  char text[32];
  std::snprintf(text, sizeof text, " at %.3f s", time_s);
  return text;
}

// A formula may be written over several lines of YAML.
std::string OneLine(const std::string& text) {
  std::string line;
  for (const char c : text) {
    const bool space = c == ' ' || c == '\n' || c == '\t' || c == '\r';
    if (!space)
      line += c;
    else if (!line.empty() && line.back() != ' ')
      line += ' ';
  }
  if (line.ends_with(' ')) line.pop_back();
  return line;
}

std::vector<std::string> FaultIds(const Scenario& scenario) {
  std::vector<std::string> ids;
  for (const auto& fault : scenario.faults) ids.push_back(fault.id);
  return ids;
}

// Judges the end of the flight.
CriterionResult Ending(const RunLog& log) {
  CriterionResult result;
  result.name = kSurvivalCriterion;
  result.time_s = ToSeconds(log.end_ns);
  std::string what;
  switch (log.end_reason) {
    case EndReason::kCompleted:
      result.verdict = Verdict::kPass;
      result.explanation = "flew to the end" + AtTime(*result.time_s);
      return result;
    case EndReason::kDiverged:
      what = "diverged";
      break;
    case EndReason::kGroundStrike:
      what = "ground strike";
      break;
    case EndReason::kNeverStarted:
      what = "never started";
      break;
    case EndReason::kFirmwareHung:
      what = "firmware hung";
      break;
    case EndReason::kFirmwareCrashed:
      what = "firmware crashed";
      break;
    case EndReason::kNodeLost:
      what = "a node of the harness was lost";
      break;
    case EndReason::kFirmwareLost:
      what = "firmware lost";
      break;
    case EndReason::kInterrupted:
      what = "interrupted";
      break;
    case EndReason::kLineOverfull:
      what = "a line was overfull";
      break;
    case EndReason::kHarnessError:
      what = "harness error";
      break;
  }
  result.verdict = log.end_reason == EndReason::kInterrupted ? Verdict::kInconclusive
                   : IsOurs(log.end_reason)                  ? Verdict::kError
                                                             : Verdict::kFail;
  result.explanation =
      what + AtTime(*result.time_s) + (log.end_text.empty() ? "" : ": " + OneLine(log.end_text));
  return result;
}

// Text on the clients that the flight lost before its end: ", without client a (crashed at 3.204 s: ...)".
std::string Losses(const Scenario& scenario, const RunLog& log) {
  std::string text;
  for (std::size_t client = 0; client < log.clients.size(); ++client)
    if (const std::optional<ClientLoss>& loss = log.clients[client].loss;
        loss && (log.end_reason == EndReason::kCompleted || loss->time_ns < log.end_ns))
      text += (text.empty() ? ", without client " : " and client ") + scenario.client_id(client) + " (" +
              (loss->hung ? "hung" : "crashed") + AtTime(ToSeconds(loss->time_ns)) + ": " +
              OneLine(loss->text) + ")";
  return text;
}

// The first of all clients' restarts that no fault asked for. The first one by itself has precedence: one that does not
// follow lateness of this machine directly.
struct UnaskedRestart {
  std::size_t client = 0;
  Restart restart;
  bool by_itself = false;
};
std::optional<UnaskedRestart> FindUnaskedRestart(const Scenario& scenario, const RunLog& log) {
  std::optional<UnaskedRestart> found;
  for (std::size_t client = 0; client < log.clients.size(); ++client)
    for (const Restart& restart : UnaskedRestarts(FaultsOn(scenario, client), log.clients[client].restarts)) {
      const bool by_itself = !FollowsLateness(restart, log.harness_late);
      if (!found || (by_itself && !found->by_itself)) found = {client, restart, by_itself};
    }
  return found;
}

CriterionResult Survival(const Scenario& scenario, const RunLog& log) {
  CriterionResult result = Ending(log);
  result.explanation += Losses(scenario, log);
  if (scenario.allow_restarts || result.verdict == Verdict::kError) return result;
  const auto unasked = FindUnaskedRestart(scenario, log);
  if (!unasked) return result;
  const auto& [client, restart, by_itself] = *unasked;
  const std::string later = log.end_reason == EndReason::kCompleted ? "" : "; then " + result.explanation;
  if (by_itself || !WentAway(log.end_reason)) {
    result.verdict = by_itself ? Verdict::kFail : Verdict::kInconclusive;
    result.time_s = ToSeconds(restart.time_ns);
  }
  result.explanation =
      Whose(scenario, client) + "restarted" + AtTime(ToSeconds(restart.time_ns)) + " (" +
      OneLine(restart.cause) + ")" +
      (by_itself ? ", which no fault asked for; "
                 : " directly after the harness itself was late: this machine was too busy to "
                   "judge a firmware; ") +
      Counted(log.clients[client].restarts.size(), "restart") + " in all" + later;
  return result;
}

// The likely cause of a wrong control period, from the sorted intervals. A clock that is wrong makes all of them wrong
// alike; messages that are missing or doubled make some of them long or short.
std::string_view LikelyCause(const std::vector<TimeNs>& sorted_ns, bool streams) {
  constexpr double kAlike = 0.1;
  const auto at = [&](double share) {
    return static_cast<double>(
        sorted_ns[static_cast<std::size_t>(share * static_cast<double>(sorted_ns.size() - 1))]);
  };
  if (at(0.9) - at(0.1) > kAlike * at(0.5))
    return streams ? ": commands are missing or doubled" : ": requests are missing or doubled";
  return streams ? ": is the core clock right, and is there one command in each period?"
                 : ": is the core clock right?";
}

// Judges each client; the result is that of the first wrong one, or of the first that can be judged. None when there
// is too little to judge by.
std::optional<CriterionResult> ControlPeriod(const Scenario& scenario, const RunLog& log) {
  std::optional<CriterionResult> found;
  for (std::size_t client = 0; client < log.clients.size(); ++client) {
    const auto [intervals, disturbed_count] = UndisturbedIntervals(
        FaultsOn(scenario, client), log.board_disturbed, log.clients[client].sent_request_times_ns);
    const std::size_t count = intervals.size() + disturbed_count;
    if (count < kIntervalsMin) continue;
    if (intervals.size() < kIntervalsMin && intervals.size() <= disturbed_count) {
      if (found) continue;
      found.emplace();
      found->name = kControlPeriodCriterion;
      found->verdict = Verdict::kInconclusive;
      found->explanation =
          Whose(scenario, client) + "in " + std::to_string(disturbed_count) + " of " + std::to_string(count) +
          " intervals this machine took time from the board: it was too busy to judge a firmware";
      continue;
    }
    const double period_ms = static_cast<double>(scenario.link.protocol->control_period_ns) / 1e6;
    const double median_ms = static_cast<double>(intervals[(intervals.size() - 1) / 2]) / 1e6;
    const double deviation_percent = std::abs(median_ms - period_ms) / period_ms * 100;
    const bool right = deviation_percent <= scenario.control_period_tolerance_percent;
    char text[96];
    std::snprintf(text, sizeof text, "%s every %.3f ms, the protocol requires %.6g ms",
                  scenario.link.protocol->streams() ? "commands" : "asks", median_ms, period_ms);
    CriterionResult result;
    result.name = kControlPeriodCriterion;
    result.verdict = right ? Verdict::kPass : Verdict::kFail;
    result.explanation = Whose(scenario, client) + text;
    if (!right) result.explanation += LikelyCause(intervals, scenario.link.protocol->streams());
    if (!found || found->verdict != Verdict::kPass || !right) found = std::move(result);
    if (!right) break;
  }
  return found;
}

Verdict FromTruth(stl::Truth truth) {
  switch (truth) {
    case stl::Truth::kFalse:
      return Verdict::kFail;
    case stl::Truth::kUnknown:
      return Verdict::kInconclusive;
    case stl::Truth::kTrue:
      return Verdict::kPass;
  }
  return Verdict::kError;
}

void JudgeFormula(const CriterionSpec& spec, const Scenario& scenario, const RunLog& log,
                  const ScoreOptions& options, std::optional<TimeNs> onset_ns, CriterionResult& result) {
  const std::vector<std::string> signals = SignalNames(log.trace.columns()), fault_ids = FaultIds(scenario);
  const stl::Formula formula = stl::Parse(spec.stl, {.signals = signals, .fault_ids = fault_ids});
  const stl::Extent extent{log.end_ns, scenario.duration_ns};
  const stl::Result answer = stl::Evaluate(formula, log.trace, extent);
  if (options.over_time) result.over_time = stl::EvaluateOverTime(formula, log.trace, extent);
  result.verdict = FromTruth(answer.truth);
  result.robustness = answer.robustness;
  if (answer.robustness && std::isfinite(*answer.robustness)) result.margin = answer.robustness;
  if (answer.time_ns) result.time_s = ToSeconds(*answer.time_ns);
  result.fault_can_affect = FaultCanAffect(formula, answer.time_ns, onset_ns);
  std::string& text = result.explanation = OneLine(spec.stl) + ": ";
  if (answer.truth == stl::Truth::kUnknown) {
    text += log.end_ns < scenario.duration_ns
                ? "undecided, the flight ended" + AtTime(ToSeconds(log.end_ns)) + " of " +
                      Number(ToSeconds(scenario.duration_ns)) + " s"
                : "undecided, a window reaches past the end" + AtTime(ToSeconds(log.end_ns));
    if (!answer.evidence.empty()) text += "; so far ";
  } else if (answer.evidence.empty()) {
    text += answer.truth == stl::Truth::kTrue ? "holds" : "does not hold";
  }
  text += answer.evidence;
  if (result.time_s) text += AtTime(*result.time_s);
}

std::string Bounds(const CriterionSpec& spec) {
  std::string text;
  if (spec.min) text += ", min " + Number(*spec.min);
  if (spec.max) text += ", max " + Number(*spec.max);
  return text;
}

// The least margin of a metric's value, or of what is known of it, to the bounds; relative to each bound.
std::optional<double> MetricMargin(std::optional<double> min, std::optional<double> max, double value) {
  if (min && max && *min == *max && value == *min) return std::nullopt;
  std::optional<double> least;
  const auto consider = [&](double distance, double bound) {
    const double margin = distance / std::abs(bound);
    if (std::isfinite(margin) && (!least || margin < *least)) least = margin;
  };
  if (min) consider(value - *min, *min);
  if (max) consider(*max - value, *max);
  return least;
}

// The verdict on what the metric may have been without this machine's lateness.
Verdict Undisturbed(const CriterionSpec& spec, const UndisturbedRange& range) {
  if ((spec.min && range.high < *spec.min) || (spec.max && range.low > *spec.max)) return Verdict::kFail;
  const bool holds = (!spec.min || range.low >= *spec.min) && (!spec.max || range.low <= *spec.max);
  return holds ? Verdict::kPass : Verdict::kInconclusive;
}

// When what a failed criterion counts was seen, as " (the first at 0.036 s: ...)". Empty when that is not known.
std::string Witness(const std::string& metric, const Scenario& scenario, const RunLog& log) {
  const auto first = [&](std::size_t client, const auto&... kinds) -> std::string {
    for (const RunEvent& event : log.events)
      if (event.client.value_or(0) == client && ((event.kind == kinds) || ...))
        return " (the first" + AtTime(ToSeconds(event.time_ns)) + ": " + OneLine(event.text) + ")";
    return "";
  };
  const auto first_of = [](const std::optional<CountedMistake>& mistake) -> std::string {
    return mistake && mistake->count > 0 ? " (the first: " + OneLine(mistake->text) + ")" : "";
  };
  const auto last = [](std::string_view verb, const std::vector<TimeNs>& times_ns) {
    return times_ns.empty() ? "never " + std::string(verb)
                            : "last " + std::string(verb) + AtTime(ToSeconds(times_ns.back()));
  };
  for (std::size_t client = 0; client < log.clients.size(); ++client) {
    const auto is = [&](std::string_view group, std::string_view name) {
      return metric == ClientName(scenario, group, client, '.', name);
    };
    const ClientLog& own = log.clients[client];
    if (is("timing.", "silent_at_end_ms"))
      return " (it " + last("asked", own.sent_request_times_ns) + ", " +
             last("commanded", own.actuator_times_ns) + ")";
    if (is("protocol.", "malformed_sent_count"))
      return first(client, kMalformedSentEvent, kCommandRefusedEvent);
    if (is("protocol.", "refused_commands_count")) return first(client, kCommandRefusedEvent);
    if (own.protocol && is("protocol.", "replies_ignored_count"))
      return first_of(own.protocol->replies_ignored);
    if (own.protocol && is("protocol.", "commands_without_reply_count"))
      return first_of(own.protocol->commands_without_reply);
    if (is("firmware.", "restarts_count")) return first(client, kStartRepeatedEvent);
  }
  return "";
}

void JudgeMetric(const CriterionSpec& spec, const Scenario& scenario, const Metrics& metrics,
                 const RunLog& log, CriterionResult& result) {
  const auto names = MetricNamesOf(scenario, MetricNames());
  if (std::find(names.begin(), names.end(), spec.metric) == names.end())
    throw std::invalid_argument("unknown metric '" + spec.metric + "'");
  const auto found = metrics.values.find(spec.metric);
  if (found == metrics.values.end()) {
    if (spec.metric == "tracking.settling_s" && metrics.settling_at_least_s) {
      const double at_least_s = *metrics.settling_at_least_s;
      result.explanation = "tracking.settling_s > " + Number(at_least_s) +
                           " (not settled when the flight ended)" + Bounds(spec);
      if (spec.max && at_least_s >= *spec.max) {
        result.verdict = Verdict::kFail;
        result.robustness = *spec.max - at_least_s;
        result.margin = MetricMargin(std::nullopt, spec.max, at_least_s);
      }
      return;
    }
    result.explanation = spec.metric + " is not available in this flight" + Bounds(spec);
    return;
  }
  const double value = found->second;
  const double robustness = std::min(spec.min ? value - *spec.min : std::numeric_limits<double>::infinity(),
                                     spec.max ? *spec.max - value : std::numeric_limits<double>::infinity());
  result.explanation = spec.metric + " = " + Number(value) + Bounds(spec);
  result.robustness = robustness;
  result.margin = MetricMargin(spec.min, spec.max, value);
  result.verdict = robustness >= 0.0 ? Verdict::kPass : Verdict::kFail;
  if (result.verdict == Verdict::kFail) result.explanation += Witness(spec.metric, scenario, log);
  if (const auto range = metrics.undisturbed.find(spec.metric);
      range != metrics.undisturbed.end() && Undisturbed(spec, range->second) != result.verdict) {
    result.verdict = Verdict::kInconclusive;
    result.explanation +=
        ": so only with the periods in which this machine was late; it was too busy to judge a firmware";
  }
  // The outcome of a flight that was cut short from outside is unknown.
  if (log.end_reason == EndReason::kInterrupted || IsOurs(log.end_reason)) {
    result.verdict = Verdict::kInconclusive;
    result.explanation += ": the flight was cut short";
  }
}

// Text on a flight that should not have passed.
std::string Expectation(Verdict expected) {
  return expected == Verdict::kFail           ? "the flight was expected to fail"
         : expected == Verdict::kInconclusive ? "the flight was expected to be inconclusive"
                                              : "the flight was expected to end in an error";
}

// Text on a message that a client may refuse, sent before a failure: it may be the cause. Empty: there is none.
std::string BeyondRange(const RunLog& log, double failed_s) {
  const auto sent = std::ranges::find(log.events, kBeyondRangeSentEvent, &RunEvent::kind);
  if (sent == log.events.end() || ToSeconds(sent->time_ns) > failed_s) return "";
  return "; before," + AtTime(ToSeconds(sent->time_ns)) + ", " + sent->text +
         ": a client may refuse it; widen the field's `min` and `max` if the vehicle may go there";
}

// The verdict, and of all criteria that gave it the one that did so first.
void Conclude(Score& score, const RunLog& log, Verdict expected) {
  score.verdict = Verdict::kPass;
  for (const auto& criterion : score.criteria) score.verdict = std::max(score.verdict, criterion.verdict);
  for (const auto& fault : score.faults)
    if (fault.activations == 0) score.verdict = std::max(score.verdict, Verdict::kInconclusive);
  if (score.verdict == Verdict::kPass) {
    if (expected != Verdict::kPass) score.reason = "every criterion holds, but " + Expectation(expected);
    return;
  }
  const CriterionResult* first = nullptr;
  for (const auto& criterion : score.criteria) {
    if (criterion.verdict != score.verdict) continue;
    constexpr double kLast_s = std::numeric_limits<double>::infinity();
    if (first == nullptr || criterion.time_s.value_or(kLast_s) < first->time_s.value_or(kLast_s))
      first = &criterion;
  }
  if (first != nullptr) {
    score.cause = score.verdict == Verdict::kError ? VerdictCause::kHarness : VerdictCause::kCriterion;
    score.reason = first->name + ": " + first->explanation;
    if (score.verdict == Verdict::kFail)
      score.reason += BeyondRange(log, first->time_s.value_or(ToSeconds(log.end_ns)));
    return;
  }
  for (const auto& fault : score.faults)
    if (fault.activations == 0) {
      score.cause = VerdictCause::kNeverActivated;
      score.reason = NeverActivated(fault, score);
      return;
    }
}

// The harness's lateness, when it is too much to judge a firmware: "in 20 of 500 periods (at most 12 ms)".
std::string TooLate(std::int64_t overruns, TimeNs late_ns, TimeNs end_ns, TimeNs period_ns) {
  if (overruns == 0) return "";
  const std::int64_t periods = std::max<std::int64_t>(end_ns / period_ns, 1);
  const bool often = overruns > kOverrunCountMax &&
                     static_cast<double>(overruns) > kOverrunRatioMax * static_cast<double>(periods);
  if (!often && late_ns <= kLatePeriodsMax * period_ns) return "";
  return "in " + std::to_string(overruns) + " of " + std::to_string(periods) + " periods (at most " +
         Number(static_cast<double>(late_ns) / 1e6) + " ms)";
}

// The same before a start that never came: a firmware could start in the rest of the time, if that is most of it.
std::string TooLateToStart(const Scenario& scenario, const RunLog& log) {
  const TimeNs wait_ns = scenario.start_wait_ns(), period_ns = scenario.link.protocol->control_period_ns;
  std::vector<LateSpan> spans = log.harness_late;
  for (LateSpan& span : spans) span = {span.begin_ns + wait_ns, span.end_ns + wait_ns};
  const LatePeriods late = CountLatePeriods(spans, wait_ns, period_ns);
  const std::int64_t periods = std::max<std::int64_t>(wait_ns / period_ns, 1);
  if (2 * late.count <= periods) return "";
  return "in " + std::to_string(late.count) + " of the " + std::to_string(periods) +
         " periods in which it may start";
}

// Reason that a flight in real time says nothing about the firmware; empty when it does.
std::string TooLateToJudge(const Scenario& scenario, const RunLog& log) {
  if (WentAway(log.end_reason)) return "";
  const std::string late =
      log.end_reason == EndReason::kNeverStarted
          ? TooLateToStart(scenario, log)
          : TooLate(log.harness_overrun_count.value_or(0), log.harness_late_max_ns.value_or(0), log.end_ns,
                    scenario.link.protocol->control_period_ns);
  return late.empty()
             ? ""
             : "the harness itself was late " + late + ": this machine was too busy to judge a firmware";
}

// Text on the firmware's own processes that made the harness too late to judge it; empty when they did not.
std::string LateByFirmware(const RunLog& log, TimeNs period_ns) {
  if (!log.firmware_use) return "";
  const LatePeriods own = CountLatePeriods(log.firmware_late, log.end_ns, period_ns);
  const std::string late = TooLate(own.count, own.longest_ns, log.end_ns, period_ns);
  if (late.empty()) return "";
  const ProcessorUse& use = *log.firmware_use;
  char text[160];
  std::snprintf(text, sizeof text, "used %.1f s of the %.1f s that %lld processors had",
                ToSeconds(use.run_ns), ToSeconds(use.elapsed_ns) * static_cast<double>(use.processors_count),
                static_cast<long long>(use.processors_count));
  return "the firmware's own processes (" + std::to_string(use.processes_max) + " at a time) " + text +
         ", and made the harness late " + late;
}

// True if all failures follow a restart that this machine may have caused: it may be their cause. A metric has no time.
bool FailsByRestart(const Score& score, const Scenario& scenario, const RunLog& log) {
  const auto unasked = FindUnaskedRestart(scenario, log);
  if (score.verdict != Verdict::kFail || !unasked || unasked->by_itself || WentAway(log.end_reason))
    return false;
  const double restarted_s = ToSeconds(unasked->restart.time_ns);
  return std::none_of(score.criteria.begin(), score.criteria.end(), [&](const CriterionResult& criterion) {
    return criterion.verdict == Verdict::kFail && (criterion.name == kControlPeriodCriterion ||
                                                   criterion.time_s.value_or(restarted_s) < restarted_s);
  });
}

CriterionResult JudgeCriterion(const CriterionSpec& spec, const Scenario& scenario, const Metrics& metrics,
                               const RunLog& log, const ScoreOptions& options) {
  CriterionResult result;
  result.name = spec.name;
  try {
    if (spec.stl.empty())
      JudgeMetric(spec, scenario, metrics, log, result);
    else
      JudgeFormula(spec, scenario, log, options, metrics.faults_onset_ns, result);
  } catch (const stl::ParseError& e) {
    result.verdict = Verdict::kError;
    result.explanation = OneLine(spec.stl) + ": column " + std::to_string(e.column) + ": " + e.what();
  } catch (const std::invalid_argument& e) {
    result.verdict = Verdict::kError;
    result.explanation = e.what();
  }
  return result;
}

// Makes the verdict inconclusive when this machine may be the cause of it.
void DoubtForLateness(Score& score, const Scenario& scenario, const RunLog& log) {
  const TimeNs period_ns = scenario.link.protocol->control_period_ns;
  if (score.verdict == Verdict::kPass || score.verdict == Verdict::kFail) {
    if (std::string why = TooLateToJudge(scenario, log); !why.empty()) {
      score.verdict = Verdict::kInconclusive;
      score.cause = VerdictCause::kTooBusy;
      score.reason = std::move(why);
    } else if (const std::string own = LateByFirmware(log, period_ns); !own.empty()) {
      if (score.verdict == Verdict::kFail) {
        score.reason += "; " + own;
      } else {
        score.verdict = Verdict::kInconclusive;
        score.cause = VerdictCause::kTooBusy;
        score.reason = own + ": a firmware cannot be judged that leaves no processor to it";
      }
    }
  }
  if (FailsByRestart(score, scenario, log)) {
    const auto restart = FindUnaskedRestart(scenario, log)->restart;
    score.verdict = Verdict::kInconclusive;
    score.cause = VerdictCause::kTooBusy;
    score.reason = "the firmware restarted" + AtTime(ToSeconds(restart.time_ns)) +
                   " directly after the harness itself was late, and failed only then (" + score.reason +
                   "): this machine was too busy to judge a firmware";
  }
}

void AddHistograms(const Scenario& scenario, const RunLog& log, Score& score) {
  const TimeNs period_ns = scenario.link.protocol->control_period_ns;
  for (std::size_t i = 0; i < log.clients.size(); ++i) {
    const auto name = [&](std::string_view histogram) { return ClientName(scenario, "", i, '.', histogram); };
    score.histograms[name("request_period_ms")] =
        RequestPeriodHistogram(PeriodTimes(scenario, log.clients[i]), period_ns);
    score.histograms[name("reply_latency_ms")] =
        ReplyLatencyHistogram(log.clients[i].reply_latency_ns, period_ns);
  }
}

}  // namespace

bool StatesComputing(const Score& score) {
  return std::any_of(score.metrics.begin(), score.metrics.end(),
                     [](const auto& metric) { return metric.first.ends_with("deadline_missed_count"); });
}

std::string NeverActivated(const FaultResult& fault, const Score& score) {
  const faults::FaultType* const type = faults::FindFaultType(fault.type);
  const bool wants_computing = type != nullptr && type->needs == faults::Needs::kComputing;
  return "fault '" + fault.id + "' never activated" +
         (wants_computing && !StatesComputing(score)
              ? ": the firmware states no computing time that it could stretch (docs/nmpc.md)"
              : "");
}

Score ScoreRun(const Scenario& scenario, const RunLog& log, const ScoreOptions& options) {
  Check(log.clients.size() == scenario.client_count(), "a flight has a log for each client of its scenario");
  Score score;
  for (const ClientLog& client : log.clients)
    score.restarts += static_cast<std::int64_t>(client.restarts.size());
  score.criteria.push_back(Survival(scenario, log));
  if (auto control_period = ControlPeriod(scenario, log))
    score.criteria.push_back(std::move(*control_period));
  if (auto clean_line = CleanLine(scenario, log)) score.criteria.push_back(std::move(*clean_line));
  for (std::size_t i = 0; i < scenario.faults.size(); ++i) {
    const auto& counts = log.fault_activation_counts;
    score.faults.push_back(
        {scenario.faults[i].id, scenario.faults[i].type, i < counts.size() ? counts[i] : 0});
  }
  const auto is_judged = [&](const CriterionSpec& spec) {
    return !options.only || spec.name == *options.only;
  };
  Metrics metrics;
  try {
    if (!options.only || std::ranges::any_of(scenario.criteria, [&](const CriterionSpec& spec) {
          return is_judged(spec) && !spec.metric.empty();
        }))
      metrics = ComputeMetrics(scenario, log);
  } catch (const std::invalid_argument& e) {
    score.criteria.push_back({"metrics", Verdict::kError, std::nullopt, std::nullopt, e.what()});
  }
  score.metrics = metrics.values;
  for (const CriterionSpec& spec : scenario.criteria)
    if (is_judged(spec)) score.criteria.push_back(JudgeCriterion(spec, scenario, metrics, log, options));
  if (!options.only) AddHistograms(scenario, log, score);
  Conclude(score, log, scenario.expected());
  DoubtForLateness(score, scenario, log);
  return score;
}

}  // namespace tiltproof::harness
