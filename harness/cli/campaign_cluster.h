// A campaign on a cluster: its runs in tasks that Slurm starts, and this process waits for them and gathers what they
// flew.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "harness/campaign/campaign_store.h"
#include "harness/cli/campaign_plan.h"

namespace tiltproof::harness {

struct ClusterFlying {
  std::filesystem::path folder;  // of the campaign
  const CampaignOptions& options;
  std::string name;  // of the campaign
  std::function<void(const std::string& line)> tell = [](const auto&) {};
  // Called with one line about how far the tasks are.
  std::function<void(const std::string& text)> on_turn = [](const auto&) {};
};
// Until all runs are in the store: gathers, submits the tasks that lack runs, waits, and again. Goes on with a job that
// an earlier call has submitted. False: interrupted, or tasks end without a result; that was said. Throws FileError, or
// as SubmitArray().
bool FlyOnCluster(CampaignStore& store, const ClusterFlying& flying);

// For `campaign status`: how many tasks were flown, fly, and wait; none when the campaign has no tasks.
std::optional<std::string> TasksText(const CampaignStore& store, const std::filesystem::path& folder);

}  // namespace tiltproof::harness
