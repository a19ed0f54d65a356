// An envelope that was interrupted goes on with the rows that it has.
#pragma once

#include <filesystem>

#include "harness/cli/envelope_report.h"

namespace tiltproof::harness {

// Gives the envelope's entries the margins that an earlier envelope.json has for them; rows that could not be judged
// are left out. Rows, clients and maps of the file that the envelope does not look for stay in it. Throws UsageError when the file cannot be read, or its rows were found in another way: other scenario,
// seeds, tolerance, version or build.
void TakeEarlierRows(const std::filesystem::path& file, Envelope& envelope);

}  // namespace tiltproof::harness
