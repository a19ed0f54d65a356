#include "harness/report/outcomes.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "harness/report/trace_file.h"

namespace tiltproof::harness {
namespace {

constexpr const char* kWrongOutput = "wrong_output";
constexpr const char* kMasked = "masked";

bool SameValue(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

bool SameCommands(const Trace& a, const Trace& b) {
  if (a.row_count() != b.row_count()) return false;
  for (std::size_t c = 0; c < a.columns().size(); ++c) {
    if (!a.columns()[c].starts_with("commanded_")) continue;
    const auto in_b = b.Find(a.columns()[c]);
    if (!in_b)
      throw std::runtime_error(fmt::format("the reference is another vehicle's: it has {}", a.columns()[c]));
    for (std::size_t r = 0; r < a.row_count(); ++r)
      if (!SameValue(a.at(r, c), b.at(r, *in_b))) return false;
  }
  return true;
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
  return SameCommands(trace_, ReadTrace(flight_folder)) ? kMasked : kWrongOutput;
}

}  // namespace tiltproof::harness
