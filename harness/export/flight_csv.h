// A flight as tables for pandas, MATLAB and spreadsheets, one file each; units are in the names of the columns.
//
//   WriteCsvTables(flight, "hover-csv");      // trace.csv, fault_activations.csv, events.csv, frames.csv, metrics.csv
#pragma once

#include <filesystem>

#include "harness/export/recorded_flight.h"

namespace tiltproof::harness {

// Makes the folder. Throws FileError.
void WriteCsvTables(const RecordedFlight& flight, const std::filesystem::path& folder);

}  // namespace tiltproof::harness
