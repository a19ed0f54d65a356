#include "harness/campaign/trials.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "harness/score/headline.h"

namespace tiltproof::harness {
std::string WhyUnknown(const TrialResult& unknown) {
  return fmt::format("the flight '{}' is {}: {}", unknown.flight,
                     unknown.verdict == Verdict::kError ? "an error" : Name(unknown.verdict), unknown.reason);
}

namespace {

constexpr const char* kSeedOfTrunk = ", seed ";

}  // namespace

Trials::Trials(FlightsOptions options, int seeds_count)
    : options_(std::move(options)),
      seeds_count_(static_cast<std::size_t>(seeds_count)),
      engine_(
          {.jobs_count = options_.jobs_count,
           .on_finished = [this](const FlightJob& job, const FlightResult& result) { Finished(job, result); },
           .tell = options_.tell,
           .interrupted = options_.interrupted}) {}

void Trials::Start(const FlightJob& job, Done done) {
  const std::uint64_t number = numbers_end_++;
  const Trial& trial = trials_
                           .emplace(number, Trial{std::vector<std::optional<FlightResult>>(seeds_count_),
                                                  std::move(done), job})
                           .first->second;
  Submit(number, trial, 0);
}

void Trials::Submit(std::uint64_t number, const Trial& trial, std::size_t place) {
  FlightJob seeded = trial.job;
  seeded.scenario.seed += place;
  if (seeded.departure) seeded.departure->trunk += fmt::format("{}{}", kSeedOfTrunk, seeded.scenario.seed);
  seeded.name = fmt::format("{}, seed {}", trial.job.name, seeded.scenario.seed);
  flights_[seeded.name] = {number, place};
  engine_.Submit(std::move(seeded));
}

void Trials::Forget(const std::string& trunk) {
  engine_.DropTrunks([&](const std::string& name) { return name.starts_with(trunk + kSeedOfTrunk); });
}

void Trials::Fly() {
  while (!stopped_ && !engine_.idle()) {
    engine_.Poll();
    options_.on_turn();
  }
}

void Trials::Finished(const FlightJob& job, const FlightResult& result) {
  const auto flight = flights_.find(job.name);
  if (options_.is_interrupted() || stopped_ || flight == flights_.end()) return;
  ++flown_count_;
  const auto [number, place] = flight->second;
  flights_.erase(flight);
  const auto found = trials_.find(number);
  if (found == trials_.end()) return;  // another seed has decided
  found->second.results[place] = result;
  if (!Survived(result.score)) {
    // Those with higher seeds cannot change what is reported.
    engine_.DropWaiting([&, trial = number, from = place](const FlightJob& waiting) {
      const auto known = flights_.find(waiting.name);
      if (known == flights_.end() || known->second.first != trial || known->second.second < from)
        return false;
      flights_.erase(known);
      return true;
    });
  }
  const std::optional<TrialResult> decided = Decide(found->second);
  if (!decided && place == 0)
    for (std::size_t other = 1; other < found->second.results.size(); ++other)
      Submit(number, found->second, other);
  if (!decided) return;
  const Done done = std::move(found->second.done);
  trials_.erase(found);
  done(*decided);
}

std::optional<TrialResult> Trials::Decide(const Trial& trial) {
  TrialResult decided;
  for (const std::optional<FlightResult>& result : trial.results) {
    if (!result) return std::nullopt;
    ++decided.flights_count;
    decided.activations.resize(std::max(decided.activations.size(), result->score.faults.size()));
    for (std::size_t fault = 0; fault < result->score.faults.size(); ++fault)
      decided.activations[fault] += result->score.faults[fault].activations;
    const bool survived = Survived(result->score);
    if (survived && result->is_of_any_seed) {
      decided.is_of_any_seed = true;
      break;
    }
    if (survived) continue;
    const bool failed = result->score.verdict == Verdict::kFail;
    decided.answer = failed ? TrialResult::Answer::kFailed : TrialResult::Answer::kUnknown;
    decided.flight = result->name;
    decided.seed = result->seed;
    decided.verdict = result->score.verdict;
    decided.reason = result->score.reason;
    if (const CriterionResult* first = failed ? FirstViolated(result->score) : nullptr) {
      decided.criterion = first->name;
      decided.time_s = first->time_s;
    }
    break;
  }
  return decided;
}

}  // namespace tiltproof::harness
