// Runs of a campaign that are flown once more, for their files: each in a folder that is a run of its own, so that
// `report`, `replay` and `compare` read it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "harness/cli/campaign_plan.h"
#include "harness/engine/flight_result.h"

namespace tiltproof::harness {

// A scenario, and the folder that gets its flight.
struct FlightToKeep {
  std::filesystem::path folder;
  FlightJob job;
};

struct KeptRuns {
  std::vector<FlightResult> results;  // in the order of the flights; those not flown are missing
  bool interrupted = false;
};

// Replaces flights of the same names. Also writes the run's files into each folder, the scenario where there is none, and a
// report, if the options want it.
KeptRuns KeepRuns(std::vector<FlightToKeep> flights, const CampaignOptions& options);

// The run's number as the name of its flight: "run-17".
std::string RunName(std::uint64_t number);

}  // namespace tiltproof::harness
