// tiltproof search: finds the least robust flight of a scenario.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>
#include <nlohmann/json.hpp>

#include "harness/campaign/least_robust.h"
#include "harness/cli/applicability.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/scenario_comment.h"
#include "harness/cli/search_flights.h"
#include "harness/cli/search_over.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/report/files.h"
#include "harness/report/json_text.h"
#include "harness/scenario/reader.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

constexpr std::string_view kLeastRobustWords = "# The least robust of";

struct LeastRobustFlags {
  std::filesystem::path scenario;
  std::size_t runs_count = 200;
  std::vector<std::string> over;
  std::filesystem::path out;
  std::optional<std::uint64_t> seed;
  int jobs_count = 1;
  std::vector<std::string> clients;
  std::string firmware;
  std::string format = "human";
};

nlohmann::ordered_json NumberOrNull(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json();
}

nlohmann::ordered_json ValuesOf(const std::vector<SearchedNumber>& numbers, const SearchPoint& point) {
  nlohmann::ordered_json values = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i].names.empty())
      values[numbers[i].name] = ValueAt(numbers[i], point[i]);
    else
      values[numbers[i].name] = TextAt(numbers[i], point[i]);
  }
  return values;
}

std::string TextOfPlace(const SearchedNumber& number, double place) {
  return TextAt(number, place) + (number.unit.empty() || number.unit == "1" ? "" : " " + number.unit);
}

void PrintSearchFlight(const LeastRobustFlags& flags, const LeastRobustTask& task, const SearchFlight& flight,
                       bool is_least) {
  if (flags.format == "jsonl") {
    Print(stdout, "{}\n",
          JsonLine({{"flight", flight.number},
                    {"verdict", std::string(Name(flight.verdict))},
                    {"margin", NumberOrNull(flight.margin)},
                    {"least", is_least},
                    {"values", ValuesOf(task.numbers, flight.point)}}));
  } else if (is_least || flight.verdict == Verdict::kError) {
    std::string values;
    for (std::size_t i = 0; i < task.numbers.size(); ++i)
      values += "  " + TextOfPlace(task.numbers[i], flight.point[i]);
    Print(stdout, "{:>6}  {:>10}{}{}\n", flight.number,
          flight.verdict == Verdict::kError  ? "error"
          : flight.margin                    ? fmt::format("{:.4g}", *flight.margin)
          : flight.verdict == Verdict::kFail ? "failed"
                                             : "-",
          values, flight.verdict == Verdict::kError ? "  " + flight.reason : "");
  }
  std::fflush(stdout);
}

void PrintBegin(const LeastRobustTask& task) {
  Print(stdout, "{}: {} number{}, at most {} flights\n", task.job.name, task.numbers.size(),
        task.numbers.size() == 1 ? "" : "s", task.flights_count_max);
  for (const SearchedNumber& number : task.numbers) {
    std::string range;
    if (number.names.empty())
      range = fmt::format("{:g} .. {:g} {}", number.low, number.high, number.unit == "1" ? "" : number.unit);
    for (const std::string& name : number.names) range += (range.empty() ? "" : ", ") + name;
    Print(stdout, "  {:<44} {}\n", number.name, range);
  }
  Print(stdout, "flight      margin  {}\n",
        "each line is less robust than all above; the numbers in the order above");
}

struct LeastRobustFile {
  std::filesystem::path file;
  std::string replay;
};

// The least robust flight as a scenario that expects the verdict that it had.
LeastRobustFile WriteLeast(const LeastRobustFlags& flags, const LeastRobustTask& task,
                           const LeastRobust& found) {
  const SearchFlight& least = *found.least();
  Scenario scenario = AtPoint(task.job.scenario, task.numbers, least.point);
  scenario.expect = {.verdict = least.verdict, .by_firmware = {}};
  LeastRobustFile written{.file = flags.out, .replay = {}};
  written.replay = fmt::format("tiltproof run {}{}", Quoted(written.file.string()),
                               flags.clients.empty() ? "" : ClientFlagsOf(task.job.means.clients));
  const std::string heading =
      fmt::format("{} {} flights, found by tiltproof search: {}, margin {}.\n# {}\n", kLeastRobustWords,
                  found.flights.size(), Name(least.verdict),
                  least.margin ? fmt::format("{:.4g}", *least.margin) : "unknown", Plain(written.replay));
  if (written.file.has_parent_path()) std::filesystem::create_directories(written.file.parent_path());
  WriteFile(written.file, heading + WriteResolved(scenario));
  return written;
}

void PrintEnd(const LeastRobustFlags& flags, const LeastRobustTask& task, const LeastRobust& found,
              const LeastRobustFile& written) {
  const SearchFlight& least = *found.least();
  const bool failed = least.verdict == Verdict::kFail;
  if (flags.format == "jsonl") {
    Print(stdout, "{}\n",
          JsonLine({{"scenario", task.job.name},
                    {"failed", failed},
                    {"flights", found.flights.size()},
                    {"flight", least.number},
                    {"margin", NumberOrNull(least.margin)},
                    {"criterion", least.criterion},
                    {"reason", least.reason},
                    {"values", ValuesOf(task.numbers, least.point)},
                    {"guided", found.has_margins},
                    {"file", written.file.string()},
                    {"replay", written.replay}}));
    return;
  }
  PrintLine(stdout, 0,
            failed ? fmt::format("fails in flight {}: {}", least.number, least.reason)
                   : fmt::format("no failure in {} flights; the least robust is flight {}{}",
                                 found.flights.size(), least.number,
                                 least.margin ? fmt::format(", with margin {:.4g} of {}", *least.margin,
                                                            least.criterion)
                                              : ""));
  for (std::size_t i = 0; i < task.numbers.size(); ++i)
    PrintLine(stdout, 2,
              fmt::format("{}: {}", task.numbers[i].name, TextOfPlace(task.numbers[i], least.point[i])));
  PrintLine(stdout, 2, "again:");
  PrintCommand(stdout, 4, written.replay);
}

LeastRobustTask MakeSearchTask(const LeastRobustFlags& flags, const SuiteScenario& entry,
                               const FlightMeans& means) {
  LeastRobustTask task;
  task.flights_count_max = flags.runs_count;
  task.job = FlightJob{.name = entry.scenario.name,
                       .scenario = entry.scenario,
                       .model = entry.model,
                       .means = means,
                       .replay = {}};
  task.job.scenario.seed = flags.seed.value_or(entry.scenario.seed);
  for (const std::string& text : flags.over) {
    SearchedNumber number = ReadOver(text, entry.scenario, entry.model->signals());
    if (std::ranges::any_of(task.numbers,
                            [&](const SearchedNumber& other) { return other.name == number.name; }))
      throw UsageError(fmt::format("--over {}: this number is given twice", text));
    task.numbers.push_back(std::move(number));
  }
  if (flags.over.empty()) task.numbers = FaultNumbers(entry.scenario, entry.model->signals());
  if (task.numbers.empty())
    throw UsageError(fmt::format(
        "search: {} has no fault with a severity or a window: add one, or name numbers with --over",
        entry.scenario.file.string()));
  return task;
}

int SearchCommand(LeastRobustFlags flags) {
  const FlightMeans means = LockstepMeans(ReadClientFlags(flags.clients), "search");
  Suite suite = LoadOneScenario(flags.scenario, means.clients, "search", flags.firmware);
  CheckReady(means);
  RemoveNotApplicable(means, true, suite);
  const LeastRobustTask task = MakeSearchTask(flags, suite.scenarios.front(), means);
  if (flags.out.empty()) flags.out = task.job.scenario.name + "-least-robust.yaml";
  CheckOwnFile(flags.out, kLeastRobustWords);

  const InterruptScope scope;
  if (flags.format != "jsonl") PrintBegin(task);
  const LeastRobust found = FindLeastRobust(
      task, {.jobs_count = flags.jobs_count,
             .interrupted = InterruptScope::flag(),
             .tell = [](const std::string& line) { Print(stderr, "tiltproof: {}\n", line); },
             .on_flight = [&](const SearchFlight& flight,
                              bool is_least) { PrintSearchFlight(flags, task, flight, is_least); }});
  if (const SearchFlight* least = found.least()) {
    PrintEnd(flags, task, found, WriteLeast(flags, task, found));
    if (!found.has_margins)
      Print(stderr,
            "tiltproof: search: no criterion that a fault can change has a margin, only pass or fail: there "
            "was "
            "nothing to follow, and the flights were only spread. Add a formula, such as "
            "always(position_error_m <= 0.5)\n");
    if (found.interrupted) return kExitInterrupted;
    return least->verdict == Verdict::kFail ? kExitNotGreen : kExitGreen;
  }
  if (found.interrupted) return kExitInterrupted;
  Print(stderr, "tiltproof: search: no flight could be judged: {}\n", found.flights.front().reason);
  return kExitError;
}

}  // namespace

void RegisterSearch(CLI::App& program, CommandLine& line) {
  const auto flags = std::make_shared<LeastRobustFlags>();
  CLI::App* command =
      program.add_subcommand("search", "Find the least robust flight of a scenario, guided by its margin");
  command->add_option("SCENARIO", flags->scenario, "A scenario file")->required();
  command->add_option("--runs", flags->runs_count, "Flights at most; a flight that fails ends the search")
      ->check(CLI::Range(std::size_t{1}, std::size_t{1'000'000}))
      ->capture_default_str();
  command
      ->add_option(
          "--over", flags->over,
          "Search this number: KEY=A..B, or a name: KEY=V1,V2. May be repeated. KEY is "
          "a path as of run --set; faults.ID.start_s moves the window, and faults.ID.window_s is its "
          "length (default: severities and windows of all faults, up to what the scenario has)")
      ->type_name("KEY=A..B")
      ->allow_extra_args(false);
  command->add_option("--out", flags->out,
                      "The least robust flight as a scenario (default: NAME-least-robust.yaml)");
  AddSeed(*command, flags->seed, "Overrides the scenario's seed");
  AddJobs(*command, flags->jobs_count);
  AddClients(*command, flags->clients);
  AddFirmware(*command, flags->firmware);
  AddFormat(*command, flags->format, "human, or jsonl: one JSON object per flight and the result");
  SetAction(*command, line, [flags] { return SearchCommand(*flags); });
}

}  // namespace tiltproof::harness
