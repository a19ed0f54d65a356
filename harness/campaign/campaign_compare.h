// Two campaigns with the same draws, by two firmwares or two versions: which runs got better and worse.
//
//   const CampaignComparison comparison = CompareCampaigns(store, another);
//   Print(stdout, "{}", ComparisonTable(comparison));
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/campaign_store.h"
#include "harness/campaign/paired_rates.h"
#include "harness/report/json_text.h"
#include "harness/report/results.h"
#include "link/fields.h"

namespace tiltproof::harness {

// Pairs of flights that have something in common, and what their shares of passes say.
struct ComparedRates : PairedCounts, PairedDifference {
  std::string name;
  TILTPROOF_FIELDS(name, both, only_first, only_second, neither, difference, low, high, p)
};

struct ComparedFlight {
  std::string verdict, criterion;  // empty: it passed
  std::optional<double> time_s;
  TILTPROOF_FIELDS(verdict, criterion, time_s)
};
// A run that one passes and the other fails, or that both fail by different criteria.
struct ChangedRun {
  std::uint64_t run = 0, seed = 0;
  std::string change;  // "worse", "better", "other_criterion"
  ComparedFlight first, second;
  TILTPROOF_FIELDS(run, seed, change, first, second)
};

struct CampaignComparison {
  int format = kResultsFormat;
  std::string version{Version()};
  std::string first, second;  // the campaigns' folders
  std::vector<std::string> first_firmware, second_firmware;
  std::uint64_t runs = 0;  // that both have flown
  std::uint64_t only_in_first = 0, only_in_second = 0;
  std::uint64_t not_judged = 0;  // by at least one
  std::uint64_t identical = 0;   // flights with the same trace
  std::uint64_t better = 0, worse = 0, other_criterion = 0;
  ComparedRates all;
  std::vector<ComparedRates>
      by_type;  // flights with a fault of the type; the ones that got worse most, first
  std::vector<std::string> new_signatures,
      gone_signatures;              // final; first ones while a campaign is under way
  std::vector<ChangedRun> changed;  // in the order of the numbers
  TILTPROOF_FIELDS(format, version, first, second, first_firmware, second_firmware, runs, only_in_first,
                   only_in_second, not_judged, identical, better, worse, other_criterion, all, by_type,
                   new_signatures, gone_signatures, changed)
};

// Throws std::runtime_error where a run that both have was drawn differently (another seed, scenario or fault), or where
// they have no run in common.
CampaignComparison CompareCampaigns(const CampaignStore& first, const CampaignStore& second);

std::string ToJsonLine(const CampaignComparison& comparison);
// Lines for a person: totals, types, and the first changed runs.
std::string ComparisonTable(const CampaignComparison& comparison);

}  // namespace tiltproof::harness
