#include "harness/campaign/margins.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>

namespace tiltproof::harness {
namespace {

std::optional<bool> SurvivedIn(const TrialResult& result) {
  if (result.answer == TrialResult::Answer::kUnknown) return std::nullopt;
  return result.answer == TrialResult::Answer::kSurvived;
}

class Searches {
 public:
  Searches(Trials& trials, const std::vector<MarginTask>& tasks, const FindMarginsOptions& options)
      : trials_(trials), tasks_(tasks), options_(options), margins_(tasks.size()) {
    for (const MarginTask& task : tasks_)
      searches_.push_back({MarginSearch(task.severity.range, options_.tolerance), {}, {}});
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
    std::map<double, TrialResult> results;  // by level
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
    job.departure = Departure{.trunk = of.job.name, .fault = of.fault};
    trials_.Start(job, [this, task, level](const TrialResult& result) { Take(task, level, result); });
  }

  void Take(std::size_t task, double level, const TrialResult& result) {
    Search& search = searches_[task];
    search.margin.flights_count += result.flights_count;
    search.results[level] = result;
    options_.on_level(tasks_[task], level, result);
    if (const std::optional<bool> survived = SurvivedIn(result);
        survived || search.levels.is_beyond_limit(level)) {
      search.levels.Take(survived);
      if (search.levels.next()) return TryLevel(task);
      Conclude(search, tasks_[task].fault);
    } else {
      search.margin.unknown = result;
      search.margin.unknown_level = level;
    }
    trials_.Forget(tasks_[task].job.name);
    margins_[task] = search.margin;
    options_.on_done(task, search.margin);
    BeginOne();
  }

  static void Conclude(Search& search, std::size_t fault) {
    Margin& margin = search.margin;
    margin.survives = search.levels.survives();
    margin.fails = search.levels.fails();
    margin.levels = search.levels.levels();
    margin.pockets = search.levels.pockets();
    margin.survived_share = search.levels.survived_share();
    if (margin.fails) margin.at_fails = search.results.at(*margin.fails);
    for (const LevelAnswer& answer : margin.levels)
      if (answer.survived == true && search.results.at(answer.level).activations.at(fault) == 0)
        margin.idle_levels.push_back(answer.level);
    for (const LevelAnswer& answer : margin.levels) {
      if (answer.survived != true) break;
      margin.is_random = margin.is_random || !search.results.at(answer.level).is_of_any_seed;
    }
  }

  Trials& trials_;
  const std::vector<MarginTask>& tasks_;
  const FindMarginsOptions& options_;
  std::vector<std::optional<Margin>> margins_;
  std::deque<Search> searches_;
  std::size_t begun_count_ = 0;
};

}  // namespace

double SurePassShare(int count) { return std::pow(0.05, 1.0 / count); }

std::string WhyNeverActed(const Margin& margin) {
  return fmt::format(
      "it never acted at any of the {} levels, so no flight tests it: check its window, its condition "
      "and the place where it acts",
      margin.levels.size());
}

MarginScan ScanOf(const Margin& margin, int repeat_count) {
  return {.levels = margin.levels,
          .pockets = margin.pockets,
          .survived_share = margin.survived_share,
          .idle_levels = margin.idle_levels,
          .seeds = margin.is_random ? repeat_count : 1,
          .sure_share = margin.is_random ? SurePassShare(repeat_count) : 1.0};
}

std::vector<std::optional<Margin>> FindMargins(Trials& trials, const std::vector<MarginTask>& tasks,
                                               const FindMarginsOptions& options) {
  return Searches(trials, tasks, options).Run();
}

}  // namespace tiltproof::harness
