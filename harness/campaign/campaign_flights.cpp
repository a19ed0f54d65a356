#include "harness/campaign/campaign_flights.h"

#include <utility>

#include "harness/score/headline.h"

namespace tiltproof::harness {
namespace {

// A worker has a copy of the jobs that wait when it is forked: with many of them, few workers are forked.
constexpr std::size_t kUnderWayMax = 512;
// Drawn at once, while the workers fly.
constexpr std::size_t kDrawnMax = 16;

}  // namespace

CampaignRun RowOf(std::uint64_t number, const Scenario& flown, std::vector<CampaignFault> drawn,
                  const FlightResult& result) {
  const Score& score = result.score;
  CampaignRun run;
  run.number = number;
  run.seed = result.seed;
  run.scenario = flown.name;
  run.firmware = flown.firmware_of(flown.selected_client());
  run.verdict = Name(Survived(score) ? Verdict::kPass : score.verdict);
  if (result.end_reason) run.end = Name(*result.end_reason);
  if (!Survived(score)) {
    if (const CriterionResult* violated = FirstViolated(score)) {
      run.criterion = violated->name;
      run.time_s = violated->time_s;
    }
  }
  run.margin = LeastMargin(score);
  run.trace_hash = result.trace_hash;
  run.wall_s = result.wall_s;
  run.faults = std::move(drawn);
  for (CampaignFault& fault : run.faults)
    for (const FaultResult& acted : score.faults)
      if (acted.id == fault.id) fault.activations = acted.activations;
  for (const CriterionResult& criterion : score.criteria)
    run.criteria.push_back({criterion.name, std::string(Name(criterion.verdict)), criterion.margin});
  return run;
}

CampaignFlights::CampaignFlights(const CampaignPlan& plan, FlightMeans means, FlightsOptions options,
                                 Take take)
    : plan_(plan),
      means_(std::move(means)),
      options_(std::move(options)),
      take_(std::move(take)),
      engine_(
          {.jobs_count = options_.jobs_count,
           .on_finished = [this](const FlightJob& job, const FlightResult& result) { Finished(job, result); },
           .tell = options_.tell,
           .interrupted = options_.interrupted}) {}

FlightJob JobOf(const CampaignPlan& plan, const FlightMeans& means, DrawnRun drawn) {
  return FlightJob{.name = std::to_string(drawn.number),
                   .scenario = std::move(drawn.scenario),
                   .model = plan.bases[drawn.base].model,
                   .means = means,
                   .replay = {}};
}

bool CampaignFlights::TopUp(const std::function<std::optional<std::uint64_t>()>& next) {
  for (std::size_t i = 0; i < kDrawnMax && under_way_.size() < kUnderWayMax; ++i) {
    const std::optional<std::uint64_t> number = next();
    if (!number) return false;
    DrawnRun drawn = DrawRun(plan_, *number);
    under_way_[*number].drawn = std::move(drawn.faults);
    engine_.Submit(JobOf(plan_, means_, std::move(drawn)));
  }
  return true;
}

void CampaignFlights::Fly(const std::function<std::optional<std::uint64_t>()>& next) {
  bool more = true;
  // The first workers are to know as many runs as later ones.
  while (more && under_way_.size() < kUnderWayMax) more = TopUp(next);
  while (!enough_ && !engine_.idle()) {
    engine_.Poll();
    HandOut();
    if (more && !enough_) more = TopUp(next);
    options_.on_turn();
  }
  engine_.DropWaiting();
}

void CampaignFlights::Finished(const FlightJob& job, const FlightResult& result) {
  if (result.end_reason == EndReason::kInterrupted) return;
  const std::uint64_t number = std::stoull(job.name);
  UnderWay& flown = under_way_.at(number);
  flown.row = RowOf(number, job.scenario, std::move(flown.drawn), result);
}

void CampaignFlights::HandOut() {
  while (!enough_ && !under_way_.empty() && under_way_.begin()->second.row) {
    CampaignRun run = *std::move(under_way_.begin()->second.row);
    under_way_.erase(under_way_.begin());
    enough_ = !take_(std::move(run));
  }
}

}  // namespace tiltproof::harness
