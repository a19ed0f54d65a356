// campaign.json: what a campaign found, computed from its rows. Pure, and the same bytes for the same rows: no clock, no
// order of flying, no machine.
//
//   CampaignSummarizer summarizer(frame, store.Failures());
//   store.ForEach([&](const CampaignRun& run) { summarizer.Add(run); });
//   const std::string text = ToJsonText(summarizer.Summary());
//
// docs/campaigns.md describes the file. Shares of flights that pass have Wilson's interval with 95 % confidence
// (harness/report/repeats.h). They count only flights that were judged: pass or fail.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "harness/campaign/campaign_confirm.h"
#include "harness/campaign/campaign_store.h"
#include "harness/report/json_text.h"
#include "harness/report/results.h"
#include "link/fields.h"

namespace tiltproof::harness {

inline constexpr std::size_t kBandsCount = 4;   // of a severity's range, from the mildest
inline constexpr std::size_t kPhasesCount = 4;  // of a flight, by the start of a fault's window

// Severities of a fault type at a place.
struct CampaignRange {
  std::string type, place, parameter, unit;
  // The ends of the bands, from the mildest level: kBandsCount + 1 levels, rising or falling. Empty: no number measures
  // the fault, and all of them are in the first band.
  std::vector<double> levels;
  bool operator==(const CampaignRange&) const = default;
  TILTPROOF_FIELDS(type, place, parameter, unit, levels)
};

// All that the rows do not hold. It is in the store, under kFrameKey, and the shards of one campaign have it in common.
struct CampaignFrame {
  std::string campaign;
  std::uint64_t seed = 0;
  std::uint64_t runs_count = 0;                 // of the whole campaign
  std::map<std::string, double> durations_s{};  // by scenario
  std::vector<CampaignRange> ranges{};          // by type and place; two where a severity has two sides
  bool operator==(const CampaignFrame&) const = default;
  TILTPROOF_FIELDS(campaign, seed, runs_count, durations_s, ranges)
};
inline constexpr const char* kFrameKey = "frame";
std::string ToJsonText(const CampaignFrame& frame);
// Throws std::runtime_error, which names the store, where there is none or it is damaged.
CampaignFrame FrameOf(const CampaignStore& store);

// The band of a level, from 0. None: the frame has no range for this type and place.
std::optional<std::size_t> BandOf(const CampaignFrame& frame, const CampaignFault& fault);

// Flights that were judged, and the share that passed.
struct PassRate {
  std::uint64_t flights = 0, passed = 0, failed = 0;
  std::optional<double> rate, low, high;  // none without a flight
  TILTPROOF_FIELDS(flights, passed, failed, rate, low, high)
};

struct NamedRate : PassRate {
  std::string name;
  TILTPROOF_FIELDS(name, flights, passed, failed, rate, low, high)
};

// Flights with a fault in a band of its severity, from 0 (mildest).
struct BandRate : PassRate {
  std::size_t band = 0;
  TILTPROOF_FIELDS(band, flights, passed, failed, rate, low, high)
};

// Flights with a fault of this type.
struct TypeRate : PassRate {
  std::string type;
  std::uint64_t drawn = 0, activated = 0;  // faults, not flights; activated: acted at least once
  std::vector<BandRate> bands;
  TILTPROOF_FIELDS(type, drawn, activated, flights, passed, failed, rate, low, high, bands)
};

// Faults that acted, by phase of the flight and band of severity.
struct CoverageRow {
  std::string type, place;
  std::uint64_t drawn = 0, activated = 0;
  std::vector<std::vector<std::uint64_t>> cells;  // [phase][band]
  TILTPROOF_FIELDS(type, place, drawn, activated, cells)
};
struct CampaignCoverage {
  std::size_t cells = 0;    // type x place x phase x band, of the types and places of the frame
  std::size_t drawn = 0;    // cells with a fault
  std::size_t covered = 0;  // cells with a fault that acted
  std::vector<CoverageRow> rows;
  TILTPROOF_FIELDS(cells, drawn, covered, rows)
};

// Failures with one final signature.
struct FailureGroup {
  std::string signature, criterion, end;
  std::vector<std::string> types;
  std::uint64_t flights = 0;
  std::uint64_t first_run = 0;
  std::vector<std::uint64_t> runs;     // the first ones, kRunsNamedMax at most
  std::optional<std::string> minimal;  // the smallest scenario, from the campaign's folder
  static constexpr bool kLeavesOutNull = true;
  TILTPROOF_FIELDS(signature, criterion, end, types, flights, first_run, runs, minimal)
};
inline constexpr std::size_t kRunsNamedMax = 20;

// After so many runs, by number, there were so many signatures.
struct CurvePoint {
  std::uint64_t runs = 0, signatures = 0;
  static constexpr bool kIsList = true;
  TILTPROOF_FIELDS(runs, signatures)
};

struct CampaignSummary : PassRate {
  int format = kResultsFormat;
  std::string version{Version()};
  std::string campaign;
  std::uint64_t seed = 0;
  std::uint64_t runs = 0;   // planned
  std::uint64_t flown = 0;  // judged or not
  std::uint64_t inconclusive = 0, errors = 0;
  bool complete = false;         // all planned runs were flown
  std::uint64_t signatures = 0;  // distinct final ones: the breadth
  std::vector<NamedRate> by_firmware, by_scenario;
  std::vector<TypeRate> by_type;       // the lowest share first
  std::vector<BandRate> by_severity;   // flights with a fault in this band
  std::vector<FailureGroup> failures;  // the one with most flights first
  std::vector<CurvePoint> curve;       // a point for each new signature, and the end
  CampaignCoverage coverage;
  std::vector<CampaignConfirmed> confirmed;  // on other clients
  TILTPROOF_FIELDS(format, version, campaign, seed, runs, flown, complete, flights, passed, failed, rate, low,
                   high, inconclusive, errors, signatures, by_firmware, by_scenario, by_type, by_severity,
                   failures, curve, coverage, confirmed)
};
std::string ToJsonText(const CampaignSummary& summary);
// Throws FileError, or std::runtime_error naming the file.
CampaignSummary ReadCampaignSummary(const std::filesystem::path& file);

class CampaignSummarizer {
 public:
  // `failures`: the final signatures. A failure without one counts with its first.
  CampaignSummarizer(CampaignFrame frame, const std::vector<CampaignFailure>& failures);
  // In the order of the numbers.
  void Add(const CampaignRun& run);
  CampaignSummary Summary() const;

 private:
  using Counts = std::array<std::uint64_t, 2>;  // passed, failed
  struct OfType {
    std::uint64_t drawn = 0, activated = 0;
    Counts flights{};
    std::array<Counts, kBandsCount> bands{};
  };
  struct OfPlace {
    std::uint64_t drawn = 0, activated = 0;
    std::array<std::array<std::uint64_t, kBandsCount>, kPhasesCount> drawn_cells{}, cells{};
  };

  void AddFaults(const CampaignRun& run, std::optional<std::size_t> verdict);
  void AddFailure(const CampaignRun& run);
  CampaignCoverage CoverageOf() const;

  CampaignFrame frame_;
  std::unordered_map<std::uint64_t, CampaignFailure> finals_;  // by run
  std::uint64_t flown_ = 0, inconclusive_ = 0, errors_ = 0;
  Counts all_{};
  std::map<std::string, Counts> firmwares_, scenarios_;
  std::map<std::string, OfType> types_;
  std::array<Counts, kBandsCount> bands_{};
  std::map<std::pair<std::string, std::string>, OfPlace> places_;
  std::map<std::string, FailureGroup> groups_;
  std::vector<CurvePoint> curve_;
};

// The summary of a store.
CampaignSummary Summarize(const CampaignStore& store);

}  // namespace tiltproof::harness
