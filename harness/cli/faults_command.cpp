#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>
#include <string_view>
#include <vector>

#include "faults/registry.h"
#include "harness/cli/shared_options.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

// An empty name prints the whole catalogue.
int FaultsCommand(const std::string& name) {
  if (name.empty()) {
    Print(stdout, "{}", TextLines(faults::CatalogueMarkdown()));
    return kExitGreen;
  }
  const faults::FaultType* type = faults::FindFaultType(name);
  if (type == nullptr) {
    std::vector<std::string_view> names;
    for (const auto& known : faults::FaultTypes()) names.push_back(known.name);
    const std::string meant = DidYouMean(name, names);
    throw UsageError(fmt::format("faults: unknown fault '{}'{}", name,
                                 meant.empty() ? "; `tiltproof faults` prints them all" : meant));
  }
  Print(stdout, "{}", TextLines(faults::Markdown(*type)));
  return kExitGreen;
}

}  // namespace

void RegisterFaults(CLI::App& program, CommandLine& line) {
  const auto name = std::make_shared<std::string>();
  CLI::App* command = program.add_subcommand("faults", "Print the catalogue of faults (Markdown)");
  command->add_option("NAME", *name, "Print only this fault");
  SetAction(*command, line, [name] { return FaultsCommand(*name); });
}

}  // namespace tiltproof::harness
