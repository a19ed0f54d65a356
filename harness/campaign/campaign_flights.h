// Flies runs of a campaign, and hands their results out in the order of their numbers: so it does not depend on the number
// of jobs where a campaign stops, and what is stored is always its beginning.
//
//   CampaignFlights flights(plan, means, {.jobs_count = 2}, [&](CampaignRun run) { return Keep(run); });
//   flights.Fly([&]() -> std::optional<std::uint64_t> { return NextNumber(); });
//
// Runs are drawn shortly before they are flown, and forgotten when they were handed out: the memory does not grow.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/campaign_draw.h"
#include "harness/engine/engine.h"
#include "harness/engine/flights_options.h"

namespace tiltproof::harness {

// A run's row: what was flown, the faults that were drawn, and what became of it. The signature is empty.
CampaignRun RowOf(std::uint64_t number, const Scenario& flown, std::vector<CampaignFault> drawn,
                  const FlightResult& result);
// The flight of a run.
FlightJob JobOf(const CampaignPlan& plan, const FlightMeans& means, DrawnRun drawn);

class CampaignFlights {
 public:
  // A run's row, in the order of the numbers. False: enough, the rest is not flown.
  using Take = std::function<bool(CampaignRun run)>;
  CampaignFlights(const CampaignPlan& plan, FlightMeans means, FlightsOptions options, Take take);

  // `next`: ascending numbers, and none at the end. Returns when all are taken, when `take` has enough, or when it is
  // interrupted: then the last flights are lost.
  void Fly(const std::function<std::optional<std::uint64_t>()>& next);

 private:
  struct UnderWay {
    std::vector<CampaignFault> drawn;
    std::optional<CampaignRun> row;
  };

  // Draws up to a few runs more, if there is room for them. False: there are none.
  bool TopUp(const std::function<std::optional<std::uint64_t>()>& next);
  void Finished(const FlightJob& job, const FlightResult& result);
  void HandOut();

  const CampaignPlan& plan_;
  FlightMeans means_;
  FlightsOptions options_;
  Take take_;
  Engine engine_;
  std::map<std::uint64_t, UnderWay> under_way_;  // by number
  bool enough_ = false;
};

}  // namespace tiltproof::harness
