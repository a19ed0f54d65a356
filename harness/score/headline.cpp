#include "harness/score/headline.h"

#include <algorithm>
#include <array>
#include <limits>
#include <string_view>

namespace tiltproof::harness {
namespace {

constexpr std::array<std::string_view, 6> kPlannedSignals = {"t_s",     "x_ref_m",     "y_ref_m",
                                                             "z_ref_m", "yaw_ref_rad", "faults_active_count"};

bool IsPlanned(const stl::Formula& formula) {
  if (!formula) return true;
  if (formula->op == stl::Op::kSignal && !formula->name.starts_with(stl::kActivePrefix) &&
      std::find(kPlannedSignals.begin(), kPlannedSignals.end(), formula->name) == kPlannedSignals.end())
    return false;
  return IsPlanned(formula->left) && IsPlanned(formula->right);
}

}  // namespace

std::optional<bool> FaultCanAffect(const stl::Formula& formula, std::optional<TimeNs> decided_ns,
                                   std::optional<TimeNs> onset_ns) {
  if (!onset_ns) return std::nullopt;
  return !(decided_ns && *decided_ns < *onset_ns) && !IsPlanned(formula);
}

const CriterionResult* HeadlineCriterion(const Score& score) {
  const CriterionResult* least = nullptr;
  for (const CriterionResult& criterion : score.criteria) {
    if (!criterion.margin || (least != nullptr && *criterion.margin >= *least->margin)) continue;
    if (criterion.fault_can_affect.value_or(true) || criterion.verdict == Verdict::kFail) least = &criterion;
  }
  const bool failed = score.verdict == Verdict::kFail || score.verdict == Verdict::kError;
  return failed && least != nullptr && *least->margin > 0 ? nullptr : least;
}

std::optional<double> LeastMargin(const Score& score) {
  const CriterionResult* least = HeadlineCriterion(score);
  return least == nullptr ? std::nullopt : least->margin;
}

const CriterionResult* FirstViolated(const Score& score) {
  const auto time_s = [](const CriterionResult& criterion) {
    return criterion.time_s.value_or(std::numeric_limits<double>::infinity());
  };
  const CriterionResult* first = nullptr;
  for (const CriterionResult& criterion : score.criteria)
    if (criterion.verdict == Verdict::kFail && (first == nullptr || time_s(criterion) < time_s(*first)))
      first = &criterion;
  return first;
}

bool Survived(const Score& score) {
  return score.verdict == Verdict::kPass || score.cause == VerdictCause::kNeverActivated;
}

}  // namespace tiltproof::harness
