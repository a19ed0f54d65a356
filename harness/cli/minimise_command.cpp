#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <future>
#include <map>
#include <memory>

#include "harness/campaign/smallest_failure.h"
#include "harness/cli/applicability.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/scenario_comment.h"
#include "harness/cli/search_flights.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/engine/engine.h"
#include "harness/report/files.h"
#include "harness/scenario/diagnostic.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFirstWords = "# Minimised by tiltproof";
constexpr std::size_t kMinimalNameMax = 100;

struct MinimiseOptions {
  std::string program = "tiltproof";  // as it was called, for the commands that are printed
  fs::path path;
  fs::path out;
  std::size_t runs_max = 250;
  std::optional<std::uint64_t> seed;
  std::vector<std::string> clients;
  std::string firmware;  // as of RunOptions
  int jobs_count = 1;
};

// A flight's folder has its scenario, and the run's its clients, unless the command line names others.
void OpenFlight(MinimiseOptions& options) {
  if (!fs::is_directory(options.path)) return;
  const OldRun run = OpenRun(options.path);
  if (run.scenario_folders.size() != 1)
    throw UsageError(fmt::format("minimise: {} holds {} flights; minimise takes one: name its folder",
                                 options.path.string(), run.scenario_folders.size()));
  options.path = run.scenario_folders.front() / "scenario.resolved.yaml";
  if (!options.clients.empty()) return;
  options.clients = {run.info.client};
  for (const auto& [id, client] : run.info.clients)
    options.clients.push_back(fmt::format("{}={}", id, client));
}

// The flights of a search. It asks for one after the other; with several jobs, flights that it may ask for next fly
// beside it.
class Flights {
 public:
  Flights(const SuiteScenario& entry, FlightMeans means, FailureSearch search, int jobs_count)
      : model_(entry.model),
        means_(std::move(means)),
        search_(std::move(search)),
        jobs_count_(static_cast<std::size_t>(jobs_count)),
        engine_({.jobs_count = jobs_count,
                 .tell = [](const std::string& line) { Print(stderr, "tiltproof: {}\n", line); },
                 .interrupted = InterruptScope::flag()}) {}

  std::optional<Flown> Fly(const Scenario& candidate) {
    const std::string text = WriteResolved(candidate);
    if (!Begin(candidate, text)) {
      answers_.push_back({.criterion = {}, .activations = {}, .was_flown = false});
      return answers_.back();
    }
    if (jobs_count_ > 1 && !IsReady(begun_.at(text)))
      for (const Scenario& next : Foreseen(search_, answers_, jobs_count_ - 1))
        if (FlyingCount() < jobs_count_) Begin(next, WriteResolved(next));
    while (!IsReady(begun_.at(text)) && !engine_.idle()) engine_.Poll();
    if (*InterruptScope::flag()) return std::nullopt;
    last_ = begun_.extract(text).mapped().get();
    answers_.push_back(FlownAs(last_));
    return answers_.back();
  }

  const FlightResult& last() const { return last_; }

 private:
  using Future = std::future<FlightResult>;
  static bool IsReady(const Future& flight) {
    return flight.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  }
  std::size_t FlyingCount() const {
    return static_cast<std::size_t>(
        std::ranges::count_if(begun_, [](const auto& flight) { return !IsReady(flight.second); }));
  }

  // Flies what its file would hold, so that the file fails as it did here. False if that is not valid.
  bool Begin(const Scenario& candidate, const std::string& text) {
    if (begun_.contains(text)) return true;
    Scenario scenario;
    try {
      scenario = ReadResolvedText(text, models_);
    } catch (const ScenarioError&) {
      return false;
    }
    begun_[text] = engine_.Submit(FlightJob{.name = fmt::format("{} {}", candidate.name, ++count_),
                                            .scenario = std::move(scenario),
                                            .model = model_,
                                            .means = means_,
                                            .replay = {}});
    return true;
  }

  std::shared_ptr<const plant::VehicleModel> model_;
  FlightMeans means_;
  FailureSearch search_;
  std::size_t jobs_count_;
  ModelCache models_;
  Engine engine_;
  std::map<std::string, Future>
      begun_;  // by text; a flight that was asked for is gone, so the last one is flown again
  std::vector<Flown> answers_;
  std::size_t count_ = 0;
  FlightResult last_;
};

std::string FlightsText(std::size_t count) {
  return fmt::format("{} flight{}", count, count == 1 ? "" : "s");
}

void PrintStep(const MinimiseStep& step) {
  const bool same = step.before == step.after && step.what != "faults";
  if (same && step.runs == 0) return;  // nothing to try, or no flights left
  PrintLine(stdout, 0,
            fmt::format("{}: {} in {}", step.what,
                        same ? step.before + ", no less," : step.before + " -> " + step.after,
                        FlightsText(step.runs)));
  std::fflush(stdout);
}

std::string AtTime(const Flown& flown) {
  return flown.time_s ? fmt::format(" at {:.3f} s", *flown.time_s) : "";
}

std::string Heading(const SmallestFailure& smallest, const Scenario& given, const std::string& again) {
  std::string text = Comment(fmt::format("{} minimise from {} ({}), seed {}.", kFirstWords.substr(2),
                                         given.name, given.file.string(), given.seed));
  text += Comment(fmt::format("It fails{}: {}", AtTime(smallest.last), smallest.last.reason));
  text +=
      Comment(fmt::format("{} of {} faults are left.", smallest.scenario.faults.size(), given.faults.size()));
  if (smallest.out_of_runs) text += "# The flights ran out (--max-runs): a smaller one may exist.\n";
  if (!smallest.confirmed) text += "# The search was interrupted: a smaller one may exist.\n";
  return text + "# It fails as long as the defect is there, and passes afterwards:\n" + Comment(again);
}

// The reason that there is nothing to minimise. Returns the exit code.
int NothingToMinimise(const FlightResult& flight, const std::string& name) {
  const Verdict verdict = flight.score.verdict;
  if (verdict == Verdict::kPass)
    Print(stderr, "tiltproof: minimise: nothing to minimise: the flight '{}' does not fail\n", name);
  else
    Print(stderr, "tiltproof: minimise: nothing to minimise: the flight '{}' is {}: {}\n", name,
          verdict == Verdict::kError ? "an error" : Name(verdict), Plain(flight.score.reason));
  return verdict == Verdict::kError ? kExitError : kExitUndecided;
}

int MinimiseCommand(MinimiseOptions options) {
  OpenFlight(options);
  const FlightMeans means = LockstepMeans(ReadClientFlags(options.clients), "minimise");
  Suite suite = LoadOneScenario(options.path, means.clients, "minimise", options.firmware);
  CheckReady(means);
  RemoveNotApplicable(means, true, suite);
  const SuiteScenario& entry = suite.scenarios.front();
  Scenario given = entry.scenario;
  given.seed = options.seed.value_or(given.seed);
  Scenario named = given;
  constexpr std::string_view kEnding = "-minimal";
  named.name = given.name.substr(0, kMinimalNameMax - kEnding.size()) + std::string(kEnding);
  if (options.out.empty()) options.out = named.name + ".yaml";
  CheckOwnFile(options.out, kFirstWords);

  const InterruptScope scope;
  MinimiseFailureOptions search_options{.runs_max = options.runs_max,
                                        .has_sensor_noise = plant::HasNoise(entry.model->sensors)};
  const auto search = [&named, &entry, search_options](const Evaluate& evaluate) {
    return MinimiseFailure(named, entry.model->signals(), evaluate, search_options);
  };
  Flights flights(entry, means, search, options.jobs_count);
  search_options.on_step = PrintStep;
  SmallestFailure smallest = MinimiseFailure(
      named, entry.model->signals(), [&](const Scenario& scenario) { return flights.Fly(scenario); },
      search_options);
  if (smallest.interrupted && !smallest.fails()) {
    Print(stderr, "tiltproof: minimise: interrupted in the first flight; nothing was written\n");
    return kExitInterrupted;
  }
  if (!smallest.fails()) return NothingToMinimise(flights.last(), given.name);
  if (!smallest.interrupted && !smallest.confirmed)
    throw std::runtime_error(
        fmt::format("minimise: flown once more, the smallest scenario did not fail {}: the client does not "
                    "repeat its flights; nothing was written",
                    smallest.first.criterion));
  smallest.scenario.description =
      fmt::format("The smallest form of {} that fails {}.", given.name, smallest.first.criterion);
  const std::string again =
      fmt::format("{} run {}{}", options.program, Quoted(options.out.string()), ClientFlagsOf(means.clients));
  WriteFile(options.out, Heading(smallest, given, again) + WriteResolved(smallest.scenario));
  PrintLine(stdout, 0, fmt::format("total: {}", FlightsText(smallest.runs)));
  PrintLine(stdout, 0,
            fmt::format("{} fails{}: {}", options.out.string(), AtTime(smallest.last), smallest.last.reason));
  PrintCommand(stdout, 2, again);
  if (smallest.interrupted) return kExitInterrupted;
  if (smallest.out_of_runs)
    Print(stderr, "tiltproof: minimise: the flights ran out: --max-runs above {} may find a smaller one\n",
          options.runs_max);
  return kExitGreen;
}

}  // namespace

void RegisterMinimise(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<MinimiseOptions>();
  options->program = line.words.front();
  CLI::App* command =
      program.add_subcommand("minimise", "Find the smallest scenario that fails by the same criterion");
  command
      ->add_option("PATH", options->path, "A scenario file that fails, or the folder of a flight that failed")
      ->required();
  command->add_option("--out", options->out, "The file to write (default: NAME-minimal.yaml)");
  command->add_option("--max-runs", options->runs_max, "Flights that the search may fly")
      ->check(CLI::Range(2, 1'000'000))
      ->capture_default_str();
  AddSeed(*command, options->seed, "Overrides the scenario's seed");
  AddClients(*command, options->clients);
  AddFirmware(*command, options->firmware);
  AddJobs(*command, options->jobs_count);
  SetAction(*command, line, [options] { return MinimiseCommand(*options); });
}

}  // namespace tiltproof::harness
