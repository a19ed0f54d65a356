#include "harness/score/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string_view>

#include "faults/registry.h"
#include "harness/formula/formula.h"
#include "harness/score/client_behaviour.h"
#include "harness/score/signals.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// Spans that touch or overlap become one.
std::vector<LateSpan> Merged(std::vector<LateSpan> spans) {
  std::sort(spans.begin(), spans.end(),
            [](const LateSpan& a, const LateSpan& b) { return a.begin_ns < b.begin_ns; });
  std::vector<LateSpan> merged;
  for (const LateSpan& span : spans) {
    if (!merged.empty() && span.begin_ns <= merged.back().end_ns) {
      merged.back().end_ns = std::max(merged.back().end_ns, span.end_ns);
    } else {
      merged.push_back(span);
    }
  }
  return merged;
}

std::vector<LateSpan> Together(std::vector<LateSpan> spans, const std::vector<LateSpan>& more) {
  spans.insert(spans.end(), more.begin(), more.end());
  return spans;
}

constexpr double kSettledError_m = 0.25;
// Where the start from rest is over, in the paper's spiral.
constexpr TimeNs kTransientNs = 10 * kNsPerS;

double Milliseconds(TimeNs t) { return static_cast<double>(t) / 1e6; }

class Calculator {
 public:
  Calculator(const Scenario& scenario, const RunLog& log)
      : scenario_(scenario), log_(log), times_(RowTimes(log.trace)), error_(Signal("position_error_m")) {}

  Metrics Compute() {
    Check(error_.size() == times_.size(), "each row of a trace has a time and an error");
    Tracking();
    Settling();
    Attitude();
    Control();
    for (std::size_t client = 0; client < log_.clients.size(); ++client) {
      Timing(client);
      Link(client);
    }
    Redundancy();
    if (log_.harness_overrun_count) SetCount("timing.harness_overrun_count", *log_.harness_overrun_count);
    if (log_.harness_late_max_ns) Set("timing.harness_late_max_ms", Milliseconds(*log_.harness_late_max_ns));
    Set("survival.time_s", Started() ? ToSeconds(std::max<TimeNs>(log_.end_ns, 0)) : 0.0);
    return std::move(metrics_);
  }

 private:
  void Set(const std::string& name, double value) {
    if (std::isfinite(value)) metrics_.values[name] = value;
  }
  void SetCount(const std::string& name, std::int64_t value) { Set(name, static_cast<double>(value)); }

  std::vector<double> Signal(std::string_view name) const { return ReadSignal(log_.trace, name); }

  // Root of the mean square of what is finite in [from_ns, until_ns); NaN of nothing.
  double RootMeanSquare(const std::vector<double>& values, TimeNs from_ns = 0,
                        TimeNs until_ns = kNever) const {
    double sum = 0.0;
    std::int64_t count = 0;
    for (std::size_t r = 0; r < values.size(); ++r) {
      if (!std::isfinite(values[r]) || times_[r] < from_ns || times_[r] >= until_ns) continue;
      sum += values[r] * values[r];
      ++count;
    }
    return std::sqrt(sum / static_cast<double>(count));
  }

  // Largest magnitude of what is finite; NaN of nothing.
  static double MaxMagnitude(const std::vector<double>& values) {
    double largest = std::nan("");
    for (const double value : values)
      if (std::isfinite(value)) largest = std::fmax(largest, std::abs(value));
    return largest;
  }

  // From a fault's onset to where it is active last: as its window and period say, or, when it waits for something, as the
  // trace does. None when it never was active.
  std::optional<faults::Window> ActiveSpan(const faults::FaultSpec& fault) const {
    if (!faults::WaitsForEvent(fault)) return faults::Activity(fault, faults::WindowOf(fault)).Span();
    const std::vector<double> active = Signal(std::string(stl::kActivePrefix) + fault.id);
    const auto is_active = [](double value) { return value != 0.0; };
    const auto first = std::find_if(active.begin(), active.end(), is_active);
    if (first == active.end()) return std::nullopt;
    const auto last = std::find_if(active.rbegin(), active.rend(), is_active).base();  // the row after it
    return faults::Window{
        times_[static_cast<std::size_t>(first - active.begin())],
        last == active.end() ? kNever : times_[static_cast<std::size_t>(last - active.begin())]};
  }

  void Tracking() {
    Set("tracking.rmse_m", RootMeanSquare(error_));
    Set("tracking.rmse_after_10s_m", RootMeanSquare(error_, kTransientNs));
    Set("tracking.max_error_m", MaxMagnitude(error_));
    for (const std::string axis : {"x", "y", "z"}) {
      std::vector<double> difference = Signal(axis + "_m");
      const std::vector<double> reference = Signal(axis + "_ref_m");
      for (std::size_t r = 0; r < difference.size(); ++r) difference[r] -= reference[r];
      Set("tracking.rmse_" + axis + "_m", RootMeanSquare(difference));
    }
    if (times_.empty()) return;
    TimeNs onset_ns = scenario_.faults.empty() ? 0 : kNever;
    for (const auto& fault : scenario_.faults)
      if (const auto span = ActiveSpan(fault))
        onset_ns = std::min(onset_ns, std::max<TimeNs>(span->begin_ns, 0));
    if (!scenario_.faults.empty()) {
      if (onset_ns != kNever) metrics_.faults_onset_ns = onset_ns;
      Set("tracking.rmse_before_faults_m", RootMeanSquare(error_, 0, onset_ns));
      Set("tracking.rmse_since_faults_m", RootMeanSquare(error_, onset_ns));
    }
    double iae = 0.0, itae = 0.0;
    for (std::size_t r = 1; r < times_.size(); ++r) {
      if (!std::isfinite(error_[r - 1]) || !std::isfinite(error_[r])) continue;
      const double dt_s = ToSeconds(times_[r] - times_[r - 1]);
      const auto weighted = [&](std::size_t i) {
        return times_[i] > onset_ns ? ToSeconds(times_[i] - onset_ns) * error_[i] : 0.0;
      };
      iae += 0.5 * (error_[r - 1] + error_[r]) * dt_s;
      // Between two rows, the onset begins a narrower trapezoid, with a weight of 0.
      const double weighted_s = ToSeconds(std::max<TimeNs>(times_[r] - std::max(times_[r - 1], onset_ns), 0));
      itae += 0.5 * (weighted(r - 1) + weighted(r)) * weighted_s;
    }
    Set("tracking.iae_m_s", iae);
    Set("tracking.itae_m_s2", itae);
  }

  // Only where there is something to recover from, and time to do so.
  void Settling() {
    if (scenario_.faults.empty() || times_.empty()) return;
    TimeNs end_ns = 0;
    bool some_fault_began = false;
    for (const auto& fault : scenario_.faults) {
      const auto span = ActiveSpan(fault);
      if (!span) continue;
      some_fault_began = true;
      end_ns = std::max(end_ns, span->end_ns);
    }
    if (!some_fault_began || end_ns >= times_.back()) return;
    std::size_t settled = times_.size();
    while (settled > 0 && error_[settled - 1] <= kSettledError_m) --settled;
    if (settled == times_.size()) {
      metrics_.settling_at_least_s = ToSeconds(times_.back() - end_ns);
      return;
    }
    // The row in force at the fault's end may lie a little before it.
    const auto after = std::upper_bound(times_.begin(), times_.end(), end_ns);
    const auto at_end = static_cast<std::size_t>(after - times_.begin() - (after == times_.begin() ? 0 : 1));
    Set("tracking.settling_s", settled <= at_end ? 0.0 : ToSeconds(times_[settled] - end_ns));
  }

  void Attitude() {
    for (const std::string angle : {"roll", "pitch", "yaw"})
      Set("attitude.max_" + angle + "_rad", MaxMagnitude(Signal(angle + "_rad")));
  }

  // The input is held from row to row, so its integral is a sum of rectangles.
  void Control() {
    const std::size_t rows = times_.size();
    if (rows == 0) return;
    std::vector<bool> saturated(rows, false);
    const std::vector<std::size_t> inputs = FindVehicleColumns(log_.trace).inputs;
    const std::size_t count = log_.hover_input.size();
    if (inputs.size() != count)
      throw std::invalid_argument("the trace has " + std::to_string(inputs.size()) +
                                  " inputs, the vehicle's hover " + std::to_string(count));
    bool has_limits = log_.input_min.size() == count && log_.input_max.size() == count;
    double effort = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      has_limits = has_limits && log_.input_min[i] < log_.input_max[i];
      const std::vector<double> input = Signal(log_.trace.columns()[inputs[i]]);
      for (std::size_t r = 0; r < rows; ++r) {
        if (has_limits && (input[r] <= log_.input_min[i] || input[r] >= log_.input_max[i]))
          saturated[r] = true;
        if (r + 1 == rows || !std::isfinite(input[r])) continue;
        const double deviation = input[r] - log_.hover_input[i];
        effort += deviation * deviation * ToSeconds(times_[r + 1] - times_[r]);
      }
    }
    Set("control.effort", effort);
    if (has_limits)
      Set("control.saturation_ratio",
          static_cast<double>(std::count(saturated.begin(), saturated.end(), true)) /
              static_cast<double>(rows));
  }

  void Redundancy() {
    if (!scenario_.has_several_clients()) return;
    std::int64_t lost_count = 0;
    for (std::size_t client = 0; client < log_.clients.size(); ++client) {
      const std::optional<ClientLoss>& loss = log_.clients[client].loss;
      if (!loss) continue;
      ++lost_count;
      Set(ClientName(scenario_, "firmware.", client, '.', "lost_at_s"), ToSeconds(loss->time_ns));
    }
    SetCount("redundancy.clients_lost_count", lost_count);
    if (!log_.redundancy) return;
    const RedundancyTotals& totals = *log_.redundancy;
    SetCount("redundancy.switches_count", totals.switches_count);
    Set("redundancy.without_control_s", ToSeconds(totals.without_control_ns));
    Set("redundancy.largest_bump", totals.largest_bump);
    if (totals.split_brain_ns) Set("redundancy.split_brain_s", ToSeconds(*totals.split_brain_ns));
    if (totals.disagreement_ns) Set("redundancy.disagreement_s", ToSeconds(*totals.disagreement_ns));
  }

  // t = 0 came.
  bool Started() const {
    const auto has_started = [](const ClientLog& client) { return client.starts_accepted_count > 0; };
    if (scenario_.is_redundant()) return std::ranges::any_of(log_.clients, has_started);
    return has_started(log_.clients.at(scenario_.selected_client()));
  }

  struct Quantile {
    const char* name;
    std::size_t numerator, denominator;
  };
  static constexpr std::array<Quantile, 4> kToTheTail = {
      {{"p50", 50, 100}, {"p99", 99, 100}, {"p999", 999, 1000}, {"max", 1, 1}}};
  static constexpr std::array<Quantile, 3> kUsual = {{{"p50", 50, 100}, {"p99", 99, 100}, {"max", 1, 1}}};

  // `undisturbed`: the range of a quantile, given the sorted values.
  void SetQuantiles(const std::string& group, std::vector<double>& values,
                    std::span<const Quantile> quantiles, const auto& undisturbed) {
    if (values.empty()) return;
    std::sort(values.begin(), values.end());
    for (const Quantile& q : quantiles) {
      const std::string metric = group + "_" + q.name + "_ms";
      Set(metric, NearestRank(values, q.numerator, q.denominator));
      if (!disturbed_.empty()) metrics_.undisturbed[metric] = undisturbed(q, values);
    }
  }

  std::string TimingName(std::size_t client, std::string_view metric) const {
    return ClientName(scenario_, "timing.", client, '.', metric);
  }

  void Timing(std::size_t client) {
    Intervals(client);
    Exchanges(client);
    if (log_.clients[client].starts_accepted_count > 0) Silence(client);
  }

  // Between one request and the next, or one command where the server sends by itself.
  void Intervals(std::size_t client) {
    const std::vector<TimeNs>& times_ns = PeriodTimes(scenario_, log_.clients[client]);
    // Without those that this machine disturbed: which these are is known of intervals.
    const auto [undisturbed_ns, left_out_count] =
        UndisturbedIntervals({}, WithThePeriodAfter(disturbed_), times_ns);
    const bool enough = undisturbed_ns.size() >= kIntervalsMin || undisturbed_ns.size() > left_out_count;
    std::vector<double> periods_ms, jitters_ms, sound_ms, sound_jitters_ms;
    for (const TimeNs interval_ns : undisturbed_ns) {
      sound_ms.push_back(Milliseconds(interval_ns));
      sound_jitters_ms.push_back(Milliseconds(std::abs(interval_ns - period_ns_)));
    }
    std::sort(sound_jitters_ms.begin(), sound_jitters_ms.end());
    const auto undisturbed = [enough](const std::vector<double>& sound) {
      return [&sound, enough](const Quantile& q, const std::vector<double>&) {
        UndisturbedRange range;
        if (sound.empty()) return range;
        const double value = NearestRank(sound, q.numerator, q.denominator);
        // One alone tells of the largest that it is not smaller, and nothing of the others.
        if (enough || q.numerator == q.denominator) range.low = value;
        if (enough) range.high = value;
        return range;
      };
    };
    for (std::size_t i = 1; i < times_ns.size(); ++i) {
      const TimeNs interval_ns = times_ns[i] - times_ns[i - 1];
      periods_ms.push_back(Milliseconds(interval_ns));
      jitters_ms.push_back(Milliseconds(std::abs(interval_ns - period_ns_)));
    }
    if (!periods_ms.empty()) {
      const TimeNs span_ns = times_ns.back() - times_ns.front();
      const std::string mean = TimingName(client, "request_period_mean_ms");
      Set(mean, Milliseconds(span_ns) / static_cast<double>(periods_ms.size()));
      if (!disturbed_.empty()) {
        UndisturbedRange& range = metrics_.undisturbed[mean];
        if (enough)
          range.low = range.high =
              std::accumulate(sound_ms.begin(), sound_ms.end(), 0.0) / static_cast<double>(sound_ms.size());
      }
    }
    SetQuantiles(TimingName(client, "request_period"), periods_ms, kToTheTail, undisturbed(sound_ms));
    SetQuantiles(TimingName(client, "request_jitter"), jitters_ms, kToTheTail, undisturbed(sound_jitters_ms));
  }

  void Exchanges(std::size_t client) {
    const ClientLog& own = log_.clients[client];
    // Only the number of disturbed ones has a limit: these are the largest, or the smallest.
    const auto undisturbed = [this](const std::vector<LateSpan>& disturbed) {
      return [count = PeriodsTouched(disturbed)](const Quantile& q, const std::vector<double>& sorted) {
        UndisturbedRange range;
        if (count >= sorted.size()) return range;
        const auto without = static_cast<std::ptrdiff_t>(sorted.size() - count);
        range.low = NearestRank({sorted.begin(), sorted.begin() + without}, q.numerator, q.denominator);
        range.high = NearestRank({sorted.end() - without, sorted.end()}, q.numerator, q.denominator);
        return range;
      };
    };
    std::vector<double> latencies_ms, round_trips_ms;
    for (const TimeNs latency : own.reply_latency_ns) latencies_ms.push_back(Milliseconds(latency));
    for (const TimeNs trip : own.client_round_trip_ns) round_trips_ms.push_back(Milliseconds(trip));
    // From the server to the line: no board has a part in it.
    SetQuantiles(TimingName(client, "reply_latency"), latencies_ms, kUsual, undisturbed(late_));
    SetQuantiles(TimingName(client, "client_round_trip"), round_trips_ms, kUsual, undisturbed(disturbed_));
  }

  // Periods without a command, and the time since the last one.
  void Silence(std::size_t client) {
    const ClientLog& own = log_.clients[client];
    const auto set = [&](const std::string& metric, double value, double low, double high) {
      Set(metric, value);
      if (!disturbed_.empty()) metrics_.undisturbed[metric] = {low, high};
    };
    const auto missed = static_cast<double>(MissedPeriods(own, late_));
    const auto missed_undisturbed = static_cast<double>(MissedPeriods(own, disturbed_));
    set(TimingName(client, "firmware_missed_count"), missed, missed_undisturbed, missed_undisturbed);
    const TimeNs silent_ns = SilentAtEnd(own);
    set(TimingName(client, "silent_at_end_ms"), Milliseconds(silent_ns),
        Milliseconds(silent_ns - Covered(disturbed_, log_.end_ns - silent_ns)), Milliseconds(silent_ns));
  }

  // Extends each span by a period: a board that is late in one period may make the next one shorter.
  std::vector<LateSpan> WithThePeriodAfter(std::vector<LateSpan> spans) const {
    for (LateSpan& span : spans) span.end_ns += period_ns_;
    return Merged(std::move(spans));
  }

  // Number of control periods that these spans touch at most, wherever periods begin.
  std::size_t PeriodsTouched(const std::vector<LateSpan>& spans) const {
    TimeNs count = 0;
    for (const LateSpan& span : spans) {
      const TimeNs begin_ns = std::max<TimeNs>(span.begin_ns, 0), end_ns = std::min(span.end_ns, log_.end_ns);
      if (begin_ns <= end_ns) count += (end_ns - begin_ns) / period_ns_ + 2;
    }
    return static_cast<std::size_t>(count);
  }

  // Time of the flight from `from_ns` on that these spans cover; each covers the period after it, too.
  TimeNs Covered(const std::vector<LateSpan>& spans, TimeNs from_ns) const {
    TimeNs covered_ns = 0;
    for (const LateSpan& span : WithThePeriodAfter(spans))
      covered_ns +=
          std::max<TimeNs>(std::min(span.end_ns, log_.end_ns) - std::max(span.begin_ns, from_ns), 0);
    return covered_ns;
  }

  // Time since the last request or since the last command, the longer of the two; from t = 0 when none came.
  TimeNs SilentAtEnd(const ClientLog& own) const {
    const auto since = [&](const std::vector<TimeNs>& times_ns) {
      return log_.end_ns - (times_ns.empty() ? 0 : times_ns.back());
    };
    return std::max<TimeNs>({since(own.sent_request_times_ns), since(own.actuator_times_ns), 0});
  }

  // Control periods without an actuator message, from the gaps between those that came: the client's clock
  // need not be the server's, so there is no grid to count on.
  std::int64_t MissedPeriods(const ClientLog& own, const std::vector<LateSpan>& late) const {
    std::int64_t missed = 0;
    TimeNs last_ns = 0;
    bool first = true;
    for (const TimeNs time_ns : own.actuator_times_ns) {
      const TimeNs gap_ns = time_ns - last_ns;
      // The first follows the start in the same period; of the others each should follow the one before in
      // the next.
      const std::int64_t periods = first ? gap_ns / period_ns_ : (gap_ns + period_ns_ / 2) / period_ns_ - 1;
      missed += Blamable(last_ns, periods, late);
      last_ns = time_ns;
      first = false;
    }
    return missed + Blamable(last_ns, (log_.end_ns - last_ns) / period_ns_, late);
  }

  // Number of `periods` missed in a row after `last_ns` in which this machine was not late itself, nor in the one
  // before.
  std::int64_t Blamable(TimeNs last_ns, std::int64_t periods, const std::vector<LateSpan>& spans) const {
    std::int64_t blamable = 0;
    for (std::int64_t i = 1; i <= periods; ++i) {
      const TimeNs begin_ns = last_ns + (i - 1) * period_ns_;
      const TimeNs end_ns = begin_ns + 2 * period_ns_;
      const auto late = std::upper_bound(spans.begin(), spans.end(), begin_ns - period_ns_,
                                         [](TimeNs t, const LateSpan& span) { return t < span.end_ns; });
      const bool excused = late != spans.end() && late->begin_ns < end_ns;
      blamable += excused ? 0 : 1;
    }
    return blamable;
  }

  void Link(std::size_t client) {
    const ClientLog& own = log_.clients[client];
    const auto of_link = [&](std::string_view metric) {
      return ClientName(scenario_, "link.", client, '.', metric);
    };
    const auto firmware = [&](std::string_view metric) {
      return ClientName(scenario_, "firmware.", client, '.', metric);
    };
    for (std::size_t i = 0; i < link::kDirectionCount; ++i) {
      const std::string group = of_link(std::string(link::Name(static_cast<link::Direction>(i))) + ".");
      const DirectionCounts& counts = own.counts[i];
      SetCount(group + "frames_sent_count", counts.frames_sent);
      SetCount(group + "frames_accepted_count", counts.frames_accepted);
      SetCount(group + "frames_rejected_count", counts.frames_rejected);
      SetCount(group + "bytes_corrupted_count", counts.bytes_corrupted);
      SetCount(group + "parity_errors_count", counts.parity_errors);
    }
    SetCount(of_link("accepted_wrong_count"), own.accepted_wrong_count);
    SetCount(of_link("accepted_stale_count"), own.accepted_stale_count);
    Set(of_link("resync_max_ms"), Milliseconds(own.resync_max_ns));
    if (own.failsafe_entered_count) SetCount(firmware("failsafe_entered_count"), *own.failsafe_entered_count);
    if (own.deadline_missed_count)
      SetCount(TimingName(client, "deadline_missed_count"), *own.deadline_missed_count);
    if (own.receive_overruns_count) SetCount(firmware("receive_overruns_count"), *own.receive_overruns_count);
    if (own.stacks) {
      double share = 0.0;
      for (const StackUse& stack : *own.stacks)
        share = std::max(share,
                         static_cast<double>(stack.used_bytes_max) / static_cast<double>(stack.size_bytes));
      Set(firmware("stack_used_share_max"), share);
    }
    if (own.protocol) {
      const auto protocol = [&](std::string_view metric) {
        return ClientName(scenario_, "protocol.", client, '.', metric);
      };
      SetCount(protocol("requests_per_period_max_count"), own.protocol->requests_per_period_max);
      SetCount(protocol("actuators_per_request_max_count"), own.protocol->actuators_per_request_max);
      SetCount(protocol("actuators_before_reply_count"), own.protocol->actuators_before_reply);
      SetCount(protocol("replies_unanswered_count"), own.protocol->replies_unanswered);
      SetCount(protocol("malformed_sent_count"), own.protocol->malformed_sent);
      if (own.protocol->refused_commands)
        SetCount(protocol("refused_commands_count"), *own.protocol->refused_commands);
      if (own.protocol->replies_ignored)
        SetCount(protocol("replies_ignored_count"), own.protocol->replies_ignored->count);
      if (own.protocol->commands_without_reply)
        SetCount(protocol("commands_without_reply_count"), own.protocol->commands_without_reply->count);
    }
    SetCount(firmware("restarts_count"), std::max<std::int64_t>(own.starts_accepted_count - 1, 0));
  }

  const Scenario& scenario_;
  const RunLog& log_;
  const TimeNs period_ns_ = scenario_.link.protocol->control_period_ns;
  // In real time: when the harness was late, and when this machine took any time from the flight. Apart, in order.
  const std::vector<LateSpan> late_ = Merged(log_.harness_late);
  const std::vector<LateSpan> disturbed_ = Merged(Together(log_.harness_late, log_.board_disturbed));
  const std::vector<TimeNs> times_;
  const std::vector<double> error_;
  Metrics metrics_;
};

}  // namespace

Metrics ComputeMetrics(const Scenario& scenario, const RunLog& log) {
  return Calculator(scenario, log).Compute();
}

double NearestRank(const std::vector<double>& sorted, std::size_t numerator, std::size_t denominator) {
  Check(denominator > 0, "a quantile is a share");
  const std::size_t rank = (sorted.size() * numerator + denominator - 1) / denominator;
  Check(rank > 0 && rank <= sorted.size(), "a quantile is one of the samples");
  return sorted[rank - 1];
}

const std::vector<std::string>& MetricNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all = {"tracking.rmse_m",
                                    "tracking.rmse_after_10s_m",
                                    "tracking.rmse_before_faults_m",
                                    "tracking.rmse_since_faults_m",
                                    "tracking.rmse_x_m",
                                    "tracking.rmse_y_m",
                                    "tracking.rmse_z_m",
                                    "tracking.max_error_m",
                                    "tracking.iae_m_s",
                                    "tracking.itae_m_s2",
                                    "tracking.settling_s",
                                    "attitude.max_roll_rad",
                                    "attitude.max_pitch_rad",
                                    "attitude.max_yaw_rad",
                                    "control.saturation_ratio",
                                    "control.effort",
                                    "timing.request_period_mean_ms",
                                    "timing.request_period_p50_ms",
                                    "timing.request_period_p99_ms",
                                    "timing.request_period_p999_ms",
                                    "timing.request_period_max_ms",
                                    "timing.request_jitter_p50_ms",
                                    "timing.request_jitter_p99_ms",
                                    "timing.request_jitter_p999_ms",
                                    "timing.request_jitter_max_ms",
                                    "timing.reply_latency_p50_ms",
                                    "timing.reply_latency_p99_ms",
                                    "timing.reply_latency_max_ms",
                                    "timing.client_round_trip_p50_ms",
                                    "timing.client_round_trip_p99_ms",
                                    "timing.client_round_trip_max_ms",
                                    "timing.firmware_missed_count",
                                    "timing.silent_at_end_ms",
                                    "timing.deadline_missed_count",
                                    "timing.harness_overrun_count",
                                    "timing.harness_late_max_ms"};
    for (const std::string direction : {"to_client", "to_plant", "reference"})
      for (const std::string counter :
           {"frames_sent", "frames_accepted", "frames_rejected", "bytes_corrupted", "parity_errors"})
        all.push_back(std::string("link.").append(direction).append(".").append(counter).append("_count"));
    all.insert(all.end(), {"link.accepted_wrong_count",
                           "link.accepted_stale_count",
                           "link.resync_max_ms",
                           "protocol.requests_per_period_max_count",
                           "protocol.actuators_per_request_max_count",
                           "protocol.actuators_before_reply_count",
                           "protocol.replies_unanswered_count",
                           "protocol.malformed_sent_count",
                           "protocol.refused_commands_count",
                           "protocol.replies_ignored_count",
                           "protocol.commands_without_reply_count",
                           "firmware.failsafe_entered_count",
                           "firmware.receive_overruns_count",
                           "firmware.stack_used_share_max",
                           "firmware.restarts_count",
                           "firmware.lost_at_s",
                           "redundancy.switches_count",
                           "redundancy.without_control_s",
                           "redundancy.largest_bump",
                           "redundancy.split_brain_s",
                           "redundancy.disagreement_s",
                           "redundancy.clients_lost_count",
                           "survival.time_s"});
    return all;
  }();
  return names;
}

}  // namespace tiltproof::harness
