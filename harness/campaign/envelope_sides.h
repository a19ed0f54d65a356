// Both sides of each margin of an envelope as scenarios: the last level that is survived, and the first that fails with
// the seed that failed. Each expects the verdict that it had. Below the envelope's folder:
//
//   levels/CLIENT/NAME.yaml    the scenario
//   flights/CLIENT/TYPE/       a run with the flights of one type, where they were kept: report.html#flight=NAME
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "harness/campaign/envelope_search.h"
#include "harness/engine/flight_job.h"

namespace tiltproof::harness {

struct EnvelopeSide {
  std::string client, type, place, side;  // as in envelope.json; place and side may be empty
  bool survives = false;

  std::string name() const;  // of its scenario and of its flight: "paper-frame.delay-both-fails"
  std::filesystem::path scenario_file() const;  // these two below the envelope's folder
  std::filesystem::path run_folder() const;
};
// Throws std::runtime_error when the entry has a name that no path can have.
EnvelopeSide SideOf(const EnvelopeEntry& entry, bool survives);

struct SideFlight {
  EnvelopeSide side;
  FlightJob job;
};

// Both sides of all margins that are known, in the order of the rows.
std::vector<SideFlight> SidesOf(const std::vector<EnvelopeSearchRow>& rows);

void WriteLevels(const std::filesystem::path& folder, const std::vector<SideFlight>& sides);

}  // namespace tiltproof::harness
