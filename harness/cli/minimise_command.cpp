#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <future>
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

// The flights of a search, one after the other.
class Flights {
 public:
  Flights(const SuiteScenario& entry, FlightMeans means)
      : model_(entry.model),
        means_(std::move(means)),
        engine_({.tell = [](const std::string& line) { Print(stderr, "tiltproof: {}\n", line); },
                 .interrupted = InterruptScope::flag()}) {}

  // Flies what its file would hold, so that the file fails as it did here.
  std::optional<Flown> Fly(const Scenario& candidate) {
    Scenario scenario;
    try {
      scenario = ReadResolvedText(WriteResolved(candidate), models_);
    } catch (const ScenarioError&) {
      return Flown{.criterion = {}, .activations = {}, .was_flown = false};
    }
    std::future<FlightResult> flown =
        engine_.Submit(FlightJob{.name = fmt::format("{} {}", candidate.name, ++count_),
                                 .scenario = std::move(scenario),
                                 .model = model_,
                                 .means = means_,
                                 .replay = {}});
    while (!engine_.idle()) engine_.Poll();
    if (*InterruptScope::flag()) return std::nullopt;
    last_ = flown.get();
    return FlownAs(last_);
  }

  const FlightResult& last() const { return last_; }

 private:
  std::shared_ptr<const plant::VehicleModel> model_;
  FlightMeans means_;
  ModelCache models_;
  Engine engine_;
  std::size_t count_ = 0;
  FlightResult last_;
};

std::string FlightsText(std::size_t count) {
  return fmt::format("{} flight{}", count, count == 1 ? "" : "s");
}

void PrintStep(const MinimiseStep& step) {
  const bool same = step.before == step.after && step.what != "faults";
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
  Flights flights(entry, means);
  SmallestFailure smallest = MinimiseFailure(named, entry.model->signals(),
                                             [&](const Scenario& scenario) { return flights.Fly(scenario); },
                                             {.runs_max = options.runs_max,
                                              .has_sensor_noise = plant::HasNoise(entry.model->sensors),
                                              .on_step = PrintStep});
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
  SetAction(*command, line, [options] { return MinimiseCommand(*options); });
}

}  // namespace tiltproof::harness
