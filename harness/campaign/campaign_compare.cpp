#include "harness/campaign/campaign_compare.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "harness/report/json_fields.h"

namespace tiltproof::harness {
namespace {

constexpr std::size_t kChangedShown = 20;

std::string FaultText(const CampaignFault& fault) {
  return fmt::format("{}{}{} at {:.6g}, {:.6g} to {:.6g} s", fault.type, fault.place.empty() ? "" : " ",
                     fault.place, fault.severity, fault.start_s, fault.end_s);
}

// The draw of a run, without what the firmware made of it.
std::string DrawText(const CampaignRun& run) {
  std::string text = fmt::format("{}, seed {}", run.scenario, run.seed);
  for (const CampaignFault& fault : run.faults) text += "; " + FaultText(fault);
  return text;
}

bool IsSameDraw(const CampaignRun& a, const CampaignRun& b) {
  const auto same = [](const CampaignFault& x, const CampaignFault& y) {
    CampaignFault other = y;
    other.activations = x.activations;
    return x == other;
  };
  return a.seed == b.seed && a.scenario == b.scenario &&
         std::equal(a.faults.begin(), a.faults.end(), b.faults.begin(), b.faults.end(), same);
}

ComparedFlight FlightOf(const CampaignRun& run) {
  if (run.verdict == "pass") return {"pass", "", {}};
  return {run.verdict, run.criterion, run.time_s};
}

void Count(PairedCounts& counts, bool first, bool second) {
  ++(first ? second ? counts.both : counts.only_first : second ? counts.only_second : counts.neither);
}

using SignatureByRun = std::map<std::uint64_t, std::string>;

// The final signatures of a campaign; nothing when they are not known yet of all its failures.
std::optional<SignatureByRun> FinalSignatures(const CampaignStore& store) {
  SignatureByRun finals;
  for (const CampaignFailure& failure : store.Failures()) finals.emplace(failure.run, failure.signature);
  std::uint64_t failed_count = 0;
  store.ForEach([&](const CampaignRun& run) { failed_count += run.signature.empty() ? 0 : 1; });
  return finals.size() == failed_count ? std::optional(std::move(finals)) : std::nullopt;
}

class Comparer {
 public:
  Comparer(const CampaignStore& first, const CampaignStore& second)
      : first_finals_(FinalSignatures(first)), second_finals_(FinalSignatures(second)) {
    // Signatures of two kinds have nothing in common.
    const bool is_all = first_finals_ && second_finals_;
    if (!is_all) first_finals_ = second_finals_ = std::nullopt;
  }

  void Add(const CampaignRun& a, const CampaignRun& b) {
    ++result_.runs;
    first_firmware_.insert(a.firmware);
    second_firmware_.insert(b.firmware);
    NoteSignature(a, first_finals_, first_signatures_);
    NoteSignature(b, second_finals_, second_signatures_);
    if (a.trace_hash == b.trace_hash && !a.trace_hash.empty()) ++result_.identical;
    const auto judged = [](const CampaignRun& run) { return run.verdict == "pass" || run.verdict == "fail"; };
    if (!judged(a) || !judged(b)) {
      ++result_.not_judged;
      return;
    }
    const bool first = a.verdict == "pass", second = b.verdict == "pass";
    Count(result_.all, first, second);
    std::set<std::string> types;
    for (const CampaignFault& fault : a.faults) types.insert(fault.type);
    for (const std::string& type : types) Count(types_[type], first, second);
    TakeChange(a, b);
  }
  CampaignComparison Result() {
    static_cast<PairedDifference&>(result_.all) = DifferenceOf(result_.all);
    result_.all.name = "all";
    for (const auto& [type, counts] : types_) {
      ComparedRates& rates = result_.by_type.emplace_back();
      rates.name = type;
      static_cast<PairedCounts&>(rates) = counts;
      static_cast<PairedDifference&>(rates) = DifferenceOf(counts);
    }
    std::stable_sort(
        result_.by_type.begin(), result_.by_type.end(),
        [](const ComparedRates& a, const ComparedRates& b) { return a.difference < b.difference; });
    result_.first_firmware.assign(first_firmware_.begin(), first_firmware_.end());
    result_.second_firmware.assign(second_firmware_.begin(), second_firmware_.end());
    std::ranges::set_difference(second_signatures_, first_signatures_,
                                std::back_inserter(result_.new_signatures));
    std::ranges::set_difference(first_signatures_, second_signatures_,
                                std::back_inserter(result_.gone_signatures));
    return std::move(result_);
  }

 private:
  static void NoteSignature(const CampaignRun& run, const std::optional<SignatureByRun>& finals,
                            std::set<std::string>& signatures) {
    if (run.signature.empty()) return;
    const bool is_known = finals && finals->contains(run.number);
    signatures.insert(is_known ? finals->at(run.number) : run.signature);
  }

  void TakeChange(const CampaignRun& a, const CampaignRun& b) {
    const bool first = a.verdict == "pass", second = b.verdict == "pass";
    if (first == second && (first || a.criterion == b.criterion)) return;
    const char* change = first == second ? "other_criterion" : first ? "worse" : "better";
    ++(first == second ? result_.other_criterion : first ? result_.worse : result_.better);
    result_.changed.push_back({a.number, a.seed, change, FlightOf(a), FlightOf(b)});
  }

  std::optional<SignatureByRun> first_finals_, second_finals_;
  CampaignComparison result_;
  std::map<std::string, PairedCounts> types_;
  std::set<std::string> first_firmware_, second_firmware_, first_signatures_, second_signatures_;
};

std::string RatesLine(const ComparedRates& rates) {
  return fmt::format("{:<30} {:>8} {:>8} {:>8}   {:+7.2f} {:+7.2f} {:+7.2f}   {:.3g}\n", rates.name,
                     rates.count(), rates.only_first, rates.only_second, 100 * rates.difference,
                     100 * rates.low, 100 * rates.high, rates.p);
}

}  // namespace

CampaignComparison CompareCampaigns(const CampaignStore& first, const CampaignStore& second) {
  Comparer comparer(first, second);
  const std::string first_name = first.file().parent_path().string(),
                    second_name = second.file().parent_path().string();
  std::uint64_t runs = 0, only_in_second = 0;
  first.ForEachBeside(second, [&](const CampaignRun* a, const CampaignRun* b) {
    if (a == nullptr) ++only_in_second;
    if (a == nullptr || b == nullptr) return;
    if (!IsSameDraw(*a, *b))
      throw std::runtime_error(fmt::format(
          "{} and {} have different draws, so that they cannot be compared. Run {}:\n  {}\n  {}\nFly both "
          "with the same campaign file and seed.",
          first_name, second_name, a->number, DrawText(*a), DrawText(*b)));
    ++runs;
    comparer.Add(*a, *b);
  });
  if (runs == 0)
    throw std::runtime_error(fmt::format("{} and {} have no run in common", first_name, second_name));
  CampaignComparison result = comparer.Result();
  result.first = first_name;
  result.second = second_name;
  result.only_in_first = first.Count() - runs;
  result.only_in_second = only_in_second;
  return result;
}

std::string ToJsonLine(const CampaignComparison& comparison) { return JsonLine(ToJson(comparison)); }

std::string ComparisonTable(const CampaignComparison& comparison) {
  std::string text = fmt::format(
      "A: {} ({})\nB: {} ({})\n{} runs of both, {} with the same trace; B is better in {}, worse in {}, and "
      "fails "
      "by another criterion in {}\n",
      comparison.first, fmt::join(comparison.first_firmware, ", "), comparison.second,
      fmt::join(comparison.second_firmware, ", "), comparison.runs, comparison.identical, comparison.better,
      comparison.worse, comparison.other_criterion);
  if (comparison.not_judged > 0)
    text += fmt::format("{} runs could not be judged in one of them\n", comparison.not_judged);
  if (comparison.only_in_first + comparison.only_in_second > 0)
    text += fmt::format("{} runs are only in A, {} only in B\n", comparison.only_in_first,
                        comparison.only_in_second);
  text += fmt::format("\n{:<30} {:>8} {:>8} {:>8}   {:>23}   p\n", "passes of B less those of A", "flights",
                      "only A", "only B", "% (95 % from, to)");
  text += RatesLine(comparison.all);
  for (const ComparedRates& rates : comparison.by_type) text += RatesLine(rates);
  for (const auto& [signatures, title] : {std::pair(&comparison.new_signatures, "only in B"),
                                          std::pair(&comparison.gone_signatures, "only in A")})
    if (!signatures->empty())
      text += fmt::format("\nways to fail that are {}:\n  {}\n", title, fmt::join(*signatures, "\n  "));
  if (comparison.changed.empty()) return text;
  text += "\nchanged runs:\n";
  const auto flight = [](const ComparedFlight& one) {
    if (one.criterion.empty()) return one.verdict;
    return one.criterion + (one.time_s ? fmt::format(" at {:.3f} s", *one.time_s) : "");
  };
  for (std::size_t i = 0; i < std::min(comparison.changed.size(), kChangedShown); ++i) {
    const ChangedRun& run = comparison.changed[i];
    text +=
        fmt::format("  {:>8}  {}: {} -> {}\n", run.run, run.change, flight(run.first), flight(run.second));
  }
  if (comparison.changed.size() > kChangedShown)
    text += fmt::format("  and {} more\n", comparison.changed.size() - kChangedShown);
  return text;
}

}  // namespace tiltproof::harness
