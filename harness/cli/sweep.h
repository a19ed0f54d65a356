// `run --set PATH=V1,V2,...`: the values of some keys, each combination a cell of a grid.
//
//   const std::vector<SweepAxis> sweep = ReadSweep({"link.baud=9600,19200", "seed=1,2"});
//   for (const std::vector<KeySetting>& cell : CellsOf(sweep)) Fly(cell);  // four; the last axis turns fastest
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "harness/scenario/set_keys.h"

namespace tiltproof::harness {

struct SweepAxis {
  std::string path;
  std::vector<std::string> values;
};

inline constexpr std::size_t kCellsMax = 100'000;

// Throws UsageError for a flag that is not PATH=V1,V2,..., a path that is given twice, and more than kCellsMax cells.
std::vector<SweepAxis> ReadSweep(const std::vector<std::string>& flags);

std::vector<std::vector<KeySetting>> CellsOf(const std::vector<SweepAxis>& sweep);

// The names of the cells' scenarios: "hover-probability-0.1-baud-9600", or "hover-set1", ... where these are no names.
std::vector<std::string> CellNames(const std::string& scenario,
                                   std::span<const std::vector<KeySetting>> cells);

// "faults.loss.parameters.probability=0.1"
std::string ToText(const KeySetting& setting);

}  // namespace tiltproof::harness
