// The search for the largest severity that is survived: levels out, answers in. Pure: it flies nothing.
//
//   MarginSearch search({.start = 0.0, .end = 10.0}, 0.01);
//   while (const std::optional<double> level = search.next()) search.Take(*level < 3.3);
//   search.survives();  // 3.28...
//   search.fails();     // 3.3...
//
// Limits are not monotonic: a higher level may be survived where a lower one is not. The search therefore goes
// from the harmless end of its range upwards on a grid, stops at the first level that fails, and then bisects
// between this level and the last that was survived. What it finds is the first limit, seen from the harmless
// end, as far as the grid can see it.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "faults/parameters.h"

namespace tiltproof::harness {

// From the least to the most severe level. `end` may be less than `start`.
struct LevelRange {
  double start = 0.0, end = 1.0;
  // On a logarithmic scale one of the two may be 0. A `start` of 0 is itself never tried: the grid begins six
  // decades before `end`, or where `typical` says, and six decades before that where its first level fails. An
  // `end` of 0 is the last level, after twelve decades.
  faults::Scale scale = faults::Scale::kLinear;
  bool whole = false;                   // whole numbers only
  std::optional<double> harmless = {};  // the level at which nothing changes; it need not be in the range
  // A level at which a fault acts. Where `end` is more than a hundred times as far from `start`, as where it is
  // only the largest number allowed, the grid's levels are not equidistant: they begin at a hundredth of the
  // typical distance and go on by half decades.
  std::optional<double> typical = {};
};

class MarginSearch {
 public:
  // Intervals of the first grid. A grid whose first interval has the limit is drawn anew in that interval.
  static constexpr int kGridCount = 12;

  // `tolerance`: the search ends when the two levels differ by at most this share of the distance between the
  // one that fails and `harmless` (`start`, where there is none). On a logarithmic scale also at most by this
  // share of the larger of the two: where harmless stands for infinity, that is what counts.
  MarginSearch(const LevelRange& range, double tolerance);

  // The level to try; none when the search has ended.
  std::optional<double> next() const;
  // Whether the level next() is survived.
  void Take(bool survived);

  // The last level that was survived: none when the lowest one fails. The first that fails: none when the
  // highest one is survived.
  std::optional<double> survives() const { return survives_; }
  std::optional<double> fails() const { return fails_; }

 private:
  double Between(double from, double to, double share) const;
  double Rounded(double level) const;
  // Levels from `from` to `to`, with or without each of them.
  void SetGrid(double from, bool with_from, double to, bool with_to);
  void TakeOnGrid(bool survived);
  // From origin + near to origin + far by half decades.
  void SetDecades(double origin, double near, double far, bool with_far);
  // After the first level that fails.
  void Narrow();
  bool close() const;

  LevelRange range_;
  double tolerance_;
  int digits_;                // significant ones of each level
  std::vector<double> grid_;  // in the order of severity; empty: between two levels
  std::size_t at_ = 0;
  int sections_left_ = 0;  // of six decades, towards the 0 at one end
  std::optional<double> middle_;
  std::optional<double> survives_, fails_;
};

}  // namespace tiltproof::harness
