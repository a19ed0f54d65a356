// campaign.html: one page that shows a campaign, with links to a flight and to the smallest scenario of each way to fail.
// It is made from campaign.json and from what stands beside it.
//
//   const std::string html = CampaignPage("results/night", ".", "tiltproof");
#pragma once

#include <filesystem>
#include <string>

namespace tiltproof::harness {

// True if a folder holds the summary of a campaign.
bool HoldsCampaign(const std::filesystem::path& folder);

// `to_folder`: from the page's folder to the campaign's, for links. `program`: as it was called, for the commands that the
// page shows. Throws FileError, or std::runtime_error naming the file.
std::string CampaignPage(const std::filesystem::path& folder, const std::filesystem::path& to_folder,
                         const std::string& program);

}  // namespace tiltproof::harness
