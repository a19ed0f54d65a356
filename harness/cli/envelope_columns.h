// The firmwares that an envelope compares.
#pragma once

#include <string>
#include <vector>

#include "harness/cli/envelope_options.h"
#include "harness/cli/envelope_report.h"
#include "harness/cli/suite.h"
#include "harness/engine/flight_job.h"

namespace tiltproof::harness {

// A firmware: a column of the table.
struct FirmwareColumn {
  std::string name;
  FlightMeans means;
  SuiteScenario base;
};

// Builds of the shipped firmware first, then the firmware of users. Throws UsageError.
std::vector<FirmwareColumn> ReadColumns(const EnvelopeOptions& options);

// The column as the file knows it.
EnvelopeColumn IdentityOf(const FirmwareColumn& column);

}  // namespace tiltproof::harness
