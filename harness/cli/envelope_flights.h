// Flights on both sides of each margin of an envelope, for a reader who looks at them.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "harness/campaign/envelope_sides.h"
#include "harness/cli/envelope_options.h"

namespace tiltproof::harness {

struct KeptFlights {
  std::size_t count = 0;
  int exit = 0;  // 3: a flight is an error, or has another verdict than in the search
};
// Flies each once, and keeps it, with a report for each client and fault type.
KeptFlights KeepFlights(const std::filesystem::path& folder, const std::vector<SideFlight>& sides,
                        const EnvelopeOptions& options);

}  // namespace tiltproof::harness
