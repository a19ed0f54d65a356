#include "harness/campaign/campaign_confirm.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "harness/campaign/campaign_failures.h"

namespace tiltproof::harness {
namespace {

std::string OutcomeText(const FlightOutcome& flight) {
  std::string text = flight.verdict;
  if (!flight.criterion.empty()) text += " " + flight.criterion;
  if (flight.time_s) text += fmt::format(" at {:.3f} s", *flight.time_s);
  if (flight.margin) text += fmt::format(", margin {:.3g}", *flight.margin);
  return text;
}

}  // namespace

std::vector<std::uint64_t> RunsToConfirm(const CampaignStore& store) {
  const std::vector<CampaignFailure> failures = store.Failures();
  std::map<std::string, std::size_t> left;
  for (const CampaignFailure& kept : KeptFailures(failures)) left[kept.signature] = kConfirmedPerSignature;
  std::set<std::uint64_t> runs;
  for (const CampaignFailure& failure : failures) {
    const auto of_signature = left.find(failure.signature);
    if (of_signature == left.end() || of_signature->second == 0) continue;
    --of_signature->second;
    runs.insert(failure.run);
  }
  std::set<std::pair<double, std::uint64_t>> nearest;
  store.ForEach([&](const CampaignRun& run) {
    if (run.verdict != "pass" || !run.margin) return;
    nearest.emplace(*run.margin, run.number);
    if (nearest.size() > kConfirmedPasses) nearest.erase(std::prev(nearest.end()));
  });
  for (const auto& [margin, run] : nearest) runs.insert(run);
  return {runs.begin(), runs.end()};
}

std::vector<CampaignConfirmed> ConfirmedOf(const CampaignStore& store) {
  const std::vector<CampaignConfirmation> all = store.Confirmations();
  if (all.empty()) return {};
  const std::vector<std::uint64_t> runs = RunsToConfirm(store);
  std::map<std::uint64_t, std::string> signatures;
  for (const CampaignFailure& failure : store.Failures()) signatures[failure.run] = failure.signature;
  std::map<std::string, CampaignConfirmed> by_client;
  for (const CampaignConfirmation& found : all) {
    if (!std::binary_search(runs.begin(), runs.end(), found.run)) continue;
    const std::optional<CampaignRun> run = store.Find(found.run);
    if (!run) continue;
    CampaignConfirmed& confirmed = by_client[found.client];
    confirmed.client = found.client;
    ConfirmedRow& row = confirmed.rows.emplace_back();
    row.run = found.run;
    if (const auto signature = signatures.find(found.run); signature != signatures.end())
      row.signature = signature->second;
    row.campaign = {run->verdict, run->criterion, run->time_s, run->margin};
    row.confirmed = {found.verdict, found.criterion, found.time_s, found.margin};
    row.same = found.verdict == run->verdict && found.criterion == run->criterion;
    ++confirmed.flights;
    ++(row.same ? confirmed.same : confirmed.differ);
  }
  std::vector<CampaignConfirmed> list;
  for (auto& [client, confirmed] : by_client) list.push_back(std::move(confirmed));
  return list;
}

std::vector<std::string> DifferenceLines(const CampaignConfirmed& confirmed) {
  std::vector<std::string> lines;
  for (const ConfirmedRow& row : confirmed.rows)
    if (!row.same)
      lines.push_back(
          fmt::format("run {}: {} -> {}", row.run, OutcomeText(row.campaign), OutcomeText(row.confirmed)));
  return lines;
}

}  // namespace tiltproof::harness
