#include "harness/campaign/margin_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr double kSection = 1e-6;      // six decades
constexpr double kNear = 1e-2;         // of the typical distance
constexpr int kSectionsCount = 2;      // towards 0
constexpr int kPartsOfLastDecade = 4;  // of each half of it
constexpr double kFinest = 1e-12;      // of the range: no grid is drawn anew below

// Levels are short, so that the one that is printed is the one that was flown: two digits more than the
// tolerance can tell apart.
int DigitsFor(double tolerance) {
  return 3 + std::max(1, static_cast<int>(std::ceil(-std::log10(tolerance))));
}

}  // namespace

MarginSearch::MarginSearch(const LevelRange& range, double tolerance)
    : range_(range), tolerance_(tolerance), digits_(DigitsFor(tolerance)) {
  Check(tolerance > 0 && range.start != range.end, "a range with two ends, and a tolerance above 0");
  const bool logarithmic = range.scale == faults::Scale::kLogarithmic;
  const double length = range.end - range.start;
  const double typical =
      range.typical ? std::abs(*range.typical - range.harmless.value_or(range.start)) : 0.0;
  if (logarithmic && range.start == 0) {
    sections_left_ = kSectionsCount;
    const double near = std::abs(length) * kSection;
    SetDecades(0.0, std::copysign(typical > 0 ? std::min(near, typical * kNear) : near, length), range.end,
               true);
  } else if (logarithmic && range.end == 0) {
    sections_left_ = kSectionsCount;
    SetDecades(0.0, range.start, range.start * kSection, true);
  } else if (!logarithmic && typical > 0 && std::abs(length) * kNear > typical) {
    SetDecades(range.start, std::copysign(typical * kNear, length), length, true);
    grid_.insert(grid_.begin(), range.start);
  } else {
    Check(!logarithmic || range.start * range.end > 0, "a logarithmic scale does not cross 0");
    SetGrid(range.start, true, range.end, true);
  }
}

std::optional<double> MarginSearch::next() const {
  if (middle_) return middle_;
  return at_ < grid_.size() ? std::optional(grid_[at_]) : std::nullopt;
}

void MarginSearch::Take(bool survived) {
  const std::optional<double> level = next();
  Check(level.has_value(), "a search that has not ended");
  (survived ? survives_ : fails_) = level;
  if (middle_) {
    middle_.reset();
    Narrow();
  } else {
    TakeOnGrid(survived);
  }
}

void MarginSearch::TakeOnGrid(bool survived) {
  const bool open_start = range_.scale == faults::Scale::kLogarithmic && range_.start == 0;
  const bool open_end = range_.scale == faults::Scale::kLogarithmic && range_.end == 0;
  if (!survived) {
    const double level = grid_[at_];
    if (survives_) {
      Narrow();
    } else if (open_start && --sections_left_ > 0) {
      SetDecades(0.0, level * kSection, level, false);
    } else {
      grid_.clear();
      at_ = 0;
    }
    return;
  }
  if (++at_ < grid_.size()) return;
  if (fails_) {
    Narrow();  // the whole of a finer grid was survived
  } else if (open_end && sections_left_ > 0) {
    const double level = grid_.back();
    grid_ = {0.0};
    if (--sections_left_ > 0) SetDecades(0.0, level, level * kSection, true);
    at_ = 0;
    // It was tried.
    if (grid_.front() == level) grid_.erase(grid_.begin());
  }
}

void MarginSearch::Narrow() {
  grid_.clear();
  at_ = 0;
  if (close()) return;
  const bool open_end = range_.scale == faults::Scale::kLogarithmic && range_.end == 0;
  // The limit is far nearer to the start than the grid could see.
  const bool first = *survives_ == range_.start && !open_end;
  if (first && std::abs(*fails_ - range_.start) > kFinest * std::abs(range_.end - range_.start)) {
    SetGrid(*survives_, false, *fails_, false);
    if (!grid_.empty()) return;
  }
  const double middle = Rounded(Between(*survives_, *fails_, 0.5));
  if (middle != *survives_ && middle != *fails_) middle_ = middle;
}

bool MarginSearch::close() const {
  const double apart = std::abs(*fails_ - *survives_);
  if (range_.whole && apart <= 1) return true;
  double reference = std::abs(*fails_ - range_.harmless.value_or(range_.start));
  if (range_.scale == faults::Scale::kLogarithmic) {
    if (*fails_ == 0) return true;  // beyond twelve decades
    reference = std::min(reference, std::max(std::abs(*fails_), std::abs(*survives_)));
  }
  return apart <= tolerance_ * reference;
}

double MarginSearch::Between(double from, double to, double share) const {
  if (range_.scale == faults::Scale::kLinear || from * to <= 0) return from + share * (to - from);
  return from * std::pow(to / from, share);
}

double MarginSearch::Rounded(double level) const {
  if (range_.whole) return std::round(level);
  return std::strtod(fmt::format("{:.{}e}", level, digits_ - 1).c_str(), nullptr);
}

void MarginSearch::SetGrid(double from, bool with_from, double to, bool with_to) {
  grid_.clear();
  at_ = 0;
  const auto add = [&](double level) {
    // Rounding must not leave the grid's ends, nor repeat a level.
    const bool inside = (level - from) * (to - level) > 0 && (grid_.empty() || grid_.back() != level);
    if (inside) grid_.push_back(level);
  };
  if (with_from) grid_.push_back(from);
  for (int i = 1; i < kGridCount; ++i) add(Rounded(Between(from, to, static_cast<double>(i) / kGridCount)));
  if (with_to) grid_.push_back(to);
}

void MarginSearch::SetDecades(double origin, double near, double far, bool with_far) {
  grid_.clear();
  at_ = 0;
  const double ratio = far / near;
  const int count = std::max(1, static_cast<int>(std::ceil(2 * std::abs(std::log10(ratio)) - 1e-9)));
  const auto level = [&](double step) { return Rounded(origin + near * std::pow(ratio, step / count)); };
  for (int i = 0; i < count; ++i) {
    // The last decade before the end is where shares are no longer small: most pockets are there.
    const int parts = with_far && std::abs(far) > std::abs(near) && i >= count - 2 ? kPartsOfLastDecade : 1;
    for (int part = 0; part < parts; ++part) grid_.push_back(level(i + static_cast<double>(part) / parts));
  }
  if (with_far) grid_.push_back(origin + far);
}

}  // namespace tiltproof::harness
