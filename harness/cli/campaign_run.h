// A campaign while it is flown: results go into its database, failures are flown once more for their files.
#pragma once

#include "harness/cli/campaign_plan.h"

namespace tiltproof::harness {

// Begins a campaign, or goes on with one. Returns the exit code.
int FlyCampaign(const CampaignOptions& options);
// Flies one task of a campaign on a cluster, whose folder is options.resume.
int FlyCampaignTask(const CampaignOptions& options, std::uint64_t number);
// Flies one of its runs once more, and compares it with the database.
int ShowCampaignRun(const CampaignOptions& options, std::uint64_t number);
// Prints how far it is.
int CampaignStatus(const std::filesystem::path& folder);

}  // namespace tiltproof::harness
