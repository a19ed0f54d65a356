#include "harness/campaign/fuzz.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <utility>

#include "harness/campaign/minimise.h"

namespace tiltproof::harness {
namespace {

// A sequence is made when this many before it have not ended yet: so many workers can be busy.
constexpr std::size_t kAhead = 64;
// Each: flights to leave inputs out, and to leave bytes of them out.
constexpr std::size_t kMinimiseFlightsMax = 150;
// A flight that hangs takes seconds.
constexpr std::size_t kMinimiseHangsMax = 6;

bool IsReady(const std::future<FlightResult>& result) {
  return result.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

// Nothing: what was to be flown was dropped.
std::optional<FlightResult> ResultOf(std::future<FlightResult>& result) {
  try {
    return result.get();
  } catch (const std::future_error&) {
    return std::nullopt;
  }
}

}  // namespace

FuzzCampaign::FuzzCampaign(Options options)
    : options_(std::move(options)),
      replies_(*options_.flight.scenario.link.protocol, link::Direction::kToClient),
      references_(*options_.flight.scenario.link.protocol, link::Direction::kReference) {
  options_.flight.scenario.criteria = FuzzCriteria(*options_.flight.scenario.link.protocol);
}

FlightJob FuzzCampaign::JobOf(const HostileSequence& sequence, std::string name) const {
  FlightJob job = options_.flight;
  job.name = std::move(name);
  job.scenario = FlightOf(job.scenario, sequence);
  job.coverage = true;
  return job;
}

std::optional<BrokenFlight> FuzzCampaign::Fly(const HostileSequence& sequence, FlightResult* result) {
  Engine engine({.tell = options_.tell, .interrupted = options_.interrupted});
  auto flown = engine.Submit(JobOf(sequence, fmt::format("extra {}", extra_flights_count_++)));
  while (!engine.idle()) {
    engine.Turn();
    options_.on_turn();
  }
  if (!IsReady(flown)) return std::nullopt;
  const std::optional<FlightResult> got = ResultOf(flown);
  if (!got) return std::nullopt;
  if (result != nullptr) *result = *got;
  return BrokenBy(*got);
}

std::optional<std::string> FuzzCampaign::WhyUnusable() {
  FlightResult result;
  const auto broken = Fly({.inputs = {}}, &result);
  if (interrupted()) return std::nullopt;
  if (broken) return broken->reason;
  sees_coverage_ = result.coverage_kind != CoverageKind::kBlackBox;
  HasNewFeature(result);
  if (result.score.verdict != Verdict::kPass) return result.score.reason;
  return std::nullopt;
}

HostileSequence FuzzCampaign::Next() {
  faults::Random random(faults::KeyOf(options_.seed, sequences_count_++));
  std::size_t count = random.Below(8) == 0 ? 1 + random.Below(kInputsMax) : kInputsMax;
  if (options_.runs_count)
    count = static_cast<std::size_t>(std::min<std::uint64_t>(count, *options_.runs_count - planned_count_));
  planned_count_ += count;
  HostileSequence parent, other;
  if (!corpus_.empty()) {
    // New ones lead on, old ones may have been left too early.
    const std::size_t newest = std::min<std::size_t>(corpus_.size(), 8);
    const std::size_t from = random.Below(2) == 0 ? corpus_.size() - newest : 0;
    parent = corpus_[from + random.Below(corpus_.size() - from)];
    other = corpus_[random.Below(corpus_.size())];
  }
  if (corpus_.empty() || random.Below(4) == 0) {
    parent = {};
    if (options_.reference_line && random.Below(4) == 0) parent.target = faults::Target::kReference;
  }
  const HostileFrames& frames = parent.target == faults::Target::kReference ? references_ : replies_;
  return ChangeSequence(parent, other, frames, count, random);
}

void FuzzCampaign::Run() {
  Engine engine(
      {.jobs_count = options_.jobs_count, .tell = options_.tell, .interrupted = options_.interrupted});
  std::deque<Pending> pending;
  const auto goes_on = [&] {
    if (trouble_ || interrupted() || hangs_too_often()) return false;
    return options_.runs_count ? planned_count_ < *options_.runs_count : !options_.is_over();
  };
  const auto fill = [&] {
    while (pending.size() < kAhead && goes_on()) {
      HostileSequence next = Next();
      FlightJob job = JobOf(next, fmt::format("flight {}", sequences_count_));
      pending.push_back({std::move(next), engine.Submit(std::move(job))});
    }
  };
  fill();
  while (!engine.idle()) {
    engine.Turn();
    if (!options_.runs_count && options_.is_over()) engine.DropWaiting();
    while (!pending.empty() && !trouble_ && !interrupted() && !hangs_too_often() &&
           IsReady(pending.front().result)) {
      Pending ended = std::move(pending.front());
      pending.pop_front();
      if (const auto result = ResultOf(ended.result)) Take(std::move(ended.sequence), *result);
      fill();
    }
    if (trouble_ || hangs_too_often()) engine.DropWaiting();
    options_.on_turn();
  }
}

void FuzzCampaign::Take(HostileSequence sequence, const FlightResult& result) {
  if (result.score.verdict == Verdict::kError) {
    trouble_ = result.score.reason;
    return;
  }
  // A worker that was taken away by its flight could not say how many.
  const auto said =
      static_cast<std::uint64_t>(result.score.faults.empty() ? 0 : result.score.faults[0].activations);
  runs_count_ += said;
  ++flights_count_;
  const std::optional<BrokenFlight> broken = BrokenBy(result);
  if (HasNewFeature(result) && !broken) {
    options_.on_corpus(sequence);
    corpus_.push_back(sequence);
  }
  if (!broken) return;
  if (broken->kind == "hang") ++hangs_count_;
  const auto known = std::find_if(findings_.begin(), findings_.end(), [&](const FuzzFinding& finding) {
    return finding.broken.key == broken->key;
  });
  if (known != findings_.end()) {
    ++known->flights_count;
    return;
  }
  // What came after it was not said.
  if (said > 0 && result.end_reason != EndReason::kCompleted)
    sequence.inputs.resize(InputsUntil(sequence, said));
  findings_.push_back({.broken = *broken, .sequence = std::move(sequence), .at_runs = runs_count_});
  options_.on_finding(findings_.back());
}

bool FuzzCampaign::HasNewFeature(const FlightResult& result) {
  bool is_new = false;
  for (const std::uint32_t feature : result.coverage) {
    if (feature >= features_.size()) features_.resize(feature + std::size_t{1});
    if (features_[feature]) continue;
    features_[feature] = is_new = true;
    ++features_count_;
  }
  return is_new;
}

void FuzzCampaign::MinimiseFindings() {
  for (FuzzFinding& finding : findings_) {
    if (interrupted()) return;
    Minimise(finding);
    if (!interrupted()) options_.on_finding(finding);
  }
}

void FuzzCampaign::Minimise(FuzzFinding& finding) {
  const std::string& key = finding.broken.key;
  HostileSequence tried = finding.sequence;
  const auto breaks = [&](const HostileSequence& sequence) {
    if (interrupted()) return false;
    const auto broken = Fly(sequence);
    return broken && broken->key == key;
  };
  const std::size_t flights_max = finding.broken.kind == "hang" ? kMinimiseHangsMax : kMinimiseFlightsMax;
  finding.sequence.inputs = harness::Minimise<LineBytes>(
      finding.sequence.inputs,
      [&](const std::vector<LineBytes>& inputs) {
        tried.inputs = inputs;
        return breaks(tried);
      },
      flights_max);
  std::vector<LineBytes>& inputs = finding.sequence.inputs;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    inputs[i] = harness::Minimise<std::uint8_t>(
        inputs[i],
        [&](const LineBytes& bytes) {
          tried = finding.sequence;
          tried.inputs[i] = bytes;
          return breaks(tried);
        },
        flights_max / inputs.size());
  }
  if (interrupted()) return;
  finding.minimised = true;
  const auto again = Fly(finding.sequence);
  finding.confirmed = again && again->key == key;
  if (finding.confirmed) finding.broken.reason = again->reason;
}

}  // namespace tiltproof::harness
