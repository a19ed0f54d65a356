// Common part of the commands that search for limits: they fly one scenario with many levels, in lockstep.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "harness/campaign/margins.h"
#include "harness/cli/suite.h"
#include "harness/engine/flight_job.h"

namespace tiltproof::harness {

// Throws UsageError for a client that cannot fly in lockstep.
FlightMeans LockstepMeans(RunClients clients, const std::string& command);
// Throws UsageError when the path holds more or fewer scenarios than one. Prints its warnings.
Suite LoadOneScenario(const std::filesystem::path& path, const RunClients& clients,
                      const std::string& command, const std::string& build = "");
// Checks that the clients can fly, before anything is flown.
void CheckReady(const FlightMeans& means);

// The scenario's, or the one that the command line gives. Throws UsageError when the last seed is too large.
std::uint64_t FirstSeed(std::optional<std::uint64_t> given, const Scenario& scenario, int repeat_count);

// Checks that the fault is valid at both ends of its range. Throws SeverityMistake.
void CheckLevels(const MarginTask& task);

// The exit code for a flight that could not be judged.
int UnknownExit(const TrialResult& unknown);

}  // namespace tiltproof::harness
