// One RunLog from what the parts of a flight recorded, each in its own process or not.
#pragma once

#include <cstdint>
#include <span>

#include "faults/schedule.h"
#include "harness/run/line.h"
#include "harness/run/plant_server.h"
#include "harness/run/run_log.h"

namespace tiltproof::harness {

// How often each fault acted in one part of the flight, once for each part: what acts in several adds up. The log has
// one number for each fault of its scenario from the beginning.
void AddActivations(RunLog& log, std::span<const std::int64_t> counts);

// Appends the records of a part and its totals, once for each part. `client`: whose line, by its place in the scenario.
// Without t = 0, a line's records have the time since power-on.
void Append(RunLog& log, PlantLog&& part);
void Append(RunLog& log, LineLog&& part, std::size_t client, Origin origin);

// And what a schedule has counted and recorded, whose origin is the flight's.
void Append(RunLog& log, faults::FaultSchedule& counts, Origin origin);

// Leaves the totals of a part.
void DropRecords(PlantLog& part);
void DropRecords(LineLog& part);

// After the last Append: in order of time, each kind of record.
void SortByTime(RunLog& log);

}  // namespace tiltproof::harness
