#include "harness/campaign/margins.h"

#include <fmt/format.h>

#include <algorithm>
#include <deque>

namespace tiltproof::harness {
namespace {

class Searches {
 public:
  Searches(Trials& trials, const std::vector<MarginTask>& tasks, const FindMarginsOptions& options)
      : trials_(trials), tasks_(tasks), options_(options), margins_(tasks.size()) {
    for (const MarginTask& task : tasks_)
      searches_.push_back({MarginSearch(task.severity.range, options_.tolerance), {}});
  }

  std::vector<std::optional<Margin>> Run() {
    for (std::size_t i = 0; i < options_.at_once_count; ++i) BeginOne();
    trials_.Fly();
    return std::move(margins_);
  }

 private:
  struct Search {
    MarginSearch levels;
    Margin margin;
  };

  void BeginOne() {
    if (begun_count_ < tasks_.size()) TryLevel(begun_count_++);
  }

  void TryLevel(std::size_t task) {
    const MarginTask& of = tasks_[task];
    const double level = *searches_[task].levels.next();
    FlightJob job = of.job;
    job.name += fmt::format(" with {} {}", of.severity.parameter, level);
    job.scenario = AtLevel(of.job.scenario, of.fault, of.severity, level);
    trials_.Start(job, [this, task, level](const TrialResult& result) { Take(task, level, result); });
  }

  void Take(std::size_t task, double level, const TrialResult& result) {
    auto& [levels, margin] = searches_[task];
    margin.flights_count += result.flights_count;
    options_.on_level(tasks_[task], level, result);
    if (result.answer == TrialResult::Answer::kUnknown) {
      margin.unknown = result;
      margin.unknown_level = level;
    } else {
      if (result.answer == TrialResult::Answer::kFailed) margin.at_fails = result;
      levels.Take(result.answer == TrialResult::Answer::kSurvived);
      if (levels.next()) return TryLevel(task);
      margin.survives = levels.survives();
      margin.fails = levels.fails();
    }
    margins_[task] = margin;
    options_.on_done(task, margin);
    BeginOne();
  }

  Trials& trials_;
  const std::vector<MarginTask>& tasks_;
  const FindMarginsOptions& options_;
  std::vector<std::optional<Margin>> margins_;
  std::deque<Search> searches_;
  std::size_t begun_count_ = 0;
};

}  // namespace

std::vector<std::optional<Margin>> FindMargins(Trials& trials, const std::vector<MarginTask>& tasks,
                                               const FindMarginsOptions& options) {
  return Searches(trials, tasks, options).Run();
}

}  // namespace tiltproof::harness
