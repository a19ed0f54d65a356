#include "harness/campaign/least_robust.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <future>
#include <limits>
#include <utility>

#include "faults/random.h"
#include "harness/score/headline.h"

namespace tiltproof::harness {
namespace {

// A failure without a margin, such as a crash of the firmware.
constexpr double kBroken = -1;

SearchFlight SearchFlightOf(const FlightResult& result) {
  SearchFlight flight{.point = {},
                      .verdict = result.score.verdict,
                      .margin = LeastMargin(result.score),
                      .criterion = "",
                      .reason = result.score.reason};
  if (const CriterionResult* headline = HeadlineCriterion(result.score)) flight.criterion = headline->name;
  return flight;
}

class PointFlights {
 public:
  PointFlights(const LeastRobustTask& task, const LeastRobustOptions& options)
      : task_(task),
        options_(options),
        points_(AxesOf(task.numbers), faults::StreamKey(task.job.scenario.seed, {"search"}),
                PointOf(task.numbers)),
        engine_(
            {.jobs_count = options.jobs_count, .tell = options.tell, .interrupted = options.interrupted}) {}

  LeastRobust Run() {
    while (found_.flights.size() < task_.flights_count_max && !FliesNoMore()) FlyBatch();
    return std::move(found_);
  }

 private:
  bool FliesNoMore() const {
    return found_.interrupted || (!found_.flights.empty() && found_.flights.back().verdict == Verdict::kFail);
  }

  void FlyBatch() {
    std::vector<SearchPoint> points = points_.Ask();
    points.resize(std::min(points.size(), task_.flights_count_max - found_.flights.size()));
    std::vector<std::future<FlightResult>> flown;
    for (const SearchPoint& point : points) flown.push_back(Submit(point));
    while (!engine_.idle()) engine_.Poll();
    std::vector<double> robustness;
    for (std::size_t i = 0; i < points.size() && !FliesNoMore(); ++i) {
      if (options_.interrupted != nullptr && options_.interrupted->load(std::memory_order_relaxed)) {
        found_.interrupted = true;
        return;
      }
      const FlightResult result = flown[i].get();
      robustness.push_back(RobustnessOf(result.score));
      Take(points[i], SearchFlightOf(result), robustness.back());
    }
    points_.Tell(robustness);
  }

  std::future<FlightResult> Submit(const SearchPoint& point) {
    FlightJob job = task_.job;
    job.name += fmt::format(", search {}", ++submitted_count_);
    try {
      job.scenario = AtPoint(task_.job.scenario, task_.numbers, point);
    } catch (const std::exception& error) {
      std::promise<FlightResult> not_flown;
      not_flown.set_value(ErrorResult(job, error.what()));
      return not_flown.get_future();
    }
    return engine_.Submit(std::move(job));
  }

  void Take(const SearchPoint& point, SearchFlight flight, double robustness) {
    flight.number = found_.flights.size() + 1;
    flight.point = point;
    found_.has_margins = found_.has_margins || flight.margin.has_value();
    // Among flights that were not judged the first one that was is the least.
    const bool is_least =
        found_.flights.empty() || robustness < least_ ||
        (std::isinf(robustness) && std::isinf(least_) &&
         found_.flights[found_.least_place].verdict == Verdict::kError && flight.verdict != Verdict::kError);
    if (is_least) {
      least_ = robustness;
      found_.least_place = found_.flights.size();
    }
    found_.flights.push_back(std::move(flight));
    options_.on_flight(found_.flights.back(), is_least);
  }

  const LeastRobustTask& task_;
  const LeastRobustOptions& options_;
  RobustnessSearch points_;
  Engine engine_;
  LeastRobust found_;
  double least_ = std::numeric_limits<double>::infinity();
  std::size_t submitted_count_ = 0;
};

}  // namespace

double RobustnessOf(const Score& score) {
  const std::optional<double> margin = LeastMargin(score);
  if (score.verdict == Verdict::kFail) return margin && *margin < 0 ? *margin : kBroken;
  if (score.verdict == Verdict::kError || !margin) return std::numeric_limits<double>::infinity();
  return *margin;
}

const SearchFlight* LeastRobust::least() const {
  if (flights.empty() || flights[least_place].verdict == Verdict::kError) return nullptr;
  return &flights[least_place];
}

LeastRobust FindLeastRobust(const LeastRobustTask& task, const LeastRobustOptions& options) {
  return PointFlights(task, options).Run();
}

}  // namespace tiltproof::harness
