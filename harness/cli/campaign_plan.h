// A campaign before it is flown: its plan and its means, from the options of a command or from its database.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/campaign_draw.h"
#include "harness/campaign/campaign_tasks.h"
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
  std::filesystem::path resume;            // the folder of a campaign; or empty
  std::string confirm;                     // the client that flies failures again; or empty
  std::string executor = "local";          // or "slurm"
  std::optional<std::uint64_t> task_runs;  // runs of a task of Slurm
  bool no_report = false;
  bool no_progress = false;
  std::vector<std::string> command;  // as typed
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
// As it was planned; `meta`: of its database. Throws UsageError where this program cannot read it any more.
LoadedCampaign ReopenCampaign(std::map<std::string, std::string> meta);

// Draws no faults on computing for a scenario, by its place, whose flight without faults has shown that no firmware states
// a computing time. Throws UsageError when nothing is left to draw.
void LeaveOutComputing(LoadedCampaign& campaign, std::size_t base);

// The database in a campaign's folder.
std::filesystem::path DatabaseOf(const std::filesystem::path& folder);

}  // namespace tiltproof::harness
