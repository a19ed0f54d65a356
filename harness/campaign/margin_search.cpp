#include "harness/campaign/margin_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr double kSection = 1e-6;  // six decades
constexpr double kNear = 1e-2;     // of the typical distance
constexpr double kFinest = 1e-12;  // of the range: no level is tried below
constexpr int kRangeParts = 24, kLimitParts = 32;
constexpr double kRangeStep = 1.0 / 4, kLimitStep = 1.0 / 8;  // in decades
constexpr double kLastPart = 1.0 / 8;  // of the way to the limit, where the levels are denser
constexpr double kDenser = 3.0;
constexpr double kRounding = 0.05;  // of a step: levels have few digits

// Levels are short, so that the one that is printed is the one that was flown: two digits more than the
// tolerance can tell apart.
int DigitsFor(double tolerance) {
  return 3 + std::max(1, static_cast<int>(std::ceil(-std::log10(tolerance))));
}

}  // namespace

MarginSearch::MarginSearch(const LevelRange& range, double tolerance)
    : range_(range),
      tolerance_(tolerance),
      digits_(DigitsFor(tolerance)),
      sign_(range.end > range.start ? 1.0 : -1.0),
      first_(range.start),
      mildest_(range.start),
      last_(range.end) {
  Check(tolerance > 0 && range.start != range.end, "a range with two ends, and a tolerance above 0");
  const bool logarithmic = range.scale == faults::Scale::kLogarithmic;
  const double length = range.end - range.start;
  const double typical =
      range.typical ? std::abs(*range.typical - range.harmless.value_or(range.start)) : 0.0;
  decades_ = logarithmic;
  if (logarithmic && range.start == 0) {
    const double near = std::abs(length) * kSection;
    first_ = Rounded(std::copysign(typical > 0 ? std::min(near, typical * kNear) : near, length));
    mildest_ = first_;
  } else if (logarithmic && range.end == 0) {
    last_ = Rounded(range.start * kSection);
  } else if (!logarithmic && typical > 0 && std::abs(length) * kNear > typical) {
    decades_ = true;
    origin_ = range.start;
    first_ = Rounded(range.start + std::copysign(typical * kNear, length));
  } else {
    Check(!logarithmic || range.start * range.end > 0, "a logarithmic scale does not cross 0");
  }
}

MarginSearch::Tried::const_iterator MarginSearch::FirstFailing() const {
  return std::find_if(tried_.begin(), tried_.end(), [](const auto& entry) { return entry.second == false; });
}

std::optional<double> MarginSearch::fails() const {
  const auto found = FirstFailing();
  return found == tried_.end() ? std::nullopt : std::optional(LevelOf(found->first));
}

std::optional<double> MarginSearch::survives() const {
  for (auto entry = FirstFailing(); entry != tried_.begin();)
    if ((--entry)->second) return LevelOf(entry->first);
  return std::nullopt;
}

void MarginSearch::Take(std::optional<bool> survived) {
  const std::optional<double> level = next();
  Check(level.has_value(), "a search that has not ended");
  Check(survived || is_beyond_limit(*level), "a level that can be judged");
  tried_[KeyOf(*level)] = survived;
}

bool MarginSearch::is_beyond_limit(double level) const {
  const auto limit = FirstFailing();
  return limit != tried_.end() && KeyOf(level) > limit->first;
}

std::optional<double> MarginSearch::next() const {
  if (const auto level = NextMildest()) return level;
  if (tried_.begin()->second != true) return std::nullopt;
  if (const auto level = NextOfRange(false)) return level;
  if (const auto level = NextOfLimit()) return level;
  if (const auto level = NextBelowLimit()) return level;
  return NextOfRange(true);
}

std::optional<double> MarginSearch::NextMildest() const {
  if (!Knows(mildest_)) return mildest_;
  const double milder = Rounded(mildest_ * kSection);
  const bool open = mildest_ != range_.start;
  return open && tried_.at(KeyOf(mildest_)) == false && !Knows(milder) ? std::optional(milder) : std::nullopt;
}

std::optional<double> MarginSearch::NextOfRange(bool whole) const {
  if (!Knows(first_)) return first_;
  const double way = *PlaceOf(last_) - *PlaceOf(first_);
  const double step = decades_ ? std::min(kRangeStep, way / kRangeParts) : way / kRangeParts;
  double before = first_;
  for (auto entry = std::next(tried_.find(KeyOf(first_)));
       entry != tried_.end() && entry->first <= KeyOf(last_); ++entry) {
    if (!whole && fails() && KeyOf(before) >= KeyOf(*fails())) return std::nullopt;
    const double level = LevelOf(entry->first);
    if (const auto between = Divided(before, level, step)) return between;
    before = level;
  }
  if (!whole && fails()) return std::nullopt;
  if (before != last_) return Divided(before, last_, step).value_or(last_);
  return Knows(range_.end) ? std::nullopt : std::optional(range_.end);
}

std::optional<double> MarginSearch::NextOfLimit() const {
  const std::optional<double> below = survives(), above = fails();
  if (!above) return std::nullopt;
  const double severer = Rounded(last_ * kSection);
  if (*above == range_.end && last_ != range_.end && !Knows(severer)) return severer;
  if (close(*below, *above)) return std::nullopt;
  // The limit may be far nearer to the start than the levels of the range could see.
  const bool first = *below == range_.start && (!decades_ || !PlaceOf(*below));
  if (first && std::abs(*above - range_.start) <= kFinest * std::abs(range_.end - range_.start))
    return std::nullopt;
  const double middle = Rounded(Between(*below, *above, first ? kRangeParts : 2));
  const bool inside = KeyOf(*below) < KeyOf(middle) && KeyOf(middle) < KeyOf(*above);
  return inside && !Knows(middle) ? std::optional(middle) : std::nullopt;
}

std::optional<double> MarginSearch::NextBelowLimit() const {
  const std::optional<double> limit = survives();
  const auto has_place = [&](const auto& entry) { return PlaceOf(LevelOf(entry.first)).has_value(); };
  const auto mildest = std::find_if(tried_.begin(), tried_.end(), has_place);
  const double from = *PlaceOf(LevelOf(mildest->first));
  const double way = PlaceOf(*limit).value_or(*PlaceOf(last_)) - from;
  const double step = decades_ ? std::min(kLimitStep, way / kLimitParts) : way / kLimitParts;
  for (auto entry = mildest; entry->first < KeyOf(*limit); ++entry) {
    const double level = LevelOf(std::next(entry)->first);
    const bool near = PlaceOf(level).value_or(from) - from > way * (1 - kLastPart);
    if (const auto between = Divided(LevelOf(entry->first), level, near ? step / kDenser : step))
      return between;
  }
  return std::nullopt;
}

bool MarginSearch::close(double survives, double fails) const {
  const double apart = std::abs(fails - survives);
  if (range_.whole && apart <= 1) return true;
  double reference = std::abs(fails - range_.harmless.value_or(range_.start));
  if (range_.scale == faults::Scale::kLogarithmic) {
    if (fails == 0) return true;  // beyond twelve decades
    reference = std::min(reference, std::max(std::abs(fails), std::abs(survives)));
  }
  return apart <= tolerance_ * reference;
}

std::optional<double> MarginSearch::PlaceOf(double level) const {
  if (!decades_) return std::abs(level - range_.start);
  const double distance = std::abs(level - origin_);
  if (distance == 0) return std::nullopt;
  const bool outward = std::abs(range_.end - origin_) > std::abs(range_.start - origin_);
  return outward ? std::log10(distance) : -std::log10(distance);
}

double MarginSearch::Between(double from, double to, double parts) const {
  const double a = from - origin_, b = to - origin_;
  if (!decades_ || a * b <= 0) return from + (to - from) / parts;
  return origin_ + a * std::pow(b / a, 1 / parts);
}

double MarginSearch::Rounded(double level) const {
  if (range_.whole) return std::round(level);
  return std::strtod(fmt::format("{:.{}e}", level, digits_ - 1).c_str(), nullptr);
}

std::optional<double> MarginSearch::Divided(double milder, double severer, double step) const {
  const std::optional<double> from = PlaceOf(milder), to = PlaceOf(severer);
  if (!from || !to) return std::nullopt;
  const double parts =
      std::ceil((*to - *from) / (range_.whole && !decades_ ? std::max(step, 1.0) : step) - kRounding);
  if (parts <= 1) return std::nullopt;
  const double level = Rounded(Between(milder, severer, parts));
  const bool inside = KeyOf(milder) < KeyOf(level) && KeyOf(level) < KeyOf(severer);
  return inside ? std::optional(level) : std::nullopt;
}

std::vector<LevelAnswer> MarginSearch::levels() const {
  std::vector<LevelAnswer> levels;
  for (const auto& [key, survived] : tried_) levels.push_back({LevelOf(key), survived});
  return levels;
}

std::vector<Pocket> MarginSearch::pockets() const {
  std::vector<Pocket> pockets;
  std::optional<Pocket> open;
  for (const LevelAnswer& answer : levels()) {
    if (answer.survived == false) {
      open = Pocket{open ? open->from : answer.level, answer.level};
    } else if (answer.survived && open) {
      pockets.push_back(*open);
      open.reset();
    }
  }
  return pockets;
}

std::optional<double> MarginSearch::survived_share() const {
  if (tried_.empty() || tried_.begin()->second != true || next()) return std::nullopt;
  double whole = 0.0, survived = 0.0;
  for (auto entry = std::next(tried_.begin()); entry != tried_.end(); ++entry) {
    const std::optional<double> from = PlaceOf(LevelOf(std::prev(entry)->first)),
                                to = PlaceOf(LevelOf(entry->first));
    if (!from || !to) continue;
    whole += *to - *from;
    if (std::prev(entry)->second == true && entry->second == true) survived += *to - *from;
  }
  return whole > 0 ? survived / whole : 0.0;
}

}  // namespace tiltproof::harness
