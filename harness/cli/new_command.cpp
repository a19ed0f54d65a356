// Files for editors: the schema of scenario files, and a scenario to start with.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>
#include <string_view>

#include "harness/cli/data_files.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/report/files.h"
#include "harness/scenario/reader.h"
#include "harness/scenario/schema.h"
#include "harness/score/metrics.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

// Beside the scenarios, or above them: a path on this machine would be nowhere for who else works on them.
constexpr std::string_view kSchemaFile = "tiltproof.schema.json";

constexpr std::string_view kFirstScenario = R"yaml(# yaml-language-server: $schema={schema}
#
# A scenario: what is flown, over which line, with which faults, and what counts as success.
#
#   tiltproof check FILE    reports every mistake in it
#   tiltproof run FILE      flies it, and writes results/latest/report.html
#
# The first line is for editors: with a YAML language server they complete keys, types of faults and their
# parameters, explain them, and underline mistakes.

name: {name}    # unique within a run; names the folder of its results
description: The vehicle hovers while every tenth reply of its sensors is lost.
firmware: paper    # a build of the shipped firmware: paper or tolerant; with --client a word of your own
seed: 1            # all random draws follow from it
duration_s: 12

# Where to. Other types: line, waypoints, circle, eight, spiral, recorded.
reference:
  type: hover
  at_m: [0, 0, 2]

# Faults and their windows. `tiltproof faults` prints all types.
faults:
  - id: lost-replies
    type: frame.drop
    target: to_client      # towards the firmware; to_plant: from it
    start_s: 4
    end_s: 8
    every_nth_count: 10    # of the frames in this window, each tenth ...
    parameters:
      probability: 1       # ... is lost for sure

# Criteria of success: formulas over the trace, and metrics with bounds.
criteria:
  - name: stays-near
    stl: "always[2,12](position_error_m <= 0.5)"
  - name: upright
    stl: "always(tilt_rad <= 0.6)"
  - name: small-error
    metric: tracking.rmse_m
    max: 0.3
)yaml";

std::string SchemaText() {
  ModelCache models;
  const auto model = models.Load(ResolveModel(Scenario().model), false);
  return ScenarioJsonSchema(MetricNames(), model->signals()) + '\n';
}

// The scenario that is named like its file.
std::string ScenarioText(const fs::path& file, const std::string& schema) {
  ReadOptions options;
  options.models_folder = ModelsFolder();
  const std::string name = file.stem();
  std::string why;
  // A name like 10 or yes is text only in quotes.
  for (const std::string& written : {name, fmt::format("\"{}\"", name)}) {
    std::string text(kFirstScenario);
    const auto fill = [&text](std::string_view hole, const std::string& with) {
      text.replace(text.find(hole), hole.size(), with);
    };
    fill("{schema}", schema);
    fill("{name}", written);
    try {
      ParseScenario(text, file, options);
      return text;
    } catch (const ScenarioError& error) {
      why = error.diagnostics().front().message;
    }
  }
  throw UsageError(fmt::format("{}: the scenario would be named like its file: {}", file.string(), why));
}

// A schema that is there already: in this folder, or in one above it in the same repository.
fs::path FindSchema(const fs::path& folder) {
  std::error_code error;
  fs::path found;
  for (fs::path at = fs::absolute(folder).lexically_normal(); at != at.parent_path(); at = at.parent_path()) {
    if (found.empty() && fs::exists(at / kSchemaFile, error)) found = at / kSchemaFile;
    if (fs::exists(at / ".git", error)) return found;
  }
  return fs::exists(folder / kSchemaFile, error) ? folder / kSchemaFile : fs::path();
}

int SchemaCommand() {
  Print(stdout, "{}", TextLines(SchemaText()));
  return kExitGreen;
}

int NewCommand(const fs::path& file) {
  const std::string path = file.string();
  if (file.extension() != ".yaml" && file.extension() != ".yml")
    throw UsageError(fmt::format("{}: a scenario's file ends in .yaml", path));
  std::error_code error;
  if (fs::exists(fs::symlink_status(file, error)))
    throw UsageError(fmt::format("{}: is there already; nothing was changed", path));
  const fs::path folder = file.has_parent_path() ? file.parent_path() : ".";
  if (!fs::is_directory(folder, error))
    throw UsageError(fmt::format("{}: there is no folder {}; make it first", path, folder.string()));
  const std::string schema = SchemaText();
  const fs::path found = FindSchema(folder);
  const fs::path used = found.empty() ? file.parent_path() / kSchemaFile : found;
  const fs::path from = fs::absolute(folder).lexically_normal();
  const std::string relative = fs::absolute(used).lexically_normal().lexically_relative(from);
  const std::string text = ScenarioText(file, relative);
  if (found.empty()) WriteNewFile(used, schema);
  WriteNewFile(file, text);
  Print(stdout, "wrote {}{}\n", path,
        found.empty() ? fmt::format(", and {} for editors", used.string()) : "");
  if (!found.empty() && ReadFile(found) != schema)
    Print(stdout, "{} is of another version: tiltproof schema > {}\n", found.string(), found.string());
  return kExitGreen;
}

}  // namespace

void RegisterNew(CLI::App& program, CommandLine& line) {
  const auto file = std::make_shared<fs::path>();
  CLI::App* command = program.add_subcommand(
      "new", "Write a commented scenario to begin with, and beside it the schema that editors use");
  command->add_option("FILE", *file, "The scenario to be written, NAME.yaml")->required();
  SetAction(*command, line, [file] { return NewCommand(*file); });
  SetAction(*program.add_subcommand("schema", "Print the JSON Schema of scenario files, for editors"), line,
            SchemaCommand);
}

}  // namespace tiltproof::harness
