// The faults that the failing runs of a campaign still need, of many runs at once: while one search waits for its flight,
// the flights of the others keep the workers busy.
//
//   CampaignMinimiser minimiser(plan, means, failing, {.jobs_count = 2});
//   MinimiseFailures(store, folder, [&](std::uint64_t run) { return minimiser.Find(run); });
//
// MinimiseFaults (smallest_failure.h) is pure and asks one question at a time. So a search is called again with all
// answers that are known, and its first new question is the next flight.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/campaign_draw.h"
#include "harness/campaign/campaign_failures.h"
#include "harness/engine/flight_job.h"
#include "harness/engine/flights_options.h"

namespace tiltproof::harness {

class CampaignMinimiser {
 public:
  // `runs`: in the order in which they will be asked for.
  CampaignMinimiser(const CampaignPlan& plan, FlightMeans means, std::vector<std::uint64_t> runs,
                    FlightsOptions options);

  // None: it was interrupted, or the run did not fail again in the same way.
  std::optional<MinimalForm> Find(std::uint64_t run);

  std::size_t flights_count() const { return flights_count_; }
  std::size_t found_count() const { return found_count_; }

 private:
  // Those of some runs, from this one on.
  void Search(std::size_t first);

  const CampaignPlan& plan_;
  FlightMeans means_;
  std::vector<std::uint64_t> runs_;
  FlightsOptions options_;
  std::map<std::uint64_t, std::optional<MinimalForm>> forms_;  // that were not asked for yet
  std::size_t flights_count_ = 0, found_count_ = 0;
};

}  // namespace tiltproof::harness
