#include "harness/cli/campaign_plan.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <utility>

#include "faults/registry.h"
#include "harness/cli/applicability.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/commands.h"
#include "harness/cli/search_flights.h"
#include "harness/cli/suite.h"
#include "harness/report/results.h"
#include "harness/scenario/reader.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

// Keys in the database.
constexpr const char* kSpecKey = "campaign";
constexpr const char* kClientKey = "client";
constexpr const char* kClientPrefix = "client.";
constexpr const char* kShardKey = "shard";
// There for scenarios whose firmware states no computing time.
std::string NoComputingKey(std::size_t i) { return fmt::format("no_computing.{}", i); }
std::string ScenarioKey(std::size_t i) { return fmt::format("scenario.{}", i); }

std::optional<std::uint64_t> Whole(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

CampaignSpec ReadSpec(const CampaignOptions& options, const RunClients& clients) {
  CampaignSpec spec;
  const bool has_file = std::any_of(options.paths.begin(), options.paths.end(),
                                    [](const auto& path) { return IsCampaignFile(path); });
  if (has_file && options.paths.size() > 1)
    throw UsageError(
        "campaign: takes one campaign file, or scenarios: a campaign file names its scenarios itself");
  if (has_file) {
    try {
      spec = ReadCampaignFile(options.paths.front(), BuildsOfClients(clients));
    } catch (const ScenarioError& error) {
      throw UsageError(error.what());
    }
  } else {
    for (const auto& path : options.paths)
      spec.scenarios.push_back(std::filesystem::absolute(path).lexically_normal().string());
  }
  if (options.runs_count) spec.runs_count = *options.runs_count;
  if (options.seed) spec.seed = static_cast<std::int64_t>(*options.seed);
  if (!options.firmware.empty()) spec.firmware = options.firmware;
  for (auto build = spec.firmware.begin(); build != spec.firmware.end(); ++build)
    if (std::find(spec.firmware.begin(), build, *build) != build)
      throw UsageError(fmt::format("--firmware: {} is named twice", *build));
  return spec;
}

// The scenarios, which every build can fly.
Suite LoadBases(const CampaignSpec& spec, const FlightMeans& means) {
  const std::vector<std::filesystem::path> paths(spec.scenarios.begin(), spec.scenarios.end());
  std::vector<std::string> builds = spec.firmware;
  if (builds.empty()) builds.emplace_back();
  Suite suite;
  for (const std::string& build : builds) {
    Suite of_build = LoadSuite(paths, means.clients, build);
    RemoveNotApplicable(means, true, of_build);
    if (build == builds.front()) suite = std::move(of_build);
  }
  for (const auto& warning : suite.warnings) Print(stderr, "warning: {}\n", warning);
  if (suite.scenarios.empty()) throw UsageError("campaign: there is no scenario to fly");
  return suite;
}

void CheckDrawsSomething(const LoadedCampaign& campaign, const DrawBase& base) {
  if (base.types.empty())
    throw UsageError(fmt::format("campaign: {}: this client can take no fault of the types that are drawn{}",
                                 base.scenario.name,
                                 campaign.left_out.empty() ? "" : ": " + campaign.left_out.begin()->second));
}

// The faults that can be drawn for a scenario.
void AddTypes(const SuiteScenario& base, const CampaignSpec& spec, LoadedCampaign& campaign) {
  SuiteScenario probed = base;
  faults::FaultSpec placeholder;
  placeholder.id = "draw-1";
  placeholder.type = kPlaceholderType;
  placeholder.start_ns = 0;
  placeholder.end_ns = base.scenario.duration_ns;
  probed.scenario.faults = {placeholder};
  const VehicleSignals& signals = base.model->signals();
  std::vector<EnvelopeRow> rows;
  for (const faults::FaultType& type : faults::FaultTypes()) {
    if (!IsDrawn(spec.draw, type)) continue;
    const std::vector<EnvelopeRow> of_type = RowsAtEveryPlace(type, base.scenario, signals);
    rows.insert(rows.end(), of_type.begin(), of_type.end());
  }
  const std::vector<std::string> reasons = ReasonsAgainst(campaign.means, probed, rows);
  std::vector<EnvelopeRow> possible;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (reasons[i].empty())
      possible.push_back(rows[i]);
    else
      campaign.left_out.try_emplace(std::string(rows[i].type->name), reasons[i]);
  }
  for (const EnvelopeRow& row : possible) campaign.left_out.erase(std::string(row.type->name));
  DrawBase& added = campaign.plan.bases.emplace_back();
  added.model = base.model;
  added.scenario = spec.draw.recover_s ? WithRecovery(base.scenario, *spec.draw.recover_s) : base.scenario;
  // A campaign asks which flights fail, and each scenario passes without drawn faults.
  added.scenario.expect = {};
  added.scenario.description.clear();
  added.scenario.criterion_places.clear();
  added.types = PrepareTypes(spec.draw, added.scenario, signals, possible);
  if (spec.draw.recover_s && FromSeconds(*spec.draw.recover_s) >= base.scenario.duration_ns)
    throw UsageError(fmt::format("draw.recover_s: {} leaves no time for faults in {}, which lasts {} s",
                                 *spec.draw.recover_s, base.scenario.name,
                                 ToSeconds(base.scenario.duration_ns)));
  CheckDrawsSomething(campaign, added);
}

void CheckTimes(const CampaignSpec& spec, const Scenario& scenario) {
  if (!spec.draw.start_s) return;
  const double latest_s = ToSeconds(scenario.duration_ns) - spec.draw.recover_s.value_or(0);
  if (latest_s <= 0) return;  // AddTypes() refuses recover_s
  const auto& values = spec.draw.start_s->values;
  if (std::all_of(values.begin(), values.end(),
                  [&](const NumberOrWord& value) { return std::get<double>(value) >= latest_s; }))
    throw UsageError(
        fmt::format("draw.start_s: every fault would begin after {} s, when no fault of {} may act any "
                    "more",
                    latest_s, scenario.name));
}

// Names of files and folders have characters that a campaign's name may not have (kNameRule).
std::string CampaignName(std::string text) {
  const auto is_plain = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
  };
  for (char& c : text)
    if (!is_plain(c) && c != '_' && c != '.') c = '-';
  if (text.empty() || !is_plain(text.front())) text.insert(0, "campaign-");
  return text.substr(0, kNameRule.length_max);
}

}  // namespace

Shard ReadShard(const std::string& text) {
  if (text.empty()) return {};
  const std::size_t slash = text.find('/');
  const auto number = Whole(std::string_view(text).substr(0, slash));
  const auto count =
      slash == std::string::npos ? std::nullopt : Whole(std::string_view(text).substr(slash + 1));
  if (!number || !count || *number < 1 || *number > *count || *count > 1'000'000)
    throw UsageError(fmt::format("--shard {}: must be K/N, part K of N parts, for example 1/4", text));
  return {*number, *count};
}

std::filesystem::path DatabaseOf(const std::filesystem::path& folder) { return folder / "campaign.sqlite"; }

LoadedCampaign PlanCampaign(const CampaignOptions& options) {
  LoadedCampaign campaign;
  campaign.shard = ReadShard(options.shard);
  CampaignSpec& spec = campaign.plan.spec;
  campaign.means = LockstepMeans(ReadClientFlags(options.clients), "campaign");
  spec = ReadSpec(options, campaign.means.clients);
  const Suite suite = LoadBases(spec, campaign.means);
  CheckReady(campaign.means);
  if (spec.name.empty()) spec.name = CampaignName(suite.name);
  spec.scenarios.clear();
  for (const SuiteScenario& base : suite.scenarios) {
    spec.scenarios.push_back(std::filesystem::absolute(base.scenario.file).string());
    CheckTimes(spec, base.scenario);
    campaign.meta[ScenarioKey(campaign.plan.bases.size())] = WriteResolved(base.scenario);
    AddTypes(base, spec, campaign);
  }
  campaign.meta[kSpecKey] = WriteCampaign(spec);
  campaign.meta[kFrameKey] = ToJsonText(MakeFrame(campaign.plan));
  campaign.meta["seed"] = std::to_string(spec.seed);
  campaign.meta["runs_count"] = std::to_string(spec.runs_count);
  campaign.meta["version"] = Version();
  campaign.meta["build"] = BuildOf(campaign.means.clients);
  campaign.meta[kClientKey] = ToText(campaign.means.clients.all);
  for (const auto& [id, client] : campaign.means.clients.by_id)
    campaign.meta[kClientPrefix + id] = ToText(client);
  campaign.meta[kShardKey] = fmt::format("{}/{}", campaign.shard.number, campaign.shard.count);
  return campaign;
}

void LeaveOutComputing(LoadedCampaign& campaign, std::size_t base) {
  DrawBase& of = campaign.plan.bases.at(base);
  const auto count = std::erase_if(of.types, [&](const DrawType& drawn) {
    if (drawn.type->needs != faults::Needs::kComputing) return false;
    campaign.left_out.try_emplace(
        std::string(drawn.type->name),
        fmt::format("{} stretches the computing time that a firmware states, and this one states none",
                    drawn.type->name));
    return true;
  });
  if (count == 0) return;
  CheckDrawsSomething(campaign, of);
  campaign.meta[NoComputingKey(base)] = "1";
  campaign.meta[kFrameKey] = ToJsonText(MakeFrame(campaign.plan));
}

LoadedCampaign ReopenCampaign(std::map<std::string, std::string> meta) {
  LoadedCampaign campaign;
  campaign.meta = std::move(meta);
  const auto value = [&](const std::string& key) -> const std::string& {
    const auto found = campaign.meta.find(key);
    if (found == campaign.meta.end())
      throw UsageError(fmt::format("the database has no '{}': it is not that of a campaign that began", key));
    return found->second;
  };
  try {
    campaign.shard = ReadShard(value(kShardKey));
    campaign.plan.spec = ParseCampaign(value(kSpecKey), "campaign.sqlite: campaign");
    std::vector<std::string> clients = {value(kClientKey)};
    for (const auto& [key, text] : campaign.meta)
      if (key.starts_with(kClientPrefix))
        clients.push_back(key.substr(std::string(kClientPrefix).size()) + "=" + text);
    campaign.means = LockstepMeans(ReadClientFlags(clients), "campaign");
    CheckReady(campaign.means);
    for (std::size_t i = 0; i < campaign.plan.spec.scenarios.size(); ++i) {
      LoadedScenario loaded = LoadAnnounced(value(ScenarioKey(i)));
      SuiteScenario base;
      base.scenario = std::move(loaded.scenario);
      base.model = std::move(loaded.model);
      AddTypes(base, campaign.plan.spec, campaign);
      if (campaign.meta.contains(NoComputingKey(i))) LeaveOutComputing(campaign, i);
    }
  } catch (const ScenarioError& error) {
    throw UsageError(error.what());
  }
  return campaign;
}

}  // namespace tiltproof::harness
