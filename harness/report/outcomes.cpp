#include "harness/report/outcomes.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "harness/report/difference.h"
#include "harness/report/trace_file.h"

namespace tiltproof::harness {
namespace {

constexpr const char* kWrongOutput = "wrong_output";
constexpr const char* kMasked = "masked";

bool IsCommand(const std::string& column) { return column.starts_with("commanded_"); }

bool SameCommands(const TraceDifference& difference) {
  if (!difference.same_rows()) return false;
  for (const std::string& column : difference.columns_of_a)
    if (IsCommand(column))
      throw std::runtime_error(fmt::format("the reference is another vehicle's: it has {}", column));
  return std::all_of(
      difference.columns.begin(), difference.columns.end(),
      [](const ColumnDifference& column) { return !IsCommand(column.column) || column.equal; });
}

}  // namespace

const std::vector<std::string>& OutcomeNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Outcome outcome :
         {Outcome::kError, Outcome::kCrashed, Outcome::kHung, Outcome::kFailed, Outcome::kDetected})
      all.emplace_back(Name(outcome));
    all.insert(all.end(), {kWrongOutput, kMasked});
    return all;
  }();
  return names;
}

OutcomeReference::OutcomeReference(const std::filesystem::path& flight_folder)
    : trace_(ReadTrace(flight_folder)) {}

std::string OutcomeReference::OutcomeOf(const FlightResult& result,
                                        const std::filesystem::path& flight_folder) const {
  if (!result.outcome) throw std::runtime_error("written by an older version, and left no flight");
  if (result.end_reason == EndReason::kInterrupted) throw std::runtime_error("interrupted");
  if (*result.outcome != Outcome::kDegraded && *result.outcome != Outcome::kUnaffected)
    return std::string(Name(*result.outcome));
  return SameCommands(CompareTraces(trace_, ReadTrace(flight_folder), 0.0)) ? kMasked : kWrongOutput;
}

}  // namespace tiltproof::harness
