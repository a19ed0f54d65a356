#include "harness/report/regression.h"

#include <algorithm>

namespace tiltproof::harness {
namespace {

template <class Named>
const Named* FindNamed(const std::vector<Named>& all, const std::string& name) {
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const Named& other) { return other.name == name; });
  return found == all.end() ? nullptr : &*found;
}

CriterionChange ChangeOf(const CriterionResult* before, const CriterionResult* after, double tolerance) {
  CriterionChange change;
  change.name = before != nullptr ? before->name : after->name;
  if (before != nullptr) {
    change.verdict_before = before->verdict;
    change.margin_before = before->margin;
  }
  if (after != nullptr) {
    change.verdict_after = after->verdict;
    change.margin_after = after->margin;
  }
  if (before == nullptr || after == nullptr) {
    change.worse = after == nullptr;
    return change;
  }
  const bool both = before->margin && after->margin;
  const double by = both ? *after->margin - *before->margin : 0.0;
  change.worse = after->verdict > before->verdict || by < -tolerance;
  change.better = after->verdict < before->verdict || by > tolerance;
  return change;
}

FlightChange ChangeOf(const FlightResult& before, const FlightResult& after, double tolerance) {
  FlightChange change;
  change.name = before.name;
  change.before = before.score.verdict;
  change.after = after.score.verdict;
  // An error has no criteria: its verdict says it all.
  if (after.score.verdict == Verdict::kError || before.score.verdict == Verdict::kError) return change;
  for (const CriterionResult& criterion : before.score.criteria)
    change.criteria.push_back(
        ChangeOf(&criterion, FindNamed(after.score.criteria, criterion.name), tolerance));
  for (const CriterionResult& criterion : after.score.criteria)
    if (FindNamed(before.score.criteria, criterion.name) == nullptr)
      change.criteria.push_back(ChangeOf(nullptr, &criterion, tolerance));
  return change;
}

}  // namespace

bool FlightChange::worse() const {
  return after > before ||
         std::any_of(criteria.begin(), criteria.end(), [](const auto& c) { return c.worse; });
}

bool FlightChange::better() const {
  return !worse() && (after < before ||
                      std::any_of(criteria.begin(), criteria.end(), [](const auto& c) { return c.better; }));
}

std::size_t Regression::worse_count() const {
  return static_cast<std::size_t>(
      std::count_if(flights.begin(), flights.end(), [](const auto& flight) { return flight.worse(); }));
}

std::size_t Regression::better_count() const {
  return static_cast<std::size_t>(
      std::count_if(flights.begin(), flights.end(), [](const auto& flight) { return flight.better(); }));
}

Regression CompareResults(const std::vector<FlightResult>& baseline, const std::vector<FlightResult>& now,
                          double tolerance) {
  Regression regression;
  for (const FlightResult& before : baseline) {
    if (const FlightResult* after = FindNamed(now, before.name))
      regression.flights.push_back(ChangeOf(before, *after, tolerance));
    else
      regression.missing.push_back(before.name);
  }
  for (const FlightResult& after : now)
    if (FindNamed(baseline, after.name) == nullptr) regression.added.push_back(after.name);
  return regression;
}

}  // namespace tiltproof::harness
