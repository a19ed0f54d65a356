// Compares a campaign's flights with one flight without faults: the outcome of each.
//
//   const OutcomeReference golden(golden_folder);
//   golden.OutcomeOf(result, folder);   // "masked"
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "harness/engine/flight_result.h"
#include "harness/run/trace.h"

namespace tiltproof::harness {

// In this order: those of Outcome (harness/score/outcome.h) up to detected, and instead of the others
// wrong_output (the firmware commanded other inputs than in the reference, and nothing noticed) and masked
// (it commanded the same in every row).
const std::vector<std::string>& OutcomeNames();

class OutcomeReference {
 public:
  // Throws std::exception naming the file that cannot be read.
  explicit OutcomeReference(const std::filesystem::path& flight_folder);

  // The outcome of a flight with its folder. Throws std::exception naming the file that cannot be read.
  std::string OutcomeOf(const FlightResult& result, const std::filesystem::path& flight_folder) const;

 private:
  Trace trace_;
};

}  // namespace tiltproof::harness
