// A fuzz campaign: hostile frames into a firmware, in short flights, and what they break. A sequence that reaches new code
// of the firmware joins the corpus, from which later ones are made. Without coverage of the firmware, each sequence is new.
//
//   FuzzCampaign campaign({.flight = job, .runs_count = 100'000, .seed = 7});
//   if (const auto trouble = campaign.WhyUnusable()) Complain(*trouble);
//   campaign.Run();
//   for (const FuzzFinding& finding : campaign.findings()) Report(finding.broken.reason);
//
// With runs_count, the same seed and the same corpus give the same findings for any number of jobs: each sequence is made
// from what a known number of flights before it have brought, in their order. That number lags little at first, so that
// short campaigns are guided, too. A sequence that reaches new code is cut to the inputs that do, as far as halves go.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/broken_flight.h"
#include "harness/campaign/hostile_sequence.h"
#include "harness/engine/engine.h"

namespace tiltproof::harness {

struct FuzzFinding {
  BrokenFlight broken;
  HostileSequence sequence;
  bool minimised = false;     // as far as it goes: otherwise time was over
  bool confirmed = false;     // it broke in the same way when it was flown once more, from a fresh start
  bool is_costly = false;     // each flight that breaks so takes seconds
  std::uint64_t at_runs = 0;  // inputs that had been said when it was found
  std::uint64_t flights_count = 1;  // flights that broke in this way
};

class FuzzCampaign {
 public:
  struct Options {
    FlightJob flight;  // with the scenario to which hostile frames are added
    int jobs_count = 1;
    std::optional<std::uint64_t> runs_count;  // inputs; none: until `is_over`
    std::function<bool()> is_over = [] { return false; };
    // True if the time is over in which a finding is made small. Asked with the number of findings that are still to be
    // made small, this one included.
    std::function<bool(std::size_t left_count)> is_small_enough = [](std::size_t) { return false; };
    std::uint64_t seed = 1;
    bool reference_line = true;                      // whether it is attacked, too
    const std::atomic<bool>* interrupted = nullptr;  // may be null
    std::function<void(const std::string& line)> tell = [](const auto&) {};
    std::function<void()> on_turn = [] {};  // about ten times per second
    std::function<void(const HostileSequence&)> on_corpus = [](const auto&) {};
    // A new one, and again when it is minimised.
    std::function<void(const FuzzFinding&)> on_finding = [](const auto&) {};
    // A finding of before, by its name, that did not break anything.
    std::function<void(const std::string& name)> on_mended = [](const auto&) {};
  };
  explicit FuzzCampaign(Options options);

  // Before all else: how the firmware fails without a hostile byte, if it does. Learns what it does by design, too.
  std::optional<std::string> WhyUnusable();
  // Adds a finding of an earlier campaign: it is flown before all else, so that a small one stays small. As Add().
  void AddFinding(std::string name, HostileSequence sequence) {
    before_.push_front({std::move(sequence), std::move(name)});
  }
  // Adds a sequence of an earlier corpus: it is flown first, short ones before long ones, and joins this corpus if it
  // reaches new places. Its inputs are not among runs_count. Without coverage, it joins as it is.
  void Add(HostileSequence sequence) { before_.push_back({std::move(sequence), ""}); }
  // Until its inputs are said, it is over, or it is interrupted.
  void Run();
  // Makes every finding small, as far as there is time, and flies it once more.
  void MinimiseFindings();

  // The scenario to which hostile frames are added, with its criteria.
  const Scenario& base() const { return options_.flight.scenario; }
  const std::vector<FuzzFinding>& findings() const { return findings_; }
  const std::vector<HostileSequence>& corpus() const { return corpus_; }
  std::uint64_t runs_count() const { return runs_count_; }        // inputs that were said
  std::uint64_t flights_count() const { return flights_count_; }  // without those that minimise
  std::uint64_t repeats_count() const { return repeats_count_; }  // flights that minimise, or look once more
  std::size_t features_count() const { return features_count_; }
  bool sees_coverage() const { return sees_coverage_; }
  // The firmware hung so often, and each time for seconds, that the campaign ended.
  bool hangs_too_often() const { return hangs_count_ >= kHangsMax; }
  // The flight that could not be judged, and ended the campaign.
  const std::optional<std::string>& trouble() const { return trouble_; }

 private:
  static constexpr int kHangsMax = 4;
  // The part of a sequence that reaches what is new: halves are flown as long as one of them reaches it, too.
  struct Narrowing {
    HostileSequence whole;
    std::vector<std::uint32_t> places;  // of the code, in order
    bool second_half = false;
    bool is_smaller = false;  // than what joined the corpus
    HostileSequence Half() const;
  };
  struct FromBefore {
    HostileSequence sequence;
    std::string finding;  // its name; empty: of the corpus
  };
  struct Pending {
    HostileSequence sequence;
    std::optional<Narrowing> narrowing;      // of which it is a half
    std::optional<std::string> from_before;  // the name of the finding; empty: of the corpus
    std::future<FlightResult> result;
  };

  std::size_t AheadMax() const;
  // As many inputs of `count` as are left to be planned.
  std::size_t AtMostLeft(std::size_t count) const;
  HostileSequence Next();
  FlightJob JobOf(const HostileSequence& sequence, std::string name, bool with_coverage = true) const;
  // Findings, then the corpus, or without those that must not be flown.
  void SortBefore();
  void Take(Pending ended, const FlightResult& result);
  void Keep(const HostileSequence& sequence);
  // The number of inputs said; if its result was lost, those until the time that it reached.
  std::uint64_t SaidIn(const HostileSequence& sequence, const FlightResult& result) const;
  std::optional<BrokenFlight> BrokenIn(const FlightResult& result) const;
  // The break in a flight that could not be judged, once this is surely the firmware's.
  std::optional<BrokenFlight> SeenAgain(const HostileSequence& sequence, const FlightResult& result);
  // The finding that is broken in the same way.
  FuzzFinding* Known(const BrokenFlight& broken);
  bool HasNewFeature(const FlightResult& result, std::vector<std::uint32_t>* new_places = nullptr);
  void Narrow(Narrowing narrowing, const FlightResult& result, bool breaks);
  std::optional<BrokenFlight> Fly(const HostileSequence& sequence, FlightResult* result = nullptr,
                                  bool with_coverage = true);
  // The same, of any flight.
  std::optional<BrokenFlight> Fly(FlightJob job, FlightResult* result);
  // Those that the firmware does not break by design.
  std::vector<CriterionSpec> CriteriaOfDesign();
  void Minimise(FuzzFinding& finding, const std::function<bool()>& is_over);
  bool interrupted() const {
    return options_.interrupted != nullptr && options_.interrupted->load(std::memory_order_relaxed);
  }

  Options options_;
  HostileFrames replies_, references_;
  std::deque<FromBefore> before_;  // to be flown first
  std::vector<HostileSequence> corpus_;
  std::vector<FuzzFinding> findings_;
  std::deque<Narrowing> narrowings_;  // whose half comes next
  std::vector<bool> features_, places_;
  std::size_t features_count_ = 0;
  bool sees_coverage_ = false;
  std::uint64_t planned_count_ = 0, runs_count_ = 0, flights_count_ = 0, sequences_count_ = 0;
  std::uint64_t submitted_count_ = 0, repeats_count_ = 0;
  int hangs_count_ = 0;
  std::optional<std::string> trouble_;
};

}  // namespace tiltproof::harness
