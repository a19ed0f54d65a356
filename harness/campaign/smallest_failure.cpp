#include "harness/campaign/smallest_failure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <utility>

#include "faults/registry.h"
#include "harness/campaign/fault_level.h"
#include "harness/campaign/minimise.h"
#include "harness/scenario/reader.h"
#include "harness/score/headline.h"

namespace tiltproof::harness {
namespace {

using faults::FaultSpec;
using faults::FaultType;

// A fault that ended so long before the violation may still be its cause: the vehicle needs time to leave its path.
constexpr TimeNs kAfterEffect_ns = kNsPerS;
// Two levels of a severity differ by at most this share.
constexpr double kTolerance = 0.01;
// A window that was shortened may allow a milder fault, and the other way round.
constexpr int kRoundsMax = 3;

// True if the criterion's formula reads whether this fault is active.
bool IsNamedBy(const Scenario& scenario, const FaultSpec& fault) {
  return std::ranges::any_of(scenario.criteria, [&](const CriterionSpec& criterion) {
    return criterion.stl.find('"' + fault.id + '"') != std::string::npos;
  });
}

// Faults that wait for one that is not there never begin: they go, too.
Scenario WithFaults(const Scenario& scenario, const std::vector<bool>& kept) {
  Scenario fewer = scenario;
  fewer.faults.clear();
  fewer.fault_places.clear();
  for (std::size_t i = 0; i < scenario.faults.size(); ++i) {
    if (!kept[i]) continue;
    fewer.faults.push_back(scenario.faults[i]);
    if (i < scenario.fault_places.size()) fewer.fault_places.push_back(scenario.fault_places[i]);
  }
  for (std::size_t i = 0; i < fewer.faults.size();) {
    const auto& after = fewer.faults[i].after;
    const bool waits_in_vain = after && std::ranges::none_of(fewer.faults, [&](const auto& fault) {
                                 return fault.id == after->fault;
                               });
    const auto at = static_cast<std::ptrdiff_t>(i);
    if (waits_in_vain) {
      fewer.faults.erase(fewer.faults.begin() + at);
      if (i < fewer.fault_places.size()) fewer.fault_places.erase(fewer.fault_places.begin() + at);
    }
    i = waits_in_vain ? 0 : i + 1;
  }
  return fewer;
}

// The same flight, judged by nothing else.
Scenario WithCriterion(const Scenario& scenario, const std::string& name) {
  Scenario judged = scenario;
  std::erase_if(judged.criteria, [&](const CriterionSpec& criterion) { return criterion.name != name; });
  judged.criterion_places.clear();
  return judged;
}

std::string WindowText(const FaultSpec& fault) {
  const std::string start =
      fault.start_ns == kPowerOn ? "power-on" : fmt::format("{} s", ToSeconds(fault.start_ns));
  return fault.end_ns == kNever ? fmt::format("from {} on", start)
                                : fmt::format("{} to {} s", start, ToSeconds(fault.end_ns));
}

// The value with few digits, if it is still between the two.
double Short(double value, double a, double b) {
  for (const int digits : {2, 3, 4, 5}) {
    const double rounded = std::stod(fmt::format("{:.{}g}", value, digits));
    if (rounded > std::min(a, b) && rounded < std::max(a, b) &&
        std::abs(rounded - value) <= 0.2 * std::abs(b - a))
      return rounded;
  }
  return value;
}

class SmallestSearch {
 public:
  SmallestSearch(const Scenario& scenario, const Evaluate& evaluate, const MinimiseFailureOptions& options)
      : evaluate_(evaluate), options_(options) {
    found_.scenario = scenario;
  }

  // True if the scenario fails.
  bool Begin(const std::optional<Flown>& known) {
    const std::optional<Flown> first = known ? known : Fly(found_.scenario);
    if (!first) return false;
    found_.first = found_.last = *first;
    if (!found_.fails()) return false;
    found_.scenario = WithCriterion(found_.scenario, found_.first.criterion);
    return true;
  }

  void ChooseFaults();
  void SimplifyPath();
  void RemoveNoise();
  void ShrinkFaults(const VehicleSignals& signals);
  void ShortenFlight();

  SmallestFailure End() {
    if (!found_.fails() || found_.interrupted) return std::move(found_);
    reserved_ = 0;
    const std::optional<Flown> again = Fly(found_.scenario);
    found_.confirmed = again && again->criterion == found_.first.criterion;
    if (found_.confirmed) found_.last = *again;
    return std::move(found_);
  }

 private:
  std::optional<Flown> Fly(const Scenario& scenario) {
    if (found_.runs + reserved_ >= options_.runs_max) found_.out_of_runs = true;
    if (found_.interrupted || (found_.out_of_runs && reserved_ > 0)) return std::nullopt;
    const std::optional<Flown> flown = evaluate_(scenario);
    if (!flown) found_.interrupted = true;
    if (flown && flown->was_flown) ++found_.runs;
    return flown;
  }

  // Takes the candidate in place of the smallest if it fails by the same criterion.
  bool Try(const Scenario& candidate) {
    const std::string text = WriteResolved(candidate);
    const auto known = tried_.find(text);
    if (known != tried_.end() && !known->second) return false;
    const std::optional<Flown> flown = known != tried_.end() ? known->second : Fly(candidate);
    if (!flown) return false;
    const bool fails = flown->criterion == found_.first.criterion;
    tried_[text] = fails ? flown : std::nullopt;
    if (!fails) return false;
    found_.scenario = candidate;
    found_.last = *flown;
    return true;
  }

  // `again`: a step that was reported before is reported again only when it changed something.
  void Tell(std::string what, std::string before, std::string after, std::size_t runs_before,
            bool again = false) {
    if (again && before == after) return;
    options_.on_step({std::move(what), std::move(before), std::move(after), found_.runs - runs_before});
  }

  // The least k above `low` that fails: low does not, high does. `settled`: high - 1 probably does not.
  static std::int64_t Least(std::int64_t low, std::int64_t high, bool settled,
                            const std::function<bool(std::int64_t)>& fails) {
    while (high - low > 1) {
      const std::int64_t middle = settled ? high - 1 : low + (high - low) / 2;
      if (fails(middle))
        high = middle;
      else
        low = middle;
      settled = false;
    }
    return high;
  }

  TimeNs period_ns() const { return found_.scenario.link.protocol->control_period_ns; }
  void ShrinkWindow(std::size_t fault, bool settled);
  void ShrinkSeverity(std::size_t fault, const VehicleSignals& signals, bool settled);
  double LeastLevel(std::size_t fault, const Severity& severity, double mild);

  const Evaluate& evaluate_;
  const MinimiseFailureOptions& options_;
  SmallestFailure found_;
  std::map<std::string, std::optional<Flown>>
      tried_;                 // by text; none: it does not fail by the same criterion
  std::size_t reserved_ = 1;  // the last flight
};

// 1. Without any fault. 2. Without those that cannot matter, because they acted on nothing or began later. 3. Only with those
// that are active at the violation; then by halves.
void SmallestSearch::ChooseFaults() {
  const Scenario all = found_.scenario;
  const std::size_t count = all.faults.size();
  if (count == 0) return;
  const TimeNs violated_ns = found_.first.time_s ? FromSeconds(*found_.first.time_s) : all.duration_ns;
  std::vector<bool> fixed(count, false);
  std::vector<std::size_t> idle, earlier, suspects;
  for (std::size_t i = 0; i < count; ++i) {
    const FaultSpec& fault = all.faults[i];
    const bool acted = i >= found_.first.activations.size() || found_.first.activations[i] > 0;
    const bool active = fault.end_ns == kNever || fault.end_ns + kAfterEffect_ns > violated_ns;
    fixed[i] = IsNamedBy(all, fault);
    if (fixed[i]) continue;
    (!acted || fault.start_ns > violated_ns ? idle : active ? suspects : earlier).push_back(i);
  }
  const auto with = [&](const std::vector<std::size_t>& places) {
    std::vector<bool> kept = fixed;
    for (const std::size_t place : places) kept[place] = true;
    return WithFaults(all, kept);
  };
  std::vector<std::size_t> list = earlier;
  list.insert(list.end(), suspects.begin(), suspects.end());
  const bool none_needed = Try(with({}));
  if (!none_needed && !idle.empty() && !Try(with(list))) list.insert(list.begin(), idle.begin(), idle.end());
  if (!none_needed)
    Minimise<std::size_t>(list, [&](const auto& some) { return Try(with(some)); },
                          {.tests_max = options_.runs_max, .suspects_count = suspects.size()});
  Tell("faults", std::to_string(count), std::to_string(found_.scenario.faults.size()), 0);
}

void SmallestSearch::SimplifyPath() {
  Scenario simple = found_.scenario;
  if (std::holds_alternative<HoverReference>(simple.reference.path)) return;
  const std::size_t runs = found_.runs;
  simple.reference.path = HoverReference{.at_m = simple.initial_position_m};
  const bool hovers = Try(simple);
  Tell("path", "as it is", hovers ? "hover where the flight begins" : "as it is", runs);
}

void SmallestSearch::RemoveNoise() {
  if (!options_.has_sensor_noise || !found_.scenario.sensor_noise) return;
  const std::size_t runs = found_.runs;
  Scenario quiet = found_.scenario;
  quiet.sensor_noise = false;
  const bool is_quiet = Try(quiet);
  Tell("sensor noise", "on", is_quiet ? "off" : "on", runs);
}

// Windows are counted in control periods. First the end comes forward, then the start goes back.
void SmallestSearch::ShrinkWindow(std::size_t place, bool settled) {
  const FaultType& type = *faults::FindFaultType(found_.scenario.faults[place].type);
  if (type.end == faults::Bound::kRefused) return;
  const std::size_t runs = found_.runs;
  const FaultSpec before = found_.scenario.faults[place];
  const TimeNs period = period_ns();
  const auto periods = [&](TimeNs start_ns, TimeNs end_ns) {
    return std::max<std::int64_t>((end_ns - start_ns + period - 1) / period, 1);
  };
  const TimeNs start_ns = before.start_ns == kPowerOn ? 0 : before.start_ns;
  const TimeNs end_ns = std::min(before.end_ns, std::max(found_.scenario.duration_ns, start_ns + period));
  const auto with = [&](TimeNs start, TimeNs end) {
    Scenario shorter = found_.scenario;
    shorter.faults[place].start_ns = start;
    shorter.faults[place].end_ns = end;
    return Try(shorter);
  };
  Least(0, periods(start_ns, end_ns), settled,
        [&](std::int64_t k) { return with(before.start_ns, start_ns + k * period); });
  // It may have to act before the flight.
  const bool begins = before.start_ns != kPowerOn || with(0, found_.scenario.faults[place].end_ns);
  if (begins && type.start != faults::Bound::kRefused) {
    const TimeNs new_end_ns = found_.scenario.faults[place].end_ns;
    const std::int64_t longest = periods(start_ns, std::min(new_end_ns, end_ns));
    Least(0, longest, settled,
          [&](std::int64_t k) { return with(start_ns + (longest - k) * period, new_end_ns); });
  }
  Tell("window of " + before.id, WindowText(before), WindowText(found_.scenario.faults[place]), runs,
       settled);
}

// Between `mild`, which is taken not to fail, and the scenario's own level.
double SmallestSearch::LeastLevel(std::size_t place, const Severity& severity, double mild) {
  double fails = std::get<double>(found_.scenario.faults[place].parameters.at(severity.parameter)),
         passes = mild;
  const auto try_level = [&](double level) {
    const bool as_before = Try(AtLevel(found_.scenario, place, severity, level));
    (as_before ? fails : passes) = level;
    return as_before;
  };
  const auto shaped = [&](double level) {
    return severity.range.whole ? std::round(level) : Short(level, passes, fails);
  };
  const auto is_between = [&](double level) {
    return level > std::min(passes, fails) && level < std::max(passes, fails);
  };
  const bool by_ratio = severity.range.scale == faults::Scale::kLogarithmic && mild != 0 && mild * fails > 0;
  const auto distance = [&](double level) { return std::abs(level - mild); };
  const auto is_close = [&] {
    const double apart = std::abs(fails - passes);
    return apart <= kTolerance * (by_ratio ? std::max(fails, passes) : distance(fails));
  };
  // Behind a window that is as short as it can be, the level is mostly the least, too.
  if (!is_close())
    if (const double level = shaped(fails - kTolerance * (fails - mild));
        is_between(level) && !try_level(level))
      return fails;
  // Harmless is no place on a scale of ratios: go towards it in ever larger steps.
  for (double divisor = 2; !by_ratio && passes == mild; divisor *= divisor) {
    const double level = shaped(mild + (fails - mild) / divisor);
    if (divisor > 1e9 || !is_between(level) || !try_level(level)) break;
  }
  while (!is_close()) {
    const double level = shaped(
        by_ratio         ? std::sqrt(passes * fails)
        : passes == mild ? mild + (fails - mild) / 2
                         : mild + std::copysign(std::sqrt(distance(passes) * distance(fails)), fails - mild));
    if (!is_between(level)) break;
    try_level(level);
  }
  return fails;
}

void SmallestSearch::ShrinkSeverity(std::size_t place, const VehicleSignals& signals, bool settled) {
  const std::size_t runs = found_.runs;
  const FaultSpec before = found_.scenario.faults[place];
  Severity severity;
  try {
    severity = SeverityOf(found_.scenario, place, signals);
  } catch (const SeverityMistake&) {
    return;  // it has none
  }
  if (severity.parameter == kWindowParameter || !before.parameters.contains(severity.parameter)) return;
  const double own = std::get<double>(before.parameters.at(severity.parameter));
  const double mild = severity.range.harmless.value_or(severity.range.start);
  if (own == mild) return;
  const double least = LeastLevel(place, severity, mild);
  const auto text = [&](double level) {
    return severity.unit.empty() ? fmt::format("{}", level) : fmt::format("{} {}", level, severity.unit);
  };
  Tell(fmt::format("{} of {}", severity.parameter, before.id), text(own), text(least), runs, settled);
}

void SmallestSearch::ShrinkFaults(const VehicleSignals& signals) {
  for (int round = 0; round < kRoundsMax; ++round) {
    const std::string before = WriteResolved(found_.scenario);
    for (std::size_t i = 0; i < found_.scenario.faults.size(); ++i) {
      ShrinkWindow(i, round > 0);
      ShrinkSeverity(i, signals, round > 0);
    }
    if (WriteResolved(found_.scenario) == before) return;
  }
}

void SmallestSearch::ShortenFlight() {
  const std::size_t runs = found_.runs;
  const TimeNs before = found_.scenario.duration_ns, period = period_ns();
  const auto with = [&](TimeNs duration_ns) {
    Scenario shorter = found_.scenario;
    shorter.duration_ns = duration_ns;
    return duration_ns < before && Try(shorter);
  };
  if (found_.last.time_s) {
    // The row of the violation, and one more.
    with((FromSeconds(*found_.last.time_s) / period + 2) * period);
  } else {
    const std::int64_t unit = std::max<std::int64_t>(before / period / 100, 1);
    Least(0, before / period / unit, false, [&](std::int64_t k) { return with(k * unit * period); });
  }
  Tell("length", fmt::format("{} s", ToSeconds(before)),
       fmt::format("{} s", ToSeconds(found_.scenario.duration_ns)), runs);
}

}  // namespace

Flown FlownAs(const FlightResult& result) {
  Flown flown;
  for (const FaultResult& fault : result.score.faults) flown.activations.push_back(fault.activations);
  if (result.score.verdict != Verdict::kFail) {
    flown.reason = result.score.reason;
    return flown;
  }
  if (const CriterionResult* first = FirstViolated(result.score)) {
    flown.criterion = first->name;
    flown.time_s = first->time_s;
    flown.reason = fmt::format("{}: {}", first->name, first->explanation);
  }
  return flown;
}

SmallestFailure MinimiseFaults(const Scenario& scenario, const Evaluate& evaluate,
                               const MinimiseFailureOptions& options, const std::optional<Flown>& first) {
  SmallestSearch search(scenario, evaluate, options);
  if (search.Begin(first)) search.ChooseFaults();
  return search.End();
}

SmallestFailure MinimiseFailure(const Scenario& scenario, const VehicleSignals& signals,
                                const Evaluate& evaluate, const MinimiseFailureOptions& options) {
  SmallestSearch search(scenario, evaluate, options);
  if (search.Begin(std::nullopt)) {
    search.ChooseFaults();
    search.SimplifyPath();
    search.RemoveNoise();
    search.ShrinkFaults(signals);
    search.ShortenFlight();
  }
  return search.End();
}

std::optional<Scenario> NextQuestion(const FailureSearch& search, std::span<const Flown> answers,
                                     SmallestFailure& result) {
  std::size_t asked = 0;
  std::optional<Scenario> question;
  result = search([&](const Scenario& smaller) -> std::optional<Flown> {
    if (asked < answers.size()) return answers[asked++];
    if (!question) question = smaller;
    return std::nullopt;
  });
  return question;
}

std::vector<Scenario> Foreseen(const FailureSearch& search, std::span<const Flown> answers,
                               std::size_t count) {
  std::vector<Scenario> foreseen;
  if (answers.empty()) return foreseen;
  const Flown passes{.criterion = {}, .activations = {}};
  // As the last one that failed.
  const Flown fails = *std::find_if(answers.rbegin(), answers.rend() - 1, [&](const Flown& flown) {
    return flown.criterion == answers[0].criterion;
  });
  std::deque<std::vector<Flown>> guesses;  // the nearest first
  const auto guess = [&](const std::vector<Flown>& known) {
    for (const Flown& answer : {passes, fails}) guesses.emplace_back(known).push_back(answer);
  };
  for (guess({answers.begin(), answers.end()}); !guesses.empty() && foreseen.size() < count;
       guesses.pop_front()) {
    SmallestFailure result;
    if (auto question = NextQuestion(search, guesses.front(), result)) {
      foreseen.push_back(*std::move(question));
      guess(guesses.front());
    }
  }
  return foreseen;
}

}  // namespace tiltproof::harness
