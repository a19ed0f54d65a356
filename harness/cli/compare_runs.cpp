#include "harness/cli/compare_runs.h"

#include <fmt/format.h>

#include "harness/report/json_text.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {

void RefuseUnpaired(const CompareOptions& options) {
  throw UsageError(
      fmt::format("{} and {} have no scenario of the same name", options.a.string(), options.b.string()));
}

void PrintOnlyIn(const char* letter, const std::vector<std::string>& names) {
  for (const std::string& name : names)
    Print(stdout, "{}\n", JsonLine({{"scenario", name}, {"only_in", letter}}));
}

}  // namespace tiltproof::harness
