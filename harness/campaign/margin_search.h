// The search for the largest severity below which every level is survived: levels out, answers in. Pure: it flies
// nothing.
//
//   MarginSearch search({.start = 0.0, .end = 10.0}, 0.01);
//   while (const std::optional<double> level = search.next()) search.Take(*level < 3.3);
//   search.survives();  // 3.28...
//   search.fails();     // 3.3...
//
// Limits are not monotonic: a higher level may be survived where a lower one is not. The search therefore
// 1. climbs from the harmless end to the first level that fails, by 24ths of the range, or by quarters of a decade;
// 2. bisects between this level and the one before it, until they differ by at most the tolerance;
// 3. tries levels below them, until neighbours are at most a 32nd of the way from the harmless end to the limit apart,
// and an eighth of a decade; in the last eighth of the way a third of that. One that fails is the new limit, and 2
// starts again;
// 4. goes on with 1 to the end of the range, to report where more severe levels are survived again.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include "faults/parameters.h"
#include "link/fields.h"

namespace tiltproof::harness {

// From the least to the most severe level. `end` may be less than `start`.
struct LevelRange {
  double start = 0.0, end = 1.0;
  // On a logarithmic scale one of the two may be 0. A `start` of 0 is itself never tried: the levels begin six
  // decades before `end`, or where `typical` says, and six decades before that where the first of them fails. An
  // `end` of 0 is tried, and before it six decades, twelve where the limit is there.
  faults::Scale scale = faults::Scale::kLinear;
  bool whole = false;                   // whole numbers only
  std::optional<double> harmless = {};  // the level at which nothing changes; it need not be in the range
  // A level at which a fault acts. Where `end` is more than a hundred times as far from `start`, as where it is
  // only the largest number allowed, the levels go by decades of the distance from `start`: from a hundredth of
  // the typical distance.
  std::optional<double> typical = {};
};

// One level, and its answer; none: the flight could not be judged.
struct LevelAnswer {
  double level = 0.0;
  std::optional<bool> survived;
  bool operator==(const LevelAnswer&) const = default;
  static constexpr bool kIsList = true;
  TILTPROOF_FIELDS(level, survived)
};

// Levels that fail, from `from` to `to`, and behind them one that is survived again.
struct Pocket {
  double from = 0.0, to = 0.0;
  bool operator==(const Pocket&) const = default;
  static constexpr bool kIsList = true;
  TILTPROOF_FIELDS(from, to)
};

class MarginSearch {
 public:
  // `tolerance`: the two levels of the limit differ by at most this share of the distance between the one that
  // fails and `harmless` (`start`, where there is none). On a logarithmic scale also at most by this share of the
  // larger of the two: where harmless stands for infinity, that is what counts.
  MarginSearch(const LevelRange& range, double tolerance);

  // The level to try; none when the search has ended.
  std::optional<double> next() const;
  // Takes the answer for the level next(): true: survived; none: not to be judged, which is allowed beyond the limit.
  void Take(std::optional<bool> survived);
  // More severe than one that fails.
  bool is_beyond_limit(double level) const;

  // The last level before the first that fails: none when the lowest one fails. The first that fails: none when all
  // are survived.
  std::optional<double> survives() const;
  std::optional<double> fails() const;
  // All that were tried, in the order of severity.
  std::vector<LevelAnswer> levels() const;
  // From the first that fails on.
  std::vector<Pocket> pockets() const;
  // The share of the range between neighbouring levels that are both survived, on its scale; without the range before
  // the first level of a scale of decades. None before the search has ended, or where the lowest level fails.
  std::optional<double> survived_share() const;

 private:
  // By severity: the level with the sign that makes the more severe one the larger.
  using Tried = std::map<double, std::optional<bool>>;

  double KeyOf(double level) const { return sign_ * level; }
  double LevelOf(double key) const { return sign_ * key + 0.0; }  // never -0
  bool Knows(double level) const { return tried_.contains(KeyOf(level)); }
  Tried::const_iterator FirstFailing() const;

  std::optional<double> NextMildest() const;
  // Up to the first level that fails, or to the end.
  std::optional<double> NextOfRange(bool whole) const;
  std::optional<double> NextOfLimit() const;
  std::optional<double> NextBelowLimit() const;
  // Where a level stands on the scale: its distance from `start`, or in decades from the first level; none: at the
  // place that decades never reach.
  std::optional<double> PlaceOf(double level) const;
  // The level at one of `parts` of the way from one to the other.
  double Between(double from, double to, double parts) const;
  double Rounded(double level) const;
  // A level that divides the way between two neighbours whose places are more than `step` apart; none: they are not,
  // or no other level is between them.
  std::optional<double> Divided(double milder, double severer, double step) const;
  bool close(double survives, double fails) const;

  LevelRange range_;
  double tolerance_;
  int digits_;   // significant ones of each level
  double sign_;  // +1 where more is more severe
  bool decades_ = false;
  double origin_ = 0.0;   // that distances are measured from, on a scale of decades
  double first_ = 0.0;    // the level at which they begin
  double mildest_ = 0.0;  // the first that is tried
  double last_ = 0.0;     // the last that is tried before an end of 0; else the range's end
  Tried tried_;
};

}  // namespace tiltproof::harness
