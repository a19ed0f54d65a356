#include "harness/campaign/campaign_page.h"

#include <fmt/format.h>

#include "harness/campaign/campaign_summary.h"
#include "harness/report/json_fields.h"
#include "harness/report/report_page.h"

namespace tiltproof::harness {

bool HoldsCampaign(const std::filesystem::path& folder) {
  return std::filesystem::exists(folder / "campaign.json");
}

std::string CampaignPage(const std::filesystem::path& folder, const std::filesystem::path& to_folder,
                         const std::string& program) {
  const CampaignSummary summary = ReadCampaignSummary(folder / "campaign.json");
  Json json = ToJson(summary);
  for (std::size_t i = 0; i < summary.failures.size(); ++i) {
    const FailureGroup& group = summary.failures[i];
    Json& shown = json["failures"][i];
    const auto link = [&](const char* key, const std::filesystem::path& file) {
      if (std::filesystem::exists(folder / file)) shown[key] = (to_folder / file).lexically_normal().string();
    };
    const std::filesystem::path own = std::filesystem::path("failures") / group.signature;
    link("page", own / "report.html");
    shown["commands"]["show"] =
        fmt::format("{} campaign show {} {}", program, folder.string(), group.first_run);
    if (!group.minimal) continue;
    link("smallest", *group.minimal);
    shown["commands"]["smallest"] = fmt::format("{} run {}", program, (folder / *group.minimal).string());
  }
  return PageWith(CampaignPageTemplate(), "<script type=\"application/json\" id=\"campaign\">" +
                                              ScriptSafe(JsonText(json)) + "</script>\n");
}

}  // namespace tiltproof::harness
