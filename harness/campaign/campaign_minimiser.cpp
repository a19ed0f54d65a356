#include "harness/campaign/campaign_minimiser.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "harness/campaign/campaign_flights.h"
#include "harness/campaign/smallest_failure.h"
#include "harness/engine/engine.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

// Searches that go on at once. What they find is kept when the next ones begin.
constexpr std::size_t kSearchesMax = 128;
// A run has few faults.
constexpr std::size_t kFlightsMax = 60;

// The search for the faults that one run needs.
struct FaultsSearch {
  std::uint64_t run = 0;
  Scenario scenario;
  std::vector<Flown> answers;  // to its questions, in order

  // Its next question; none: it has ended, with the result.
  std::optional<Scenario> Next(SmallestFailure& result) const {
    return NextQuestion(
        [&](const Evaluate& evaluate) {
          return MinimiseFaults(scenario, evaluate, {.runs_max = kFlightsMax});
        },
        answers, result);
  }
};

std::optional<MinimalForm> FormOf(const FaultsSearch& search, const SmallestFailure& smallest) {
  if (!smallest.fails() || smallest.last.criterion != smallest.first.criterion) return std::nullopt;
  MinimalForm form;
  for (const faults::FaultSpec& fault : smallest.scenario.faults) form.types.push_back(fault.type);
  form.scenario = fmt::format("# Run {} of a campaign, with the faults that it needs to fail: {}\n{}",
                              search.run, smallest.last.reason, WriteResolved(smallest.scenario));
  return form;
}

}  // namespace

CampaignMinimiser::CampaignMinimiser(const CampaignPlan& plan, FlightMeans means,
                                     std::vector<std::uint64_t> runs, FlightsOptions options)
    : plan_(plan), means_(std::move(means)), runs_(std::move(runs)), options_(std::move(options)) {}

std::optional<MinimalForm> CampaignMinimiser::Find(std::uint64_t run) {
  if (!forms_.contains(run)) {
    const auto place = std::find(runs_.begin(), runs_.end(), run);
    if (place == runs_.end()) return std::nullopt;
    Search(static_cast<std::size_t>(place - runs_.begin()));
  }
  const auto found = forms_.find(run);
  if (found == forms_.end()) return std::nullopt;
  std::optional<MinimalForm> form = std::move(found->second);
  forms_.erase(found);
  return form;
}

void CampaignMinimiser::Search(std::size_t first) {
  if (options_.is_interrupted()) return;
  std::vector<FaultsSearch> searches;
  for (std::size_t i = first; i < runs_.size() && searches.size() < kSearchesMax; ++i)
    if (!forms_.contains(runs_[i])) searches.push_back({runs_[i], DrawRun(plan_, runs_[i]).scenario, {}});
  std::vector<std::size_t> turns;  // searches whose next question is to be asked
  for (std::size_t i = 0; i < searches.size(); ++i) turns.push_back(i);
  Engine engine({.jobs_count = options_.jobs_count,
                 .on_finished =
                     [&](const FlightJob& job, const FlightResult& result) {
                       if (result.end_reason == EndReason::kInterrupted) return;
                       ++flights_count_;
                       const std::size_t i = std::stoul(job.name);
                       searches[i].answers.push_back(FlownAs(result));
                       turns.push_back(i);
                     },
                 .tell = options_.tell,
                 .interrupted = options_.interrupted});
  while (!turns.empty() || !engine.idle()) {
    for (const std::size_t i : std::exchange(turns, {})) {
      SmallestFailure result;
      if (auto question = searches[i].Next(result)) {
        DrawnRun flown{.number = searches[i].run,
                       .base = BaseOf(plan_, searches[i].run),
                       .scenario = *std::move(question),
                       .faults = {}};
        FlightJob job = JobOf(plan_, means_, std::move(flown));
        job.name = std::to_string(i);
        engine.Submit(std::move(job));
        continue;
      }
      forms_[searches[i].run] = FormOf(searches[i], result);
      ++found_count_;
    }
    engine.Poll();
    options_.on_turn();
  }
}

}  // namespace tiltproof::harness
