// A campaign before it is flown: its plan and its means, from the options of a command or from its database.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/campaign_draw.h"
#include "harness/campaign/campaign_store.h"
#include "harness/engine/flight_job.h"

namespace tiltproof::harness {

struct CampaignOptions {
  std::vector<std::filesystem::path> paths;  // one campaign file, or scenarios
  std::optional<std::int64_t> runs_count;
  std::optional<std::uint64_t> seed;
  std::vector<std::string> clients;
  std::vector<std::string> firmware;
  std::string shard;  // "K/N"; empty: all
  int jobs_count = 1;
  std::filesystem::path out = "results/campaign";
  std::filesystem::path resume;  // the folder of a campaign; or empty
  bool no_report = false;
  bool no_progress = false;
  std::vector<std::string> command;  // as typed
};

// Part `number` of `count` of the runs, from 1.
struct Shard {
  std::uint64_t number = 1, count = 1;
  // Its runs are [First, First of the next part).
  std::uint64_t First(std::uint64_t runs_count) const;
  std::uint64_t End(std::uint64_t runs_count) const { return Shard{number + 1, count}.First(runs_count); }
};
// Throws UsageError.
Shard ReadShard(const std::string& text);

struct LoadedCampaign {
  CampaignPlan plan;
  FlightMeans means;
  Shard shard;
  std::map<std::string, std::string> meta;      // for the database: all that ReopenCampaign() needs
  std::map<std::string, std::string> left_out;  // fault types that this client cannot take, with the reason
};

// Throws UsageError, with every problem of every file.
LoadedCampaign PlanCampaign(const CampaignOptions& options);
// As it was planned. Throws UsageError where this program cannot read it any more.
LoadedCampaign ReopenCampaign(const CampaignStore& store);

// The database in a campaign's folder.
std::filesystem::path DatabaseOf(const std::filesystem::path& folder);

}  // namespace tiltproof::harness
