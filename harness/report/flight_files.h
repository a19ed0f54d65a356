// The folder of one scenario: all records of its flight, and how to read them back for scoring offline.
//
//   scenario.resolved.yaml  the scenario with every default explicit
//   trace.csv               one row every control period; or trace.packed (harness/report/packed_trace.h)
//   faults.jsonl            every kept activation of a fault: time, what, chunks before and after; at the end,
//                           for each fault of which some were not kept, how many: left_out_count
//   link.bin                raw bytes with times (harness/run/link_log.h)
//   firmware.log            what the firmware logged, with simulation times in seconds; of several clients firmware.<id>.log
//   flight.json             how the flight ended, counters, request times: the rest of what scoring needs
//   verdict.json            the scenario's entry in results.json, `hash`: that of the entry, and `files`: those of the
//                           other files (flight_hashes.h)
#pragma once

#include <filesystem>
#include <string>

#include "harness/engine/flight_job.h"
#include "harness/report/results.h"
#include "harness/report/trace_file.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// Writes the flight's files: all of the above except scenario.resolved.yaml, which is there before the
// flight, and verdict.json. Throws FileError.
void WriteFlight(const std::filesystem::path& folder, const Scenario& scenario, const RunLog& log,
                 TraceFormat trace = TraceFormat::kCsv);

// Reads what scoring needs: the trace and flight.json; not the raw bytes and activations. Throws FileError or
// std::runtime_error naming the file and the place.
RunLog ReadFlight(const std::filesystem::path& folder);
// Throws also when the flight does not have the clients of the scenario that it is scored by.
RunLog ReadFlight(const std::filesystem::path& folder, const Scenario& scenario);
// Only flight.json.
RunLog ReadFlightRecord(const std::filesystem::path& folder);

// Keeps a flight in its folder, or not: runs in its worker process.
FlightRecorder RecorderIn(const std::filesystem::path& folder, Keep keep,
                          TraceFormat trace = TraceFormat::kCsv);
// Writes verdict.json, when the flight is kept: for the parent of the worker, which knows the result even if
// the worker died.
void KeepVerdict(const std::filesystem::path& folder, const Scenario& scenario, const FlightResult& result,
                 Keep keep);
// The entry in verdict.json. Throws FileError when it is none, or has changed since the flight.
FlightResult ReadVerdict(const std::filesystem::path& folder);

}  // namespace tiltproof::harness
