// Builds one RunLog from the records of a flight's parts, whether or not they run in separate processes.
#pragma once

#include <cstdint>
#include <span>

#include "faults/schedule.h"
#include "harness/run/line.h"
#include "harness/run/plant_server.h"
#include "harness/run/run_log.h"

namespace tiltproof::harness {

// Adds how often each fault acted in one part of the flight; call it once per part. The log has one number
// per fault of its scenario from the beginning.
void AddActivations(RunLog& log, std::span<const std::int64_t> counts);

// Appends the records and the totals of a part; call it once per part. `client`: place in the scenario of the
// line's client. Without t = 0, the times of a line's records count from power-on.
void Append(RunLog& log, PlantLog&& part);
void Append(RunLog& log, LineLog&& part, std::size_t client, Origin origin);

// Also what a schedule has counted and recorded. Its origin is the flight's.
void Append(RunLog& log, faults::FaultSchedule& counts, Origin origin);

// Drops a part's records and keeps its totals.
void DropRecords(PlantLog& part);
void DropRecords(LineLog& part);

// Call after the last Append: sorts each kind of record by time.
void SortByTime(RunLog& log);

}  // namespace tiltproof::harness
