#include <CLI/CLI.hpp>
#include <algorithm>

#include "faults/registry.h"
#include "harness/cli/command_table.h"
#include "harness/cli/manual.h"
#include "harness/cli/shared_options.h"
#include "harness/report/files.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// The argument of `tiltproof faults` may be the name of any fault.
void OfferFaults(CommandRow& program) {
  const auto command_of_faults =
      std::find_if(program.commands.begin(), program.commands.end(),
                   [](const CommandRow& command) { return command.name == "faults"; });
  tiltproof::Check(command_of_faults != program.commands.end(),
                   "there is a command for the catalogue of faults");
  for (OptionRow& option : command_of_faults->options)
    if (option.positional)
      for (const faults::FaultType& type : faults::FaultTypes()) option.offered.emplace_back(type.name);
}

// Writes the manual pages of the program and of its commands, and completion for shells, into the folder. `date` is that of
// the pages, YYYY-MM-DD.
int ManualCommand(const CommandRow& program, const std::filesystem::path& folder, const std::string& date) {
  std::map<std::string, std::string> files = ManualPages(program, date);
  CommandRow offered = program;
  OfferFaults(offered);
  files[program.name + ".bash"] = BashCompletion(offered);
  files["_" + program.name] = ZshCompletion(offered);
  std::filesystem::create_directories(folder);
  for (const auto& [name, text] : files) WriteFile(folder / name, text);
  return kExitGreen;
}

}  // namespace

void RegisterManual(CLI::App& program, CommandLine& line) {
  const auto folder = std::make_shared<std::filesystem::path>();
  const auto date = std::make_shared<std::string>();
  // Called by the build.
  CLI::App* command = program.add_subcommand("manual", "Write manual pages and completion")->group("");
  command->add_option("DIR", *folder, "The folder")->required();
  command->add_option("DATE", *date, "Date of the pages")->required();
  SetAction(*command, line,
            [folder, date, &program] { return ManualCommand(TableOf(program), *folder, *date); });
}

}  // namespace tiltproof::harness
