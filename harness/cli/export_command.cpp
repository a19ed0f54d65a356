#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>
#include "harness/cli/report_command.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/export/flight_csv.h"
#include "harness/export/flight_mcap.h"
#include "harness/report/files.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

struct ExportOptions {
  std::filesystem::path run;  // folder of a run, or of a flight
  std::string to;             // "mcap" or "csv"
  std::filesystem::path out;  // empty: in the folder of each flight
};

namespace fs = std::filesystem;

// Where the export of a flight goes: a file, or for tables a folder.
fs::path OutputOf(const ExportOptions& options, const fs::path& flight, bool one_flight) {
  const bool mcap = options.to == "mcap";
  if (options.out.empty()) return flight / (mcap ? "flight.mcap" : "csv");
  const fs::path named = options.out / (flight.filename().string() + (mcap ? ".mcap" : ""));
  if (!one_flight) return named;
  return mcap && fs::is_directory(options.out) ? named : options.out;
}

// A device or a pipe is there, and may be written to.
bool IsTaken(const fs::path& output) {
  if (fs::is_directory(output)) return !fs::is_empty(output);
  return fs::is_regular_file(output);
}

// The id of a flight on the bus; a flight that was not there is named by run and flight.
std::string RunIdOf(const OldRun& run, const fs::path& flight) {
  for (const PlannedFlight& planned : run.info.flights)
    if (planned.name == flight.filename() && planned.bus) return planned.bus->run_id;
  return fmt::format("{}/{}", run.folder.filename().string(), flight.filename().string())
      .substr(0, dds::kIdBytesMax);
}

std::optional<VehicleShape> VehicleOf(const fs::path& flight) {
  try {
    return ShapeOf(*LoadFlown(flight).model);
  } catch (const std::exception& error) {
    Print(stderr, "warning: {}\nwarning: the export of {} shows the vehicle's axes, not its shape\n",
          error.what(), flight.filename().string());
    return std::nullopt;
  }
}

void ExportFlight(const OldRun& run, const fs::path& flight_folder, const std::string& to,
                  const fs::path& output) {
  const RecordedFlight flight = ReadRecordedFlight(flight_folder, RunIdOf(run, flight_folder));
  if (!flight.trouble.empty())
    Print(stderr, "warning: {}; the export has the rows before it\n", flight.trouble);
  if (to == "csv") {
    WriteCsvTables(flight, output);
    return;
  }
  if (output.has_parent_path()) fs::create_directories(output.parent_path());
  NewFile file(output);
  WriteMcap(flight, VehicleOf(flight_folder),
            run.info.mode == "realtime" ? McapTypes::kIdl : McapTypes::kJson,
            [&file](std::string_view bytes) { file.Write(bytes); });
  file.Finish();
}

// 0 when every flight with a folder was exported, else 3.
int ExportCommand(const ExportOptions& options) {
  const OldRun run = OpenRun(options.run);
  if (run.scenario_folders.empty())
    throw UsageError(fmt::format("{}: no flight of this run left a folder (--keep {})", options.run.string(),
                                 Name(run.info.keep)));
  const bool one_flight = run.scenario_folders.size() == 1;
  if (!one_flight && fs::exists(options.out) && !fs::is_directory(options.out))
    throw UsageError(fmt::format("--out {}: {} flights need a folder, and this is none", options.out.string(),
                                 run.scenario_folders.size()));
  for (const fs::path& flight : run.scenario_folders)
    if (const fs::path output = OutputOf(options, flight, one_flight); IsTaken(output))
      throw UsageError(
          fmt::format("{} is there already: remove it, or choose another place with --out", output.string()));
  int code = kExitGreen;
  for (const fs::path& flight : run.scenario_folders) {
    const fs::path output = OutputOf(options, flight, one_flight);
    try {
      ExportFlight(run, flight, options.to, output);
      Print(stdout, "{}\n", output.string());
    } catch (const std::exception& error) {
      // The others can be exported all the same.
      Print(stderr, "tiltproof: {}: {}\n", flight.filename().string(), error.what());
      code = kExitError;
    }
  }
  return code;
}

}  // namespace

void RegisterExport(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<ExportOptions>();
  CLI::App* command = program.add_subcommand("export", "Write flights as files of other tools: MCAP, or CSV");
  command->add_option("RUN", options->run, "A run's results folder, or one scenario's folder in it")
      ->required();
  command
      ->add_option("--to", options->to,
                   "mcap (Foxglove, PlotJuggler), or csv: tables (pandas, MATLAB), one file each")
      ->required()
      ->check(CLI::IsMember({"mcap", "csv"}));
  command->add_option("--out", options->out,
                      "Of one flight: the .mcap file, or the folder of its tables; of several: the folder "
                      "that they go in, by name "
                      "(default: flight.mcap, or csv/, in each flight's folder)");
  command->footer("What is in the files: docs/logs.md. Nothing is written over: remove old exports first.");
  SetAction(*command, line, [options] { return ExportCommand(*options); });
}

}  // namespace tiltproof::harness
