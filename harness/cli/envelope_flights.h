// The flights on both sides of each margin of an envelope: as scenarios that fly the level again, and, where they are
// wanted, as flights that a reader can look at. Where they stand: harness/report/envelope_page.h.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "harness/campaign/margins.h"
#include "harness/cli/envelope_options.h"
#include "harness/cli/envelope_report.h"
#include "harness/report/envelope_page.h"

namespace tiltproof::harness {

struct SideFlight {
  EnvelopeSide side;
  // Its scenario has the level and the seed: the first, or the one that failed; and expects the verdict that it had.
  FlightJob job;
};

// Flights at both sides of all known margins. `tasks`: of the envelope's entries, in their order.
std::vector<SideFlight> SidesOf(const Envelope& envelope, const std::vector<MarginTask>& tasks);

void WriteLevels(const std::filesystem::path& folder, const std::vector<SideFlight>& sides);

struct KeptFlights {
  std::size_t count = 0;
  int exit = 0;  // 3: a flight is an error, or has another verdict than in the search
};
// Flies each once, and keeps it, with a report for each client and fault type.
KeptFlights KeepFlights(const std::filesystem::path& folder, const std::vector<SideFlight>& sides,
                        const EnvelopeOptions& options);

}  // namespace tiltproof::harness
