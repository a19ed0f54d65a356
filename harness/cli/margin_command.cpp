#include <fmt/format.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>

#include "faults/registry.h"
#include "harness/campaign/margins.h"
#include "harness/cli/applicability.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/search_flights.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/stated_computing.h"
#include "harness/cli/suite.h"
#include "harness/report/json_fields.h"
#include "harness/report/json_text.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/fault_support.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

struct MarginOptions : SearchOptions {
  std::filesystem::path scenario;
  std::string fault;  // its id
  std::string parameter;
  std::optional<double> low, high;
  std::vector<std::string> clients;
  std::string firmware;  // as of RunOptions
  std::string format = "human";
};

std::size_t FindFault(const Scenario& scenario, const std::string& id) {
  std::vector<std::string_view> ids;
  for (std::size_t i = 0; i < scenario.faults.size(); ++i) {
    if (scenario.faults[i].id == id) return i;
    ids.push_back(scenario.faults[i].id);
  }
  throw UsageError(fmt::format("--fault {}: {} has no such fault{}", id, scenario.file.string(),
                               ids.empty() ? "; it has none at all" : DidYouMean(id, ids)));
}

MarginTask MakeTask(const MarginOptions& options, const SuiteScenario& entry, const FlightMeans& means) {
  MarginTask task;
  task.job = FlightJob{.name = entry.scenario.name,
                       .scenario = entry.scenario,
                       .model = entry.model,
                       .means = means,
                       .replay = {}};
  task.job.scenario.seed = FirstSeed(options.seed, entry.scenario, options.repeat_count);
  task.fault = FindFault(entry.scenario, options.fault);
  try {
    task.severity = SeverityOf(entry.scenario, task.fault, entry.model->signals(),
                               {options.parameter, options.low, options.high});
    CheckLevels(task);
  } catch (const SeverityMistake& mistake) {
    throw UsageError(fmt::format("margin --fault {}: {}", options.fault, mistake.what()));
  }
  return task;
}

nlohmann::ordered_json Number(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json();
}

void PrintLevel(const MarginOptions& options, const MarginTask& task, double level,
                const TrialResult& result) {
  const bool survived = result.answer == TrialResult::Answer::kSurvived;
  if (options.format == "jsonl") {
    nlohmann::ordered_json line = {{"level", level}, {"survived", survived}, {"runs", result.flights_count}};
    if (!survived) {
      line["seed"] = result.seed;
      line["first_criterion"] = result.criterion;
      line["reason"] = result.reason;
    }
    Print(stdout, "{}\n", JsonLine(line));
  } else {
    const std::string row = fmt::format("{:<9} {:>12} {:<8}", survived ? "survived" : "failed",
                                        fmt::format("{}", level), task.severity.unit);
    const std::string why = survived ? "" : fmt::format("seed {}: {}", result.seed, Plain(result.reason));
    // On a terminal the reason has lines of its own.
    if (IsTerminal(stdout) && !survived) {
      Print(stdout, "{}\n", row);
      PrintLine(stdout, 10, why);
    } else {
      Print(stdout, "{} {}\n", row, why);
    }
  }
  std::fflush(stdout);
}

std::size_t CountSurvived(const Margin& margin) {
  const auto fails = [](const LevelAnswer& answer) { return answer.survived != true; };
  return static_cast<std::size_t>(std::find_if(margin.levels.begin(), margin.levels.end(), fails) -
                                  margin.levels.begin());
}

// The survived levels below the limit at which the fault never acted; empty: it acted at all but the harmless one.
std::string IdleText(const Margin& margin, const std::function<std::string(double)>& value) {
  const std::size_t survived = CountSurvived(margin);
  std::size_t idle = 0, last = 0;
  for (std::size_t i = 0; i < survived; ++i)
    if (std::ranges::count(margin.idle_levels, margin.levels[i].level) > 0) {
      ++idle;
      last = i;
    }
  if (idle == 0 || last == 0) return "";
  return fmt::format("the fault never acted at {} of these levels, the last of which is {}", idle,
                     value(margin.levels[last].level));
}

// For a margin that is known. `unit` may be empty.
std::vector<std::string> ScanLines(const Margin& margin, int repeat_count, const std::string& unit) {
  const auto value = [&](double level) {
    return unit.empty() ? fmt::format("{}", level) : fmt::format("{} {}", level, unit);
  };
  std::vector<std::string> lines;
  for (const Pocket& pocket : margin.pockets) {
    const auto beyond = std::find_if(margin.levels.begin(), margin.levels.end(),
                                     [&](const auto& answer) { return answer.level == pocket.to; });
    const auto again =
        std::find_if(beyond, margin.levels.end(), [](const auto& answer) { return answer.survived == true; });
    const std::string where = pocket.from == pocket.to ? fmt::format("at {}", value(pocket.from))
                                                       : fmt::format("at every level flown from {} to {}",
                                                                     value(pocket.from), value(pocket.to));
    lines.push_back(fmt::format("fails {}, and survives {} again", where, value(again->level)));
  }
  if (const std::size_t count = CountSurvived(margin); count > 0)
    lines.push_back(fmt::format(
        "survives all {} levels that were flown below the limit, {}", count,
        margin.is_random
            ? fmt::format("{0} of {0} seeds each: 95 % sure that at least {1:.0f} % of all seeds pass",
                          repeat_count, 100 * SurePassShare(repeat_count))
            : "where nothing is drawn at random"));
  if (const std::string idle = IdleText(margin, value); !idle.empty()) lines.push_back(idle);
  if (margin.survived_share)
    lines.push_back(fmt::format("survives {:.3g} % of the range", 100 * *margin.survived_share));
  lines.push_back(fmt::format("{} flight{} at {} level{}", margin.flights_count,
                              margin.flights_count == 1 ? "" : "s", margin.levels.size(),
                              margin.levels.size() == 1 ? "" : "s"));
  return lines;
}

void PrintMargin(const MarginOptions& options, const MarginTask& task, const Margin& margin) {
  const faults::FaultSpec& fault = task.job.scenario.faults[task.fault];
  if (options.format == "jsonl") {
    nlohmann::ordered_json line = {{"fault", fault.id},
                                   {"type", fault.type},
                                   {"parameter", task.severity.parameter},
                                   {"unit", task.severity.unit},
                                   {"survives", Number(margin.survives)},
                                   {"fails", Number(margin.fails)},
                                   {"first_criterion", nullptr},
                                   {"runs", margin.flights_count}};
    JsonWriter::PutFields(line, ScanOf(margin, options.repeat_count));
    if (margin.fails) {
      line["first_criterion"] = margin.at_fails.criterion;
      line["time_s"] = Number(margin.at_fails.time_s);
      line["seed"] = margin.at_fails.seed;
      line["reason"] = margin.at_fails.reason;
    }
    Print(stdout, "{}\n", JsonLine(line));
    return;
  }
  const auto value = [&](double level) {
    return task.severity.unit.empty() ? fmt::format("{}", level)
                                      : fmt::format("{} {}", level, task.severity.unit);
  };
  PrintLine(stdout, 0,
            fmt::format("{}, {} ({}): {}", fault.id, task.severity.parameter, fault.type,
                        !margin.survives ? fmt::format("fails even at {}", value(*margin.fails))
                        : !margin.fails  ? fmt::format("survives even {}", value(*margin.survives))
                                         : fmt::format("survives {}, fails at {}", value(*margin.survives),
                                                       value(*margin.fails))));
  if (margin.fails)
    PrintLine(stdout, 2,
              fmt::format("at {} with seed {}: {}", value(*margin.fails), margin.at_fails.seed,
                          margin.at_fails.reason));
  for (const std::string& text : ScanLines(margin, options.repeat_count, task.severity.unit))
    PrintLine(stdout, 2, text);
}

int MarginCommand(const MarginOptions& options) {
  const FlightMeans means = LockstepMeans(ReadClientFlags(options.clients), "margin");
  Suite suite = LoadOneScenario(options.scenario, means.clients, "margin", options.firmware);
  CheckReady(means);
  RemoveNotApplicable(means, true, suite);
  const std::vector<MarginTask> tasks = {MakeTask(options, suite.scenarios.front(), means)};

  const InterruptScope scope;
  const faults::FaultSpec& fault = tasks.front().job.scenario.faults[tasks.front().fault];
  if (faults::FindFaultType(fault.type)->needs == faults::Needs::kComputing)
    if (const std::string why = WhyNoComputing(means, suite.scenarios.front()); !why.empty())
      throw UsageError(
          fmt::format("{} {}", FaultPlace(tasks.front().job.scenario, tasks.front().fault), why));
  Trials trials({.jobs_count = options.jobs_count,
                 .interrupted = InterruptScope::flag(),
                 .tell = [](const std::string& line) { Print(stderr, "tiltproof: {}\n", line); }},
                options.repeat_count);
  const auto margin = FindMargins(trials, tasks,
                                  {.tolerance = options.tolerance,
                                   .on_level =
                                       [&](const MarginTask& task, double level, const TrialResult& result) {
                                         if (result.answer != TrialResult::Answer::kUnknown)
                                           PrintLevel(options, task, level, result);
                                       }})
                          .front();
  if (!margin) {
    Print(stderr, "tiltproof: margin: interrupted, and no margin is known; flights: {}\n",
          trials.flown_count());
    return kExitInterrupted;
  }
  if (margin->unknown) {
    Print(stderr, "tiltproof: margin: no margin: {}\n", WhyUnknown(*margin->unknown));
    return UnknownExit(*margin->unknown);
  }
  if (margin->never_acted()) {
    Print(stderr, "tiltproof: margin: no margin: fault '{}': {}\n", fault.id, WhyNeverActed(*margin));
    return kExitUndecided;
  }
  PrintMargin(options, tasks.front(), *margin);
  return kExitGreen;
}

}  // namespace

void RegisterMargin(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<MarginOptions>();
  CLI::App* command =
      program.add_subcommand("margin", "Find the largest severity of a fault that a scenario survives");
  command->add_option("SCENARIO", options->scenario, "A scenario file")->required();
  command->add_option("--fault", options->fault, "The id of the fault")->required();
  command->add_option("--parameter", options->parameter,
                      "The number that is changed (default: the type's severity, or window_s, the length "
                      "of its window)");
  command->add_option("--low", options->low, "Search only above this value");
  command->add_option("--high", options->high, "Search only below this value");
  AddSearch(*command, *options);
  AddClients(*command, options->clients);
  AddFirmware(*command, options->firmware);
  AddFormat(*command, options->format, "human, or jsonl: one JSON object per level and the margin");
  SetAction(*command, line, [options] { return MarginCommand(*options); });
}

}  // namespace tiltproof::harness
