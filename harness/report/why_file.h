// why.json, which tiltproof why writes into a flight's folder: when the flight was lost, and which faults did it.
//
//   if (const auto why = ReadWhy(folder)) Draw(why->curve);
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "link/fields.h"

namespace tiltproof::harness {

// Futures of the flight without its faults from `time_s` on.
struct WhyPoint {
  double time_s = 0;
  double probability = 0;    // share of the futures that fail
  double low = 0, high = 0;  // Wilson's interval of 95 %; the probability itself where nothing is random
  std::size_t futures_count = 0;
  std::size_t fails_count = 0;
  TILTPROOF_FIELDS(time_s, probability, low, high, futures_count, fails_count)
};

struct WhyFile {
  std::string trace_hash;       // of the flight
  std::string criterion;        // the first that it violated; a future fails by this one, or by survival
  double first_fault_s = 0;     // the first activation of a fault
  double violated_s = 0;        // or the end of the flight, for a criterion without a time
  std::vector<WhyPoint> curve;  // ascending
  std::optional<double> last_chance_s, point_of_no_return_s;
  std::vector<std::string> needed;             // ids of faults
  std::vector<std::vector<std::string>> sets;  // of ids
  bool sets_complete = true;
  std::size_t futures_count = 0;  // wanted of each moment
  std::size_t flights_count = 0;  // flown, whole or in part
  TILTPROOF_FIELDS(trace_hash, criterion, first_fault_s, violated_s, curve, last_chance_s,
                   point_of_no_return_s, needed, sets, sets_complete, futures_count, flights_count)
};

void WriteWhy(const std::filesystem::path& folder, const WhyFile& why);
// None: the folder has none. Throws FileError or std::runtime_error, naming the file.
std::optional<WhyFile> ReadWhy(const std::filesystem::path& folder);

}  // namespace tiltproof::harness
