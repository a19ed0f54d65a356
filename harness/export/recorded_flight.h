// A flight as its folder has it, for other tools.
//
//   const RecordedFlight flight = ReadRecordedFlight("results/latest/hover", "a run");
//   if (!flight.trouble.empty()) Tell(flight.trouble);
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "harness/dds/messages.h"
#include "harness/engine/flight_result.h"
#include "harness/run/link_log.h"
#include "harness/run/run_log.h"
#include "harness/run/trace.h"

namespace tiltproof::harness {

struct RecordedActivation {
  std::string type;  // of the fault
  dds::FaultActivation activation;
};

struct RecordedFlight {
  std::string run_id;
  std::string scenario_yaml;  // scenario.resolved.yaml
  FlightResult result;
  Trace trace;
  std::vector<TimeNs> times_ns;  // of its rows
  std::vector<RunEvent> events;
  std::vector<std::string> client_ids;  // one per client; empty: the only one
  TimeNs end_ns = 0;
  std::vector<RecordedActivation> activations;  // those that were kept
  LinkLog link;
  std::string trouble;  // a trace that is damaged: only the rows before are here
};

// Throws FileError, or std::runtime_error naming the file.
RecordedFlight ReadRecordedFlight(const std::filesystem::path& folder, const std::string& run_id);

}  // namespace tiltproof::harness
