// Runs of a campaign that another client flies again: what was found on the host in a second, confirmed on the image that
// will fly. Pure.
//
//   for (const std::uint64_t run : RunsToConfirm(store)) Fly(run);
//   const std::vector<CampaignConfirmed> confirmed = ConfirmedOf(store);
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/campaign_store.h"
#include "link/fields.h"

namespace tiltproof::harness {

// The first failures of each signature of which a flight is kept, and the passing runs with the least margin.
inline constexpr std::size_t kConfirmedPerSignature = 3;
inline constexpr std::size_t kConfirmedPasses = 100;
// Ascending. Final signatures must be known.
std::vector<std::uint64_t> RunsToConfirm(const CampaignStore& store);

// A flight as its verdict sums it up.
struct FlightOutcome {
  std::string verdict, criterion;
  std::optional<double> time_s, margin;
  bool operator==(const FlightOutcome&) const = default;
  TILTPROOF_FIELDS(verdict, criterion, time_s, margin)
};

struct ConfirmedRow {
  std::uint64_t run = 0;
  std::string signature;  // the final one; empty: it passed
  FlightOutcome campaign, confirmed;
  bool same = false;  // the same verdict, by the same criterion
  TILTPROOF_FIELDS(run, signature, campaign, confirmed, same)
};

// All that one client has flown again.
struct CampaignConfirmed {
  std::string client;
  std::uint64_t flights = 0, same = 0, differ = 0;
  std::vector<ConfirmedRow> rows;  // by number
  TILTPROOF_FIELDS(client, flights, same, differ, rows)
};
// By client. Runs that are not to be confirmed are left out: a shard may have confirmed more than the whole campaign does.
std::vector<CampaignConfirmed> ConfirmedOf(const CampaignStore& store);

// The flights that differ, a line each.
std::vector<std::string> DifferenceLines(const CampaignConfirmed& confirmed);

}  // namespace tiltproof::harness
