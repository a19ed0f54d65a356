#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <memory>
#include <string_view>

#include "harness/campaign/causes.h"
#include "harness/campaign/no_return.h"
#include "harness/campaign/why_flights.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/report_command.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/search_flights.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/report/activations_file.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/flight_hashes.h"
#include "harness/report/why_file.h"
#include "harness/score/headline.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/progress_line.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

// Flights that look for needed faults and sets of them, at most.
constexpr std::size_t kCauseFlightsMax = 200;

struct WhyOptions {
  std::filesystem::path flight;
  std::size_t futures_count = 100;
  int jobs_count = 1;
};

// A flight that failed, and its place.
struct FailedFlight {
  OldRun run;
  std::filesystem::path folder;
  FlightJob job;
  FlightResult result;
  double first_fault_s = 0, violated_s = 0;
  std::string criterion;
};

// None: no fault acted.
std::optional<double> FirstActivation(const std::filesystem::path& folder) {
  std::optional<double> first_s;
  ReadActivations(ReadFlightFile(folder / "faults.jsonl"), ActivationBytes::kNone,
                  [&](const KeptActivation& activation) {
                    const double time_s = ToSeconds(activation.time_ns);
                    first_s = std::min(first_s.value_or(time_s), time_s);
                    return true;
                  });
  return first_s;
}

std::filesystem::path OnlyFlight(const OldRun& run, const std::filesystem::path& path) {
  if (run.scenario_folders.size() != 1)
    throw UsageError(fmt::format("why: {} is a run with {} flights: give it the folder of one flight",
                                 path.string(), run.scenario_folders.size()));
  if (!HasEnded(run.scenario_folders.front()))
    throw UsageError(fmt::format("why: {}: this flight came to no verdict", path.string()));
  return run.scenario_folders.front();
}

// Throws UsageError for a flight that has no moment of no return.
FailedFlight OpenFailed(const WhyOptions& options) {
  FailedFlight flight{.run = OpenRun(options.flight), .folder = {}, .job = {}, .result = {}, .criterion = {}};
  const std::string path = options.flight.string();
  if (flight.run.info.mode == "realtime")
    throw UsageError(
        fmt::format("why: {}: flown in real time, where no flight can be flown again to the bit; "
                    "`run` flies the scenario in lockstep",
                    path));
  flight.folder = OnlyFlight(flight.run, options.flight);
  CheckFlightFiles(flight.folder);
  flight.result = ReadVerdict(flight.folder);
  if (flight.result.score.verdict != Verdict::kFail)
    throw UsageError(fmt::format("why: {}: the verdict is {}; why explains a flight that failed", path,
                                 Name(flight.result.score.verdict)));
  const CriterionResult* criterion = FirstViolated(flight.result.score);
  if (criterion == nullptr || flight.result.trace_hash.empty())
    throw UsageError(fmt::format("why: {}: the flight left no trace: {}", path, flight.result.score.reason));
  std::vector<std::string> flags = {flight.run.info.client};
  for (const auto& [id, client] : flight.run.info.clients) flags.push_back(fmt::format("{}={}", id, client));
  auto [scenario, model] = LoadFlown(flight.folder);
  if (scenario.has_several_clients())
    throw UsageError(
        fmt::format("why: {}: several clients fly in processes of their own, which cannot be "
                    "turned aside in mid-flight: why explains flights with one client",
                    path));
  const auto first_s = FirstActivation(flight.folder);
  flight.violated_s =
      criterion->time_s ? *criterion->time_s : ToSeconds(ReadFlightRecord(flight.folder).end_ns);
  if (!first_s || *first_s > flight.violated_s)
    throw UsageError(
        fmt::format("why: {}: no fault acted before '{}' was violated: the flight fails by itself", path,
                    criterion->name));
  flight.first_fault_s = *first_s;
  flight.criterion = criterion->name;
  flight.job = {.name = flight.folder.filename(),
                .scenario = std::move(scenario),
                .model = std::move(model),
                .means = LockstepMeans(ReadClientFlags(flags), "why"),
                .replay = {}};
  return flight;
}

struct FirstViolation {
  std::string criterion;  // empty: none was violated
  std::optional<TimeNs> time_ns;
  friend bool operator==(const FirstViolation&, const FirstViolation&) = default;
};

FirstViolation FirstViolationOf(const Score& score) {
  const CriterionResult* criterion = FirstViolated(score);
  if (criterion == nullptr) return {};
  return {criterion->name, criterion->time_s ? std::optional(FromSeconds(*criterion->time_s)) : std::nullopt};
}

std::string Text(const FirstViolation& first) {
  if (first.criterion.empty()) return "none";
  return fmt::format("'{}'{}", first.criterion,
                     first.time_ns ? fmt::format(" (at {:.3f} s)", ToSeconds(*first.time_ns)) : "");
}

// The flight must be the same today. False: interrupted.
bool IsRepeated(const FailedFlight& flight) {
  Engine engine({.jobs_count = 1, .interrupted = InterruptScope::flag()});
  auto flown = engine.Submit(flight.job);
  while (!engine.idle()) engine.Poll();
  if (*InterruptScope::flag()) return false;
  const FlightResult now = flown.get();
  if (now.score.verdict == Verdict::kError) throw std::runtime_error(now.score.reason);
  if (now.trace_hash != flight.result.trace_hash)
    throw std::runtime_error(
        fmt::format("why: the flight is not the same any more: its trace had the hash {} then, and has {} "
                    "now; the program, the "
                    "firmware or a file that it flies with has changed: `run` flies it as it is today",
                    flight.result.trace_hash, now.trace_hash));
  const FirstViolation then = FirstViolationOf(flight.result.score), today = FirstViolationOf(now.score);
  if (then != today)
    throw std::runtime_error(
        fmt::format("why: the criteria in {} are not those of the verdict: the flight violated {} first, and "
                    "today {}; `score` judges it again by the file",
                    (flight.folder / "scenario.resolved.yaml").string(), Text(then), Text(today)));
  return true;
}

MomentRange RangeOf(const FailedFlight& flight) {
  MomentRange range;
  range.step_ns = flight.job.scenario.link.protocol->control_period_ns;
  const TimeNs first_ns = FromSeconds(flight.first_fault_s);
  range.begin_ns = std::max<TimeNs>(first_ns - first_ns % range.step_ns, 0);
  range.end_ns = std::max(FromSeconds(flight.violated_s), range.begin_ns);
  return range;
}

std::vector<std::string> IdsOf(const Scenario& scenario, const auto& faults) {
  std::vector<std::string> ids;
  for (const std::size_t fault : faults) ids.push_back(scenario.faults[fault].id);
  return ids;
}

void PutCauses(const Scenario& scenario, const Causes& causes, WhyFile& why) {
  why.needed = IdsOf(scenario, causes.needed);
  for (const FaultSet& set : causes.sets) why.sets.push_back(IdsOf(scenario, set));
  why.sets_complete = causes.complete;
}

std::string SetsText(const WhyFile& why) {
  if (!why.needed.empty()) return fmt::format("needed: {}", fmt::join(why.needed, ", "));
  if (why.sets.size() == 1 && why.sets.front().empty()) return "needed: none, it fails without any fault";
  std::vector<std::string> sets;
  for (const auto& set : why.sets) sets.push_back(fmt::format("{}", fmt::join(set, " with ")));
  return fmt::format("needed: none alone; each of these suffices{}: {}",
                     why.sets_complete ? "" : " (there may be more)", fmt::join(sets, "; "));
}

void PrintWhy(const FailedFlight& flight, const WhyFile& why) {
  PrintLine(stdout, 0,
            fmt::format("{}: {} violated at {:.3f} s, first fault at {:.3f} s", flight.job.name,
                        why.criterion, why.violated_s, why.first_fault_s));
  for (const WhyPoint& point : why.curve)
    PrintLine(stdout, 2,
              fmt::format(
                  "faults end at {:>8.3f} s: {:>5.1f} % fail{}", point.time_s, 100 * point.probability,
                  point.low == point.high ? ""
                                          : fmt::format(" ({:.1f} to {:.1f} %, {} futures)", 100 * point.low,
                                                        100 * point.high, point.futures_count)));
  PrintLine(stdout, 0,
            why.last_chance_s ? fmt::format("last chance:        {:.3f} s", *why.last_chance_s)
                              : "last chance:        none; it was lost when the first fault acted");
  PrintLine(stdout, 0,
            why.point_of_no_return_s ? fmt::format("point of no return: {:.3f} s", *why.point_of_no_return_s)
                                     : "point of no return: none before the violation");
  PrintLine(stdout, 0, SetsText(why));
}

int WhyCommand(const WhyOptions& options) {
  const FailedFlight flight = OpenFailed(options);
  CheckReady(flight.job.means);
  const InterruptScope scope;
  if (!IsRepeated(flight)) return kExitInterrupted;
  ProgressLine line(true);
  WhyFlights flights(
      flight.job, flight.criterion,
      {.jobs_count = options.jobs_count,
       .futures_count = options.futures_count,
       .interrupted = InterruptScope::flag(),
       .tell =
           [&line](const std::string& text) {
             line.Clear();
             Print(stderr, "tiltproof: {}\n", text);
           },
       .on_turn = [&line](std::size_t count) { line.Show(fmt::format("{} flights", count)); }});
  WhyFile why;
  why.trace_hash = flight.result.trace_hash;
  why.criterion = flight.criterion;
  why.first_fault_s = flight.first_fault_s;
  why.violated_s = flight.violated_s;
  why.futures_count = options.futures_count;
  NoReturn found = FindNoReturn(RangeOf(flight),
                                [&](const std::vector<TimeNs>& moments) { return flights.Futures(moments); });
  why.curve = std::move(found.curve);
  why.last_chance_s = found.last_chance_s;
  why.point_of_no_return_s = found.point_of_no_return_s;
  FaultSet all;
  for (std::size_t fault = 0; fault < flight.job.scenario.faults.size(); ++fault) all.insert(fault);
  const auto fails_with = [&](const std::vector<FaultSet>& sets) { return flights.FailsWith(sets); };
  PutCauses(flight.job.scenario, FindCauses(all, fails_with, kCauseFlightsMax), why);
  line.Clear();
  if (*InterruptScope::flag()) return kExitInterrupted;
  why.flights_count = flights.flights_count();
  WriteWhy(flight.folder, why);
  PrintWhy(flight, why);
  PrintLine(stdout, 0,
            fmt::format("{} flights; {}", why.flights_count, (flight.folder / "why.json").string()));
  if (std::filesystem::exists(flight.run.folder / "report.html"))
    if (const auto report = WriteReport(flight.run.folder)) Print(stdout, "report: {}\n", report->string());
  return kExitGreen;
}

}  // namespace

void RegisterWhy(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<WhyOptions>();
  CLI::App* command = program.add_subcommand(
      "why", "Find the moment at which a flight that failed was lost, and by which faults");
  command
      ->add_option("FLIGHT", options->flight, "The folder of a flight that failed, in a run's results folder")
      ->required();
  command
      ->add_option("--futures", options->futures_count, "Futures of each moment, where something is random")
      ->check(CLI::Range(std::size_t{1}, std::size_t{100'000}));
  AddJobs(*command, options->jobs_count);
  SetAction(*command, line, [options] { return WhyCommand(*options); });
}

}  // namespace tiltproof::harness
