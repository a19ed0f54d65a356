#include "harness/report/flight_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>

#include "harness/report/activations_file.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/flight_hashes.h"
#include "harness/score/signals.h"
#include "harness/score/stl.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// A longer log of a line would take too much memory; link-dump reads it record by record.
constexpr std::uintmax_t kLinkBytesMax = 64 << 20;
// Some two hours of flight: reading it takes about its size in memory.
constexpr std::uintmax_t kTraceBytesMax = 512 << 20;

// Time since the begin of the flight at which what is below an `always` must hold.
struct Scope {
  double begin_s = 0;
  std::optional<double> end_s;
};

std::optional<double> NumberOf(const stl::Formula& formula) {
  if (formula->op == stl::Op::kNumber) return formula->number;
  if (formula->op == stl::Op::kNegate && formula->left->op == stl::Op::kNumber) return -formula->left->number;
  return std::nullopt;
}

void AddBound(const stl::Node& node, const Scope& scope, const std::string& criterion,
              std::vector<SignalBound>& bounds) {
  SignalBound bound{.criterion = criterion, .signal = {}, .begin_s = scope.begin_s, .end_s = scope.end_s};
  bound.upper = node.op == stl::Op::kLessEqual || node.op == stl::Op::kLess;
  stl::Formula signal = node.left;
  std::optional<double> value = NumberOf(node.right);
  if (!value) {
    value = NumberOf(node.left);
    signal = node.right;
    bound.upper = !bound.upper;
  }
  if (!value) return;
  if (signal->op == stl::Op::kAbs) {
    bound.of_magnitude = true;
    signal = signal->left;
  }
  if (signal->op != stl::Op::kSignal) return;
  bound.signal = signal->name;
  bound.value = *value;
  bounds.push_back(std::move(bound));
}

// Adds the comparisons that must always hold; one that holds only under a condition is no bound.
void AddBounds(const stl::Formula& formula, bool always, const Scope& scope, const std::string& criterion,
               std::vector<SignalBound>& bounds) {
  if (formula->op == stl::Op::kAnd) {
    AddBounds(formula->left, always, scope, criterion, bounds);
    AddBounds(formula->right, always, scope, criterion, bounds);
  } else if (formula->op == stl::Op::kAlways) {
    Scope inner = scope;
    if (formula->window) {
      inner.begin_s += ToSeconds(formula->window->begin_ns);
      inner.end_s = scope.end_s.value_or(scope.begin_s) + ToSeconds(formula->window->end_ns);
    } else {
      inner.end_s.reset();
    }
    AddBounds(formula->left, true, inner, criterion, bounds);
  } else if (always && stl::IsComparison(formula->op)) {
    AddBound(*formula, scope, criterion, bounds);
  }
}

void AddBands(const Scenario& scenario, FlightView& view) {
  const Trace& trace = view.trace;
  for (std::size_t fault = 0; fault < scenario.faults.size(); ++fault) {
    const auto column = trace.Find(std::string(stl::kActivePrefix) + scenario.faults[fault].id);
    if (!column) continue;
    std::size_t bands = 0;
    const auto is_active = [&](std::size_t r) {
      return r < trace.row_count() && trace.at(r, *column) != 0.0;
    };
    for (std::size_t r = 0; r < trace.row_count() && bands < kBandsMax; ++r) {
      if (!is_active(r)) continue;
      const std::size_t begin = r;
      while (is_active(r)) ++r;
      const std::size_t end = std::min(r, trace.row_count() - 1);
      CheckIndex(end, view.times_ns.size(), "each row of a shown trace has a time");
      view.bands.push_back({fault, ToSeconds(view.times_ns[begin]), ToSeconds(view.times_ns[end])});
      ++bands;
    }
  }
}

// Throws where two rows are further apart than the page can tell.
void CheckDistances(const std::vector<TimeNs>& times_ns) {
  for (std::size_t r = 1; r < times_ns.size(); ++r)
    if (times_ns[r] - times_ns[r - 1] > kRowDistanceMax_ns)
      throw std::runtime_error(fmt::format(
          "row {} is {:.3f} s after the one before; a shown trace has a row every {:.3f} s at least", r,
          ToSeconds(times_ns[r] - times_ns[r - 1]), ToSeconds(kRowDistanceMax_ns)));
}

void AddTicks(const std::string& jsonl, FlightView& view) {
  std::map<std::string, std::size_t> places;
  for (std::size_t i = 0; i < view.scenario.faults.size(); ++i) places[view.scenario.faults[i].id] = i;
  std::map<std::size_t, std::size_t> told;
  ReadActivations(jsonl, ActivationBytes::kNone, [&](KeptActivation activation) {
    const auto place = places.find(activation.fault);
    if (place == places.end()) return true;
    FaultTick tick{place->second, ToSeconds(activation.time_ns), {}};
    if (told[tick.fault]++ < kToldActivationsMax) tick.what = std::move(activation.what);
    view.ticks.push_back(std::move(tick));
    return view.ticks.size() < kTicksMax;
  });
}

void AddComputed(const RunLog& log, const std::vector<TimeNs>& times_ns, FlightView& view) {
  for (const char* name : {"position_error_m", "cross_track_error_m", "speed_m_s", "tilt_rad"})
    view.computed.push_back({name, ReadSignal(log.trace, name)});
  const Score score = ScoreRun(view.scenario, log, {.over_time = true});
  for (const CriterionResult& criterion : score.criteria) {
    if (!criterion.over_time) continue;
    const stl::OverTime& over_time = *criterion.over_time;
    view.robustness.push_back({criterion.name, over_time.reading, over_time.looks_ahead});
    std::vector<double> lower(log.trace.row_count(), std::numeric_limits<double>::quiet_NaN());
    std::vector<double> upper = lower;
    bool two = false;
    std::size_t r = 0;
    for (const stl::RowRobustness& row : over_time.rows) {
      while (times_ns.at(r) != row.time_ns) ++r;
      lower[r] = row.lower;
      upper[r] = row.upper;
      two |= std::isfinite(row.lower) && row.lower != row.upper;
    }
    if (two) view.computed.push_back({"robustness_lower/" + criterion.name, std::move(lower)});
    view.computed.push_back({"robustness_upper/" + criterion.name, std::move(upper)});
  }
}

// The chance at each row, on lines between the moments.
void AddWhyCurve(FlightView& view) {
  const std::vector<WhyPoint>& curve = view.why->curve;
  const auto add = [&](const char* name, double WhyPoint::*part) {
    FlightView::Series series{name, {}};
    for (const TimeNs time_ns : view.times_ns) {
      const double time_s = ToSeconds(time_ns);
      const auto right = std::lower_bound(curve.begin(), curve.end(), time_s,
                                          [](const WhyPoint& point, double t) { return point.time_s < t; });
      double value = std::numeric_limits<double>::quiet_NaN();
      if (right != curve.end() && right->time_s == time_s) {
        value = (*right).*part;
      } else if (right != curve.begin() && right != curve.end()) {
        const WhyPoint& left = *std::prev(right);
        const double share = (time_s - left.time_s) / (right->time_s - left.time_s);
        value = left.*part + share * ((*right).*part - left.*part);
      }
      series.values.push_back(value);
    }
    view.computed.push_back(std::move(series));
  };
  add("why/probability", &WhyPoint::probability);
  const bool is_random =
      std::any_of(curve.begin(), curve.end(), [](const WhyPoint& point) { return point.low != point.high; });
  if (!is_random) return;
  add("why/low", &WhyPoint::low);
  add("why/high", &WhyPoint::high);
}

}  // namespace

std::vector<SignalBound> BoundsOf(const Scenario& scenario, const std::vector<std::string>& columns) {
  const std::vector<std::string> signals = SignalNames(columns);
  std::vector<std::string> fault_ids;
  for (const auto& fault : scenario.faults) fault_ids.push_back(fault.id);
  std::vector<SignalBound> bounds;
  for (const CriterionSpec& criterion : scenario.criteria) {
    if (criterion.stl.empty()) continue;
    try {
      AddBounds(stl::Parse(criterion.stl, {.signals = signals, .fault_ids = fault_ids}), false, {},
                criterion.name, bounds);
    } catch (const stl::ParseError&) {
      // The criterion's own result says so.
    }
  }
  return bounds;
}

FlightView ViewFlight(const std::filesystem::path& folder, const FlightResult& result,
                      const Scenario& scenario, const std::optional<VehicleShape>& vehicle) {
  FlightView view;
  view.folder = folder;
  view.result = result;
  view.scenario = scenario;
  view.vehicle = vehicle;
  const auto attempt = [&](const char* file, const auto& read) {
    if (!std::filesystem::exists(folder / file)) return;
    try {
      read(folder / file);
    } catch (const std::exception& error) {
      view.problems.push_back(fmt::format("{}: {}", file, error.what()));
    }
  };
  attempt("scenario.resolved.yaml", [&](const auto& file) {
    view.resolved = ReadFile(file);
    if (view.resolved.size() > kTextBytesMax) view.resolved.resize(kTextBytesMax);
  });
  const auto read_trace = [&](const auto& file) {
    if (TraceTextBytes(file) > kTraceBytesMax) {
      view.problems.push_back(file.filename().string() + " is too long to be shown here");
      return;
    }
    RunLog log = ReadFlight(folder, scenario);
    const std::vector<TimeNs> times_ns = RowTimes(log.trace);
    CheckDistances(times_ns);
    AddComputed(log, times_ns, view);
    view.events = EventsOf(log);
    if (view.events.size() > kEventsMax) view.events.resize(kEventsMax);
    view.trace = std::move(log.trace);
    view.times_ns = times_ns;
    view.bounds = BoundsOf(scenario, view.trace.columns());
    AddBands(scenario, view);
  };
  try {
    if (const auto file = FindTrace(folder); !file.empty()) attempt(file.filename().c_str(), read_trace);
  } catch (const FileError& error) {
    view.problems.emplace_back(error.what());
  }
  attempt("why.json", [&](const auto&) {
    view.why = ReadWhy(folder);
    if (view.why && view.why->trace_hash != result.trace_hash) {
      view.why.reset();
      throw std::runtime_error("it is of another flight; tiltproof why writes it again");
    }
    if (view.why) AddWhyCurve(view);
  });
  for (std::size_t i = 0; i < scenario.client_count(); ++i) {
    const std::string file =
        scenario.has_several_clients() ? "firmware." + scenario.client_id(i) + ".log" : "firmware.log";
    attempt(file.c_str(), [&](const auto& path) {
      std::string text = ReadFlightFile(path);
      if (text.size() > kTextBytesMax) text.resize(kTextBytesMax);
      if (scenario.has_several_clients() && !text.empty()) view.firmware_log += scenario.client_id(i) + ":\n";
      view.firmware_log += text;
    });
  }
  attempt("faults.jsonl", [&](const auto& file) { AddTicks(ReadFlightFile(file), view); });
  attempt("link.bin", [&](const auto& file) {
    if (std::filesystem::file_size(file) > kLinkBytesMax) {
      view.problems.emplace_back("link.bin is too long to be shown here; tiltproof link-dump prints it");
      return;
    }
    const std::string content = ReadFlightFile(file);
    view.link = LinkLog({content.begin(), content.end()});
    view.frames = FramesOf(view.link);
  });
  return view;
}

std::vector<double> MomentsOf(const FlightView& view) {
  std::vector<double> violations, others;
  for (const CriterionResult& criterion : view.result.score.criteria)
    if (criterion.verdict == Verdict::kFail && criterion.time_s) violations.push_back(*criterion.time_s);
  for (const FaultBand& band : view.bands) {
    others.push_back(band.begin_s);
    others.push_back(band.end_s);
  }
  for (const LineFrame& frame : view.frames)
    if (frame.fate != FrameFate::kIntact) others.push_back(ToSeconds(frame.begin_ns));
  std::sort(violations.begin(), violations.end());
  std::sort(others.begin(), others.end());
  violations.insert(violations.end(), others.begin(), others.end());
  return violations;
}

}  // namespace tiltproof::harness
