// The results of `run --set`: a table for a person, and results.csv for scripts.
//
//   WriteFile(folder / "results.csv", SweepCsv(rows));
//   for (const std::string& line : SweepTable(rows)) console.Line(line);
#pragma once

#include <string>
#include <vector>

#include "harness/engine/flight_result.h"
#include "harness/scenario/set_keys.h"

namespace tiltproof::harness {

struct SweepRow {
  std::string scenario;  // the cell's
  std::vector<KeySetting> settings;
  FlightResult result;
};

// One line for each flight: scenario, seed, the value of each path, verdict, green, the criterion that was violated first and
// when, the least margin, and every metric of any of the flights. What a flight lacks is empty.
std::string SweepCsv(const std::vector<SweepRow>& rows);

// One line for each cell, below a heading: its values, how many of its flights passed, and of all of them the least margin,
// the largest rmse and the first criterion that was violated.
std::vector<std::string> SweepTable(const std::vector<SweepRow>& rows);

}  // namespace tiltproof::harness
