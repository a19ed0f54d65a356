// The search for the least robust flight: points out, robustness in. Pure: it flies nothing.
//
//   RobustnessSearch search({SearchAxis{}, SearchAxis{.values_count = 3, .ordered = false}}, 7);
//   while (search.told_count() < 200) {
//     std::vector<double> robustness;
//     for (const SearchPoint& point : search.Ask()) robustness.push_back(point[0] - 0.1 * point[1]);
//     search.Tell(robustness);
//   }
//   search.best();  // near {0, 2}
//
// Each flight is expensive, so all that were flown choose the next ones: a smooth function through their robustness
// (radial basis functions, cubic, with a linear part) predicts the robustness of candidates. One point of a batch is
// taken from everywhere, the others from around the best point, by prediction and by distance from what was flown.
// Source: Regis and Shoemaker, A Stochastic Radial Basis Function Method for the Global Optimization of Expensive
// Functions, INFORMS Journal on Computing 19(4), 2007. The steps become smaller where they fail; where they end, the
// search starts again elsewhere. docs/search.md compares it with other methods.
//
// A batch depends only on the axes, the stream and what Tell() got, so it does not depend on the number of jobs.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "faults/random.h"

namespace tiltproof::harness {

// One number that is searched.
struct SearchAxis {
  int values_count = 0;  // 0: every number in [0, 1]; otherwise the whole numbers from 0 on, that many
  bool ordered = true;   // false: the whole numbers stand for names, and no two are nearer than others
};

// A number for each axis.
using SearchPoint = std::vector<double>;

// Points that are asked at once, after the first batch.
inline constexpr std::size_t kSearchBatch_count = 4;

class RobustnessSearch {
 public:
  // At least one axis. `stream` seeds all draws (faults/random.h); `first` is the first point asked.
  RobustnessSearch(std::vector<SearchAxis> axes, std::uint64_t stream, std::optional<SearchPoint> first = {});

  // The next points. Their robustness must be told before the next call. Points repeat only where whole numbers leave
  // no others.
  std::vector<SearchPoint> Ask();
  // The robustness of the asked points, in their order; smaller is worse for the firmware. It may be short where
  // flights ended the search. Infinite or NaN: unknown, taken as robust.
  void Tell(const std::vector<double>& robustness);

  std::size_t told_count() const { return told_.size(); }
  // The least robust point that was told, the earliest of several. Null before.
  const SearchPoint* best() const;

 private:
  struct Told {
    SearchPoint point;
    Eigen::VectorXd place;  // in the space of the function
    double robustness;
  };
  struct Candidate {
    SearchPoint point;
    Eigen::VectorXd place;
    double predicted, distance;
  };

  std::vector<SearchPoint> Spread(std::size_t count);
  std::vector<SearchPoint> ChooseNext();
  std::vector<Candidate> MakeCandidates();
  SearchPoint NearBest(std::size_t number);
  double Fold(double unit);
  double FromUnit(std::size_t axis, double unit) const;
  double ToUnit(std::size_t axis, double value) const;
  Eigen::VectorXd PlaceOf(const SearchPoint& point) const;
  // The place in told_ of the least robust since the last start.
  std::size_t BestSinceStart() const;

  std::vector<SearchAxis> axes_;
  faults::Random random_;
  std::optional<SearchPoint> first_;
  std::vector<SearchPoint> asked_;
  std::vector<Told> told_;
  std::size_t started_at_ = 0;  // in told_
  double step_;
  int successes_ = 0, failures_ = 0;  // batches in a row
  std::size_t chosen_count_ = 0;
};

}  // namespace tiltproof::harness
