// The failures of a campaign: their smallest scenarios in failures/<signature>/, and campaign.json.
//
//   MinimiseFailures(store, folder, [&](std::uint64_t run) { return SmallestOf(run); });
//   WriteSummary(store, folder);
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "harness/campaign/campaign_store.h"

namespace tiltproof::harness {

// The smallest scenario that fails like a run.
struct MinimalForm {
  std::vector<std::string> types;  // of its faults
  std::string scenario;            // the text of its file
};
// None: the run was not minimised; it is interrupted, or cannot be.
using Minimiser = std::function<std::optional<MinimalForm>(std::uint64_t run)>;

// Minimises the first kMinimisedPerSignature flights of each first signature, in the order of the numbers, writes
// failures/<signature>/run-<number>.yaml for each and scenario.yaml for the first of each final signature, and gives
// every failure its final signature. What an earlier call minimised is kept. Throws FileError.
void MinimiseFailures(CampaignStore& store, const std::filesystem::path& folder, const Minimiser& minimise);

// Flights are kept of so many signatures: one takes some megabytes.
inline constexpr std::size_t kKeptMax = 100;
// The failures of which a campaign keeps a flight: the first of each of the most frequent final signatures.
// `failures`: in the order of the runs.
std::vector<CampaignFailure> KeptFailures(std::span<const CampaignFailure> failures);

// Adds the runs of a part of the same campaign. A run that both have must be the same, apart from wall_s. Throws
// std::runtime_error that names `part`, and the run or the keys in which the two differ. `of_part`: keys of Meta() that
// may differ.
void AddRunsOf(const CampaignStore& from, const std::string& part, const std::set<std::string>& of_part,
               CampaignStore& into);

// campaign.json, from what the store holds.
void WriteSummary(const CampaignStore& store, const std::filesystem::path& folder);

// Merges the shards of one campaign: folders with a campaign.sqlite. `folder` is created, or has no campaign yet; it
// has one only when everything is in it, the flights that shards have kept included. A run that several shards have must be the same in all of them, apart from
// wall_s. Throws std::runtime_error that names the run and the shards, where it is not, or where they are not of
// the same campaign. `of_shard`: keys of the store's Meta() in which shards differ, and their values for the whole.
void MergeCampaigns(std::span<const std::filesystem::path> shards, const std::filesystem::path& folder,
                    const std::map<std::string, std::string>& of_shard);

inline constexpr const char* kStoreFile = "campaign.sqlite";

}  // namespace tiltproof::harness
