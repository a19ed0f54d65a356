#include "harness/cli/campaign_results.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "harness/campaign/campaign_compare.h"
#include "harness/campaign/campaign_failures.h"
#include "harness/campaign/campaign_summary.h"
#include "harness/cli/report_command.h"
#include "harness/cli/shared_options.h"
#include "harness/report/files.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

struct CompareCampaignsOptions {
  std::filesystem::path first, second;
  std::string format = "human";
};

struct MergeOptions {
  std::vector<std::filesystem::path> shards;
  std::filesystem::path out;
  bool no_report = false;
  std::string program;  // as it was called
};

void CheckHoldsRuns(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / kStoreFile))
    throw UsageError(
        fmt::format("{}: there is no campaign in this folder (no {})", folder.string(), kStoreFile));
}

int Compare(const CompareCampaignsOptions& options) {
  CampaignComparison comparison;
  CheckHoldsRuns(options.first);
  CheckHoldsRuns(options.second);
  try {
    comparison = CompareCampaigns(CampaignStore(options.first / kStoreFile, CampaignStore::Mode::kRead),
                                  CampaignStore(options.second / kStoreFile, CampaignStore::Mode::kRead));
  } catch (const FileError&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw UsageError(fmt::format("campaign compare: {}", error.what()));
  }
  if (options.format == "jsonl")
    Print(stdout, "{}\n", ToJsonLine(comparison));
  else
    Print(stdout, "{}", TextLines(ComparisonTable(comparison)));
  return comparison.worse > 0 ? kExitNotGreen : kExitGreen;
}

int Merge(const MergeOptions& options) {
  for (const auto& shard : options.shards) CheckHoldsRuns(shard);
  if (std::filesystem::exists(options.out / kStoreFile))
    throw UsageError(fmt::format("campaign merge: {} holds a campaign already: choose another --out",
                                 options.out.string()));
  try {
    MergeCampaigns(options.shards, options.out, {{"shard", "1/1"}});
  } catch (const FileError&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw UsageError(fmt::format("campaign merge: {}", error.what()));
  }
  const CampaignSummary summary = ReadCampaignSummary(options.out / "campaign.json");
  Print(stdout, "campaign {}: {} of {} runs from {} folders, {} failed in {} way{}; {}\n", summary.campaign,
        summary.flown, summary.runs, options.shards.size(), summary.failed, summary.signatures,
        summary.signatures == 1 ? "" : "s", (options.out / "campaign.json").string());
  if (!options.no_report) WriteCampaignReport(options.out, options.program);
  return kExitGreen;
}

}  // namespace

void RegisterCampaignResults(CLI::App& campaign, CommandLine& line) {
  const auto compared = std::make_shared<CompareCampaignsOptions>();
  CLI::App* compare = campaign.add_subcommand(
      "compare", "Compare two campaigns of the same draws: what got better and worse, with intervals");
  compare->add_option("A", compared->first, "Folder of a campaign")->required();
  compare->add_option("B", compared->second, "Folder of the other one: by another firmware or version")
      ->required();
  AddFormat(*compare, compared->format, "jsonl: everything in one line");
  SetAction(*compare, line, [compared] { return Compare(*compared); });

  const auto merged = std::make_shared<MergeOptions>();
  merged->program = line.words.front();
  CLI::App* merge = campaign.add_subcommand("merge", "Put shards of one campaign together");
  merge->add_option("DIR", merged->shards, "Folders of the shards, in any order")->required();
  merge->add_option("--out", merged->out, "Folder of the whole campaign")->required();
  merge->add_flag("--no-report", merged->no_report, "Write no page");
  SetAction(*merge, line, [merged] { return Merge(*merged); });
}

}  // namespace tiltproof::harness
