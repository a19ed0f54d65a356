#include "harness/campaign/campaign_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "harness/campaign/campaign_signature.h"
#include "harness/report/files.h"
#include "harness/report/json_fields.h"
#include "harness/report/repeats.h"

namespace tiltproof::harness {
namespace {

void PutRate(PassRate& rate, const std::array<std::uint64_t, 2>& counts) {
  rate.passed = counts[0];
  rate.failed = counts[1];
  rate.flights = counts[0] + counts[1];
  if (rate.flights == 0) return;
  rate.rate = static_cast<double>(rate.passed) / static_cast<double>(rate.flights);
  std::tie(rate.low, rate.high) = WilsonInterval(rate.passed, rate.flights);
}

std::vector<NamedRate> NamedRates(const std::map<std::string, std::array<std::uint64_t, 2>>& counts) {
  std::vector<NamedRate> rates;
  for (const auto& [name, of_name] : counts) {
    rates.emplace_back().name = name;
    PutRate(rates.back(), of_name);
  }
  return rates;
}

std::vector<BandRate> BandRates(const std::array<std::array<std::uint64_t, 2>, kBandsCount>& counts) {
  std::vector<BandRate> rates(kBandsCount);
  for (std::size_t band = 0; band < kBandsCount; ++band) {
    rates[band].band = band;
    PutRate(rates[band], counts[band]);
  }
  return rates;
}

std::size_t PhaseOf(const CampaignFrame& frame, const CampaignRun& run, const CampaignFault& fault) {
  const auto duration = frame.durations_s.find(run.scenario);
  if (duration == frame.durations_s.end() || !(duration->second > 0) || !(fault.start_s > 0)) return 0;
  const double share = std::min(fault.start_s / duration->second, 1.0);
  return std::min(static_cast<std::size_t>(share * kPhasesCount), kPhasesCount - 1);
}

}  // namespace

std::string ToJsonText(const CampaignFrame& frame) { return JsonText(ToJson(frame)); }

CampaignFrame FrameOf(const CampaignStore& store) {
  const std::optional<std::string> text = store.Meta(kFrameKey);
  try {
    if (!text) throw std::runtime_error("it is not there");
    return FromJson<CampaignFrame>(Json::parse(*text));
  } catch (const std::exception& error) {
    throw std::runtime_error(
        fmt::format("{}: the campaign's frame cannot be read: {}", store.file().string(), error.what()));
  }
}

std::optional<std::size_t> BandOf(const CampaignFrame& frame, const CampaignFault& fault) {
  std::optional<std::size_t> band;
  for (const CampaignRange& range : frame.ranges) {
    if (range.type != fault.type || range.place != fault.place) continue;
    if (range.levels.size() != kBandsCount + 1) return 0;
    const double sign = range.levels.back() < range.levels.front() ? -1.0 : 1.0;
    const bool is_on_this_side = sign * (fault.severity - range.levels.front()) >= 0;
    if (band && !is_on_this_side) continue;
    band = 0;
    for (std::size_t i = 1; i < kBandsCount; ++i)
      if (sign * (fault.severity - range.levels[i]) > 0) band = i;
    if (is_on_this_side) break;
  }
  return band;
}

std::string ToJsonText(const CampaignSummary& summary) { return JsonText(ToJson(summary), 1) + "\n"; }

CampaignSummary ReadCampaignSummary(const std::filesystem::path& file) {
  const std::string text = ReadFile(file);
  try {
    const Json json = Json::parse(text);
    CheckFormat(json);
    return FromJson<CampaignSummary>(json);
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

CampaignSummarizer::CampaignSummarizer(CampaignFrame frame, const std::vector<CampaignFailure>& failures)
    : frame_(std::move(frame)) {
  for (const CampaignFailure& failure : failures) finals_.emplace(failure.run, failure);
  // Rows that no run has are of interest, too: they were not drawn.
  for (const CampaignRange& range : frame_.ranges) {
    types_[range.type];
    places_[{range.type, range.place}];
  }
}

void CampaignSummarizer::Add(const CampaignRun& run) {
  ++flown_;
  std::optional<std::size_t> verdict;
  if (run.verdict == "pass") verdict = 0;
  if (run.verdict == "fail") verdict = 1;
  if (run.verdict == "error") ++errors_;
  if (run.verdict == "inconclusive") ++inconclusive_;
  if (verdict) {
    ++all_[*verdict];
    ++firmwares_[run.firmware][*verdict];
    ++scenarios_[run.scenario][*verdict];
  }
  AddFaults(run, verdict);
  if (!run.signature.empty()) AddFailure(run);
}

void CampaignSummarizer::AddFaults(const CampaignRun& run, std::optional<std::size_t> verdict) {
  std::set<std::string> types;
  std::set<std::pair<std::string, std::size_t>> bands_of_types;
  std::set<std::size_t> bands;
  for (const CampaignFault& fault : run.faults) {
    const std::uint64_t acted = fault.activations > 0 ? 1 : 0;
    OfType& type = types_[fault.type];
    ++type.drawn;
    type.activated += acted;
    types.insert(fault.type);
    OfPlace& place = places_[{fault.type, fault.place}];
    ++place.drawn;
    place.activated += acted;
    const std::optional<std::size_t> band = BandOf(frame_, fault);
    if (!band) continue;
    bands.insert(*band);
    bands_of_types.emplace(fault.type, *band);
    const std::size_t phase = PhaseOf(frame_, run, fault);
    ++place.drawn_cells[phase][*band];
    place.cells[phase][*band] += acted;
  }
  if (!verdict) return;
  for (const std::string& type : types) ++types_[type].flights[*verdict];
  for (const auto& [type, band] : bands_of_types) ++types_[type].bands[band][*verdict];
  for (const std::size_t band : bands) ++bands_[band][*verdict];
}

void CampaignSummarizer::AddFailure(const CampaignRun& run) {
  const auto final = finals_.find(run.number);
  const std::string& signature = final == finals_.end() ? run.signature : final->second.signature;
  const auto [entry, is_new] = groups_.try_emplace(signature);
  FailureGroup& group = entry->second;
  if (is_new) {
    group.signature = signature;
    group.criterion = run.criterion;
    group.end = run.end;
    group.types = TypesOf(signature);
    group.first_run = run.number;
    curve_.push_back({flown_, groups_.size()});
  }
  ++group.flights;
  if (group.runs.size() < kRunsNamedMax) group.runs.push_back(run.number);
  if (!group.minimal && final != finals_.end()) group.minimal = final->second.minimal;
}

CampaignCoverage CampaignSummarizer::CoverageOf() const {
  CampaignCoverage coverage;
  for (const auto& [type_and_place, place] : places_) {
    const auto is_of_place = [&key = type_and_place](const CampaignRange& range) {
      return range.type == key.first && range.place == key.second;
    };
    const auto range = std::find_if(frame_.ranges.begin(), frame_.ranges.end(), is_of_place);
    const bool is_known = range != frame_.ranges.end();
    // Without a severity there is one band.
    const std::size_t bands = !is_known ? 0 : range->levels.empty() ? 1 : kBandsCount;
    coverage.cells += kPhasesCount * bands;
    CoverageRow& row = coverage.rows.emplace_back();
    row.type = type_and_place.first;
    row.place = type_and_place.second;
    row.drawn = place.drawn;
    row.activated = place.activated;
    for (std::size_t phase = 0; phase < kPhasesCount; ++phase) {
      row.cells.emplace_back(place.cells[phase].begin(),
                             place.cells[phase].begin() + static_cast<std::ptrdiff_t>(bands));
      for (std::size_t band = 0; band < bands; ++band) {
        coverage.drawn += place.drawn_cells[phase][band] > 0 ? 1 : 0;
        coverage.covered += place.cells[phase][band] > 0 ? 1 : 0;
      }
    }
  }
  return coverage;
}

CampaignSummary CampaignSummarizer::Summary() const {
  CampaignSummary summary;
  summary.campaign = frame_.campaign;
  summary.seed = frame_.seed;
  summary.runs = frame_.runs_count;
  summary.flown = flown_;
  summary.inconclusive = inconclusive_;
  summary.errors = errors_;
  summary.complete = flown_ >= frame_.runs_count;
  PutRate(summary, all_);
  summary.by_firmware = NamedRates(firmwares_);
  summary.by_scenario = NamedRates(scenarios_);
  for (const auto& [name, type] : types_) {
    TypeRate& rate = summary.by_type.emplace_back();
    rate.type = name;
    rate.drawn = type.drawn;
    rate.activated = type.activated;
    PutRate(rate, type.flights);
    rate.bands = BandRates(type.bands);
  }
  // Types that no flight had stand last.
  std::stable_sort(summary.by_type.begin(), summary.by_type.end(), [](const TypeRate& a, const TypeRate& b) {
    return a.rate.value_or(2) < b.rate.value_or(2);
  });
  summary.by_severity = BandRates(bands_);
  for (const auto& [signature, group] : groups_) summary.failures.push_back(group);
  std::stable_sort(summary.failures.begin(), summary.failures.end(),
                   [](const FailureGroup& a, const FailureGroup& b) { return a.flights > b.flights; });
  summary.signatures = groups_.size();
  summary.curve = curve_;
  if (flown_ > 0 && (curve_.empty() || curve_.back().runs < flown_))
    summary.curve.push_back({flown_, groups_.size()});
  summary.coverage = CoverageOf();
  return summary;
}

CampaignSummary Summarize(const CampaignStore& store) {
  CampaignSummarizer summarizer(FrameOf(store), store.Failures());
  store.ForEach([&](const CampaignRun& run) { summarizer.Add(run); });
  CampaignSummary summary = summarizer.Summary();
  summary.confirmed = ConfirmedOf(store);
  return summary;
}

}  // namespace tiltproof::harness
