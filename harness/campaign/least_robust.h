// Flies a scenario at the points of a search until a flight fails, or the flights run out.
//
//   const LeastRobust found = FindLeastRobust({.job = job, .numbers = FaultNumbers(job.scenario, signals)}, {.jobs_count = 2});
//   if (found.least()) Print(stdout, "{}\n", found.least()->number);
//
// The points of a batch fly at once, and their results are taken in order. So the outcome does not depend on the number of
// jobs.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/search_space.h"
#include "harness/engine/engine.h"

namespace tiltproof::harness {

struct SearchFlight {
  std::size_t number = 0;  // from 1
  SearchPoint point;
  Verdict verdict = Verdict::kError;
  std::optional<double> margin;  // of the headline criterion (harness/score/headline.h)
  std::string criterion;         // with that margin; empty: none
  std::string reason;            // for the verdict; empty: passed
};

struct LeastRobustTask {
  FlightJob job;
  std::vector<SearchedNumber> numbers;
  std::size_t flights_count_max = 200;
};

struct LeastRobustOptions {
  int jobs_count = 1;
  const std::atomic<bool>* interrupted = nullptr;  // ends the flights; may be null
  std::function<void(const std::string& line)> tell = [](const auto&) {};
  // Each flight in order; `is_least`: no earlier one was as bad.
  std::function<void(const SearchFlight& flight, bool is_least)> on_flight = [](const auto&, bool) {};
};

struct LeastRobust {
  std::vector<SearchFlight> flights;  // up to the first that failed
  std::size_t least_place = 0;        // in flights
  bool interrupted = false;
  bool has_margins = false;  // false: no flight had a margin, and the search had nothing to follow
  // Null: no flight could be judged.
  const SearchFlight* least() const;
};

LeastRobust FindLeastRobust(const LeastRobustTask& task, const LeastRobustOptions& options);

// The measure of a flight: smaller is worse. A flight that failed is below 0; infinite when it could not be judged, or when
// no criterion that a fault can change has a margin.
double RobustnessOf(const Score& score);

}  // namespace tiltproof::harness
