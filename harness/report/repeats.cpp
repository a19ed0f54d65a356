#include "harness/report/repeats.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "harness/score/headline.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

std::optional<double> SurvivedSeconds(const FlightResult& result) {
  const auto found = result.score.metrics.find("survival.time_s");
  return found == result.score.metrics.end() ? std::nullopt : std::optional(found->second);
}

// The smaller, the worse.
std::tuple<int, bool, double, double> Badness(const FlightResult& result) {
  const Verdict verdict = result.score.verdict;
  const int order = verdict == Verdict::kFail           ? 0
                    : verdict == Verdict::kInconclusive ? 1
                    : verdict == Verdict::kPass         ? 2
                                                        : 3;
  const double infinity = std::numeric_limits<double>::infinity();
  const std::optional<double> margin = LeastMargin(result.score);
  return {order, !margin, margin.value_or(0), SurvivedSeconds(result).value_or(infinity)};
}

}  // namespace

std::pair<double, double> WilsonInterval(std::size_t successes, std::size_t count) {
  Check(count > 0 && successes <= count, "successes of a count above 0");
  constexpr double kZ = 1.959963984540054;  // of the standard normal distribution, 97.5 %
  const auto n = static_cast<double>(count), share = static_cast<double>(successes) / n;
  const double z2 = kZ * kZ, centre = (share + z2 / (2 * n)) / (1 + z2 / n);
  const double half = kZ / (1 + z2 / n) * std::sqrt(share * (1 - share) / n + z2 / (4 * n * n));
  return {successes == 0 ? 0.0 : centre - half, successes == count ? 1.0 : centre + half};
}

std::vector<Repeats> RepeatsOf(std::span<const FlightResult> results,
                               const std::vector<std::string>& scenarios) {
  Check(results.size() == scenarios.size(), "a scenario for each result");
  std::vector<Repeats> all;
  for (std::size_t i = 0; i < results.size(); ++i) {
    const FlightResult& result = results[i];
    auto found = std::find_if(all.begin(), all.end(),
                              [&](const Repeats& other) { return other.scenario == scenarios[i]; });
    if (found == all.end()) {
      found = all.insert(all.end(), Repeats());
      found->scenario = scenarios[i];
      found->all_the_same = true;
      found->worst = &result;
    }
    ++found->flown;
    found->passed += result.score.verdict == Verdict::kPass ? 1 : 0;
    found->errors += result.score.verdict == Verdict::kError ? 1 : 0;
    found->all_the_same = found->all_the_same && result.is_of_any_seed;
    if (Badness(result) < Badness(*found->worst)) found->worst = &result;
  }
  for (Repeats& repeats : all) {
    const CriterionResult* least = HeadlineCriterion(repeats.worst->score);
    if (least != nullptr) repeats.margin = least->margin, repeats.criterion = least->name;
    repeats.survived_s = SurvivedSeconds(*repeats.worst);
  }
  return all;
}

}  // namespace tiltproof::harness
