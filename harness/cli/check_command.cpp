#include <fmt/format.h>

#include "faults/registry.h"
#include "harness/cli/commands.h"
#include "harness/cli/suite.h"
#include "harness/scenario/schema.h"

namespace tiltproof::harness {
namespace {

void PrintWarnings(const Suite& suite) {
  for (const auto& warning : suite.warnings) fmt::print(stderr, "warning: {}\n", warning);
}

}  // namespace

int CheckCommand(const CheckOptions& options) {
  const Suite suite = LoadSuite(options.paths);
  PrintWarnings(suite);
  fmt::print("{} scenario{} in order\n", suite.scenarios.size(), suite.scenarios.size() == 1 ? "" : "s");
  return suite.scenarios.empty() ? kExitUndecided : kExitGreen;
}

int ListCommand(const CheckOptions& options) {
  const Suite suite = LoadSuite(options.paths);
  for (const auto& [scenario, model] : suite.scenarios) {
    std::string faults;
    for (const auto& fault : scenario.faults) faults += (faults.empty() ? "" : ", ") + fault.type;
    fmt::print("{:<34} {:>5.0f} s  {:<14} {:<16} expect {:<5} [{}]{}{}\n", scenario.name,
               ToSeconds(scenario.duration_ns), scenario.model, scenario.firmware, Name(scenario.expect),
               fmt::join(scenario.tags, ", "), faults.empty() ? "" : "  ", faults);
  }
  return suite.scenarios.empty() ? kExitUndecided : kExitGreen;
}

int SchemaCommand() {
  fmt::print("{}\n", ScenarioJsonSchema());
  return kExitGreen;
}

int FaultsCommand() {
  fmt::print("{}", faults::CatalogueMarkdown());
  return kExitGreen;
}

}  // namespace tiltproof::harness
