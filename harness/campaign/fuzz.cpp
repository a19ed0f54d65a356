#include "harness/campaign/fuzz.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <tuple>
#include <utility>

#include "harness/campaign/minimise.h"

namespace tiltproof::harness {
namespace {

// A sequence is made when at most so many before it have not ended yet: so many workers can be busy.
constexpr std::size_t kAheadMax = 64;
// At first it is one, and one more whenever this many flights have ended: the first ones teach the most.
constexpr std::size_t kFlightsPerAhead = 4;
// Each: flights to leave inputs out, and to leave bytes of them out.
constexpr std::size_t kMinimiseFlightsMax = 150;
// A flight in real time takes seconds, and one that hangs more of them.
constexpr std::size_t kMinimiseRealtimeMax = 40;
constexpr std::size_t kMinimiseHangsMax = 6;
// A hang that took at least so long is a costly one. Any that the wall clock ends takes 2 s of the firmware's own time.
constexpr double kCostlyHangS = 1.5;
// The effect of damaged memory may differ from process to process.
constexpr int kSeenAgainFlights = 3;

std::uint32_t PlaceOf(std::uint32_t feature) { return feature / kBucketsCount; }

bool IsReady(const std::future<FlightResult>& result) {
  return result.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

// An empty input leaves the reply as it is.
std::size_t HostileCount(const HostileSequence& sequence) {
  return static_cast<std::size_t>(
      std::ranges::count_if(sequence.inputs, [](const LineBytes& input) { return !input.empty(); }));
}

std::size_t BytesCount(const HostileSequence& sequence) {
  std::size_t count = 0;
  for (const LineBytes& input : sequence.inputs) count += input.size();
  return count;
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

FlightJob FuzzCampaign::JobOf(const HostileSequence& sequence, std::string name, bool with_coverage) const {
  FlightJob job = options_.flight;
  job.name = std::move(name);
  job.scenario = FlightOf(job.scenario, sequence);
  job.coverage = with_coverage;
  job.tells_end = true;
  return job;
}

std::optional<BrokenFlight> FuzzCampaign::Fly(const HostileSequence& sequence, FlightResult* result,
                                              bool with_coverage) {
  return Fly(JobOf(sequence, fmt::format("repeat {}", repeats_count_++), with_coverage), result);
}

std::optional<BrokenFlight> FuzzCampaign::Fly(FlightJob job, FlightResult* result) {
  Engine engine({.tell = options_.tell, .interrupted = options_.interrupted});
  auto flown = engine.Submit(std::move(job));
  while (!engine.idle()) {
    engine.Poll();
    options_.on_turn();
  }
  if (!IsReady(flown)) return std::nullopt;
  const std::optional<FlightResult> got = ResultOf(flown);
  if (!got) return std::nullopt;
  if (result != nullptr) *result = *got;
  return BrokenIn(*got);
}

std::optional<BrokenFlight> FuzzCampaign::BrokenIn(const FlightResult& result) const {
  auto broken = BrokenBy(result);
  return broken ? broken : BrokenOutsideCalls(result, *options_.flight.scenario.link.protocol);
}

std::optional<BrokenFlight> FuzzCampaign::SeenAgain(const HostileSequence& sequence,
                                                    const FlightResult& result) {
  auto suspected = BrokenIn(result);
  if (!suspected || Known(*suspected)) return suspected;
  for (int flight = 0; flight < kSeenAgainFlights; ++flight)
    if (auto again = Fly(sequence)) return again;
  return std::nullopt;
}

std::optional<std::string> FuzzCampaign::WhyUnusable() {
  std::vector<CriterionSpec>& criteria = options_.flight.scenario.criteria;
  std::erase_if(criteria, DependsOnDesign);
  FlightResult result;
  const auto broken = Fly({.inputs = {}}, &result);
  if (interrupted()) return std::nullopt;
  if (broken) return broken->reason;
  sees_coverage_ = result.coverage_kind != CoverageKind::kBlackBox;
  HasNewFeature(result);
  if (result.score.verdict != Verdict::kPass) return result.score.reason;
  if (!options_.flight.means.realtime) criteria = CriteriaOfDesign();
  return std::nullopt;
}

std::vector<CriterionSpec> FuzzCampaign::CriteriaOfDesign() {
  std::vector<CriterionSpec> criteria = FuzzCriteria(*options_.flight.scenario.link.protocol);
  FlightJob job = options_.flight;
  job.name = "well-formed";
  job.scenario = WellFormedFlight(job.scenario);
  job.scenario.criteria = criteria;
  FlightResult well_formed;
  Fly(std::move(job), &well_formed);
  std::erase_if(criteria, [&](const CriterionSpec& criterion) {
    const auto why = WhyByDesign(criterion, well_formed);
    if (why) options_.tell(*why);
    return why.has_value();
  });
  return criteria;
}

std::size_t FuzzCampaign::AheadMax() const {
  return std::min<std::size_t>(kAheadMax, 1 + flights_count_ / kFlightsPerAhead);
}

HostileSequence FuzzCampaign::Narrowing::Half() const {
  HostileSequence half = whole;
  const auto middle = half.inputs.begin() + static_cast<std::ptrdiff_t>(half.inputs.size() / 2);
  if (second_half) {
    half.inputs.erase(half.inputs.begin(), middle);
  } else {
    half.inputs.erase(middle, half.inputs.end());
  }
  return half;
}

std::size_t FuzzCampaign::AtMostLeft(std::size_t count) const {
  if (!options_.runs_count) return count;
  return static_cast<std::size_t>(std::min<std::uint64_t>(count, *options_.runs_count - planned_count_));
}

HostileSequence FuzzCampaign::Next() {
  faults::Random random(faults::KeyOf(options_.seed, sequences_count_++));
  const std::size_t count = AtMostLeft(random.Below(8) == 0 ? 1 + random.Below(kInputsMax) : kInputsMax);
  HostileSequence parent, other;
  if (!corpus_.empty()) {
    // New ones lead on, old ones may have been left too early; those that were made small say which input counts.
    const std::size_t newest = std::min<std::size_t>(corpus_.size(), random.Below(2) == 0 ? 2 : 8);
    const std::size_t from = random.Below(2) == 0 ? corpus_.size() - newest : 0;
    const HostileSequence& one = corpus_[from + random.Below(corpus_.size() - from)];
    const HostileSequence& two = corpus_[from + random.Below(corpus_.size() - from)];
    parent = one.inputs.size() < two.inputs.size() ? one : two;
    other = corpus_[random.Below(corpus_.size())];
  }
  if (corpus_.empty() || random.Below(4) == 0) {
    parent = {};
    if (options_.reference_line && !references_.empty() && random.Below(4) == 0)
      parent.target = faults::Target::kReference;
  }
  const HostileFrames& frames = parent.target == faults::Target::kReference ? references_ : replies_;
  return ChangeSequence(parent, other, frames, count, random);
}

void FuzzCampaign::SortBefore() {
  std::ranges::stable_sort(before_, {}, [](const FromBefore& one) {
    return std::tuple(one.finding.empty(), BytesCount(one.sequence));
  });
  if (sees_coverage_) return;
  while (!before_.empty() && before_.back().finding.empty()) {
    corpus_.push_back(std::move(before_.back().sequence));
    before_.pop_back();
  }
}

void FuzzCampaign::Run() {
  Engine engine(
      {.jobs_count = options_.jobs_count, .tell = options_.tell, .interrupted = options_.interrupted});
  std::deque<Pending> pending;
  SortBefore();
  const auto goes_on = [&] {
    if (trouble_ || interrupted() || hangs_too_often()) return false;
    return options_.runs_count ? planned_count_ < *options_.runs_count : !options_.is_over();
  };
  const auto submit = [&](HostileSequence sequence, std::optional<Narrowing> narrowing,
                          std::optional<std::string> from_before) {
    FlightJob job = JobOf(sequence, fmt::format("flight {}", submitted_count_++));
    pending.push_back(
        {std::move(sequence), std::move(narrowing), std::move(from_before), engine.Submit(std::move(job))});
  };
  const auto fill = [&] {
    while (pending.size() < AheadMax() && goes_on()) {
      if (!before_.empty()) {
        submit(std::move(before_.front().sequence), std::nullopt, std::move(before_.front().finding));
        before_.pop_front();
        continue;
      }
      std::optional<Narrowing> narrowing;
      if (!narrowings_.empty()) {
        narrowing = std::move(narrowings_.front());
        narrowings_.pop_front();
      }
      HostileSequence next = narrowing ? narrowing->Half() : Next();
      next.inputs.resize(AtMostLeft(next.inputs.size()));
      planned_count_ += std::max<std::size_t>(1, HostileCount(next));
      submit(std::move(next), std::move(narrowing), std::nullopt);
    }
  };
  fill();
  while (!engine.idle()) {
    engine.Poll();
    if (!options_.runs_count && options_.is_over()) engine.DropWaiting();
    while (!pending.empty() && !trouble_ && !interrupted() && !hangs_too_often() &&
           IsReady(pending.front().result)) {
      Pending ended = std::move(pending.front());
      pending.pop_front();
      if (const auto result = ResultOf(ended.result)) Take(std::move(ended), *result);
      fill();
    }
    if (trouble_ || hangs_too_often()) engine.DropWaiting();
    options_.on_turn();
  }
}

std::uint64_t FuzzCampaign::SaidIn(const HostileSequence& sequence, const FlightResult& result) const {
  if (!result.score.faults.empty()) return static_cast<std::uint64_t>(result.score.faults[0].activations);
  const auto lost = std::ranges::find(result.events, kLostEvent, &FlightEvent::kind);
  const link::Protocol& protocol = *options_.flight.scenario.link.protocol;
  const TimeNs reached_ns = lost == result.events.end() ? 0 : FromSeconds(lost->time_s);
  if (reached_ns < HostileFrom(protocol)) return 0;
  const auto periods =
      static_cast<std::size_t>((reached_ns - HostileFrom(protocol)) / protocol.control_period_ns + 1);
  HostileSequence said = sequence;
  said.inputs.resize(std::min(said.inputs.size(), periods));
  return HostileCount(said);
}

void FuzzCampaign::Keep(const HostileSequence& sequence) {
  if (std::ranges::find(corpus_, sequence) != corpus_.end()) return;
  options_.on_corpus(sequence);
  corpus_.push_back(sequence);
}

// A half that breaks the firmware is refused: it would break all that is made from it.
void FuzzCampaign::Narrow(Narrowing narrowing, const FlightResult& result, bool breaks) {
  std::vector<std::uint32_t> reached;
  for (const std::uint32_t feature : result.coverage) reached.push_back(PlaceOf(feature));
  if (!breaks && std::ranges::includes(reached, narrowing.places)) {
    narrowing.whole = narrowing.Half();
    narrowing.second_half = false;
    narrowing.is_smaller = true;
  } else if (!narrowing.second_half) {
    narrowing.second_half = true;
  } else {
    if (narrowing.is_smaller) Keep(narrowing.whole);
    return;
  }
  if (narrowing.whole.inputs.size() <= 1) return Keep(narrowing.whole);
  narrowings_.push_back(std::move(narrowing));
}

void FuzzCampaign::Take(Pending ended, const FlightResult& result) {
  HostileSequence& sequence = ended.sequence;
  const bool is_judged = result.score.verdict != Verdict::kError;
  std::optional<BrokenFlight> broken = is_judged ? BrokenBy(result) : SeenAgain(sequence, result);
  if (!is_judged && !broken) {
    if (!interrupted()) trouble_ = result.score.reason;
    return;
  }
  runs_count_ += SaidIn(sequence, result);
  ++flights_count_;
  std::vector<std::uint32_t> new_places;
  const bool is_new = HasNewFeature(result, &new_places);
  if (ended.narrowing) {
    if (is_new && !broken) Keep(sequence);  // a half may also reach what the whole did not
    Narrow(std::move(*ended.narrowing), result, broken.has_value());
  } else if (ended.from_before) {
    if (is_new && !broken) corpus_.push_back(sequence);
    if (!ended.from_before->empty() && !broken) options_.on_mended(*ended.from_before);
  } else if (is_new && !broken) {
    Keep(sequence);
    if (!new_places.empty() && sequence.inputs.size() > 1)
      narrowings_.push_back({.whole = sequence, .places = std::move(new_places)});
  }
  if (!broken) return;
  const FlightResult* shown_by = &result;
  FlightResult longer;
  if (broken->kind == "silence" && !Known(*broken)) {
    // A loop is silent, too, until the flight is long enough.
    sequence.tail_periods = kHangTailPeriods;
    const auto hang = Fly(sequence, &longer);
    if (hang && hang->kind == "hang") {
      broken = hang;
      shown_by = &longer;
    }
  }
  const bool hangs = broken->kind == "hang";
  // The time of a process that was lost is unknown, and counts as the longest.
  const bool is_costly = hangs && (!shown_by->end_reason || shown_by->wall_s >= kCostlyHangS);
  if (is_costly) ++hangs_count_;
  sequence.tail_periods = hangs ? kHangTailPeriods : kTailPeriods;
  if (FuzzFinding* known = Known(*broken)) {
    ++known->flights_count;
    return;
  }
  // Drops the inputs after the flight's end: the firmware has not heard them.
  const std::uint64_t said = SaidIn(sequence, *shown_by);
  if (said > 0 && shown_by->end_reason != EndReason::kCompleted)
    sequence.inputs.resize(InputsUntil(sequence, said));
  findings_.push_back(
      {.broken = *broken, .sequence = std::move(sequence), .is_costly = is_costly, .at_runs = runs_count_});
  options_.on_finding(findings_.back());
}

FuzzFinding* FuzzCampaign::Known(const BrokenFlight& broken) {
  const auto known =
      std::ranges::find(findings_, broken.key,
                        [](const FuzzFinding& finding) -> const std::string& { return finding.broken.key; });
  return known == findings_.end() ? nullptr : &*known;
}

bool FuzzCampaign::HasNewFeature(const FlightResult& result, std::vector<std::uint32_t>* new_places) {
  bool is_new = false;
  for (const std::uint32_t feature : result.coverage) {
    const std::uint32_t place = PlaceOf(feature);
    if (place >= places_.size()) places_.resize(place + std::size_t{1});
    if (!places_[place] && new_places != nullptr) new_places->push_back(place);
    places_[place] = true;
    if (feature >= features_.size()) features_.resize(feature + std::size_t{1});
    if (features_[feature]) continue;
    features_[feature] = is_new = true;
    ++features_count_;
  }
  return is_new;
}

void FuzzCampaign::MinimiseFindings() {
  for (std::size_t i = 0; i < findings_.size() && !interrupted(); ++i) {
    Minimise(findings_[i], [&] { return interrupted() || options_.is_small_enough(findings_.size() - i); });
    options_.on_finding(findings_[i]);
  }
}

void FuzzCampaign::Minimise(FuzzFinding& finding, const std::function<bool()>& is_over) {
  const std::string& key = finding.broken.key;
  HostileSequence tried = finding.sequence;
  bool ended_early = false;
  const auto breaks = [&](const HostileSequence& sequence) {
    ended_early = ended_early || is_over();
    if (ended_early) return false;
    const auto broken = Fly(sequence);
    return broken && broken->key == key;
  };
  const std::size_t flights_max = finding.is_costly                ? kMinimiseHangsMax
                                  : options_.flight.means.realtime ? kMinimiseRealtimeMax
                                                                   : kMinimiseFlightsMax;
  finding.sequence.inputs =
      harness::Minimise<LineBytes>(finding.sequence.inputs,
                                   [&](const std::vector<LineBytes>& inputs) {
                                     tried.inputs = inputs;
                                     return breaks(tried);
                                   },
                                   // The input that breaks the firmware is mostly said last.
                                   {.tests_max = flights_max, .suspects_count = 1});
  std::vector<LineBytes>& inputs = finding.sequence.inputs;
  for (std::size_t i = 0; i < inputs.size() && !ended_early; ++i) {
    inputs[i] = harness::Minimise<std::uint8_t>(inputs[i],
                                                [&](const LineBytes& bytes) {
                                                  tried = finding.sequence;
                                                  tried.inputs[i] = bytes;
                                                  return breaks(tried);
                                                },
                                                {.tests_max = flights_max / inputs.size()});
  }
  finding.minimised = !ended_early && !interrupted();
  // Not with Ctrl-C, which ends flights.
  if (interrupted()) return;
  // As every other command flies it.
  const auto again = Fly(finding.sequence, nullptr, false);
  finding.confirmed = again && again->key == key;
  if (finding.confirmed) finding.broken.reason = again->reason;
}

}  // namespace tiltproof::harness
