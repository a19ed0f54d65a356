#include "faults/activity.h"

#include <algorithm>
#include <cmath>

namespace tiltproof::faults {
namespace {

// The active part of each period, at least 1 ns; kNever without a period.
TimeNs ActiveTimeOf(const FaultSpec& spec) {
  if (spec.period_ns == kNever) return kNever;
  const double active_ns = static_cast<double>(spec.period_ns) * spec.duty.value_or(1.0);
  return std::clamp<TimeNs>(std::llround(active_ns), 1, spec.period_ns);
}

}  // namespace

Activity::Activity(const FaultSpec& spec, const Window& window)
    : window_(window),
      period_ns_(spec.period_ns),
      active_ns_(ActiveTimeOf(spec)),
      delay_ns_(spec.after ? spec.after->delay_ns : 0),
      followed_ns_(spec.after ? kNever : kPowerOn),
      risen_ns_(!spec.when.empty() && spec.edge == Edge::kRising ? kNever : kPowerOn),
      by_level_(!spec.when.empty() && spec.edge == Edge::kLevel) {}

bool Activity::Contains(TimeNs t) const { return IsInActivePart(t) && ConditionHolds(t); }

bool Activity::Touches(TimeNs begin, TimeNs end) const {
  if (Contains(begin)) return true;
  for (TimeNs t = NextEdge(begin); t < end; t = NextEdge(t))
    if (Contains(t)) return true;
  return false;
}

TimeNs Activity::NextEdge(TimeNs t) const {
  const auto change = std::upper_bound(changes_.begin(), changes_.end(), t);
  return std::min(NextPartEdge(t), change == changes_.end() ? kNever : *change);
}

std::vector<Window> Activity::Stretches() const {
  std::vector<Window> stretches;
  TimeNs begin = window_.begin_ns;
  do {
    // A window of no length has no edge after its begin.
    const TimeNs end = std::min(NextPartEdge(begin), window_.end_ns);
    stretches.push_back({begin, end});
    begin = NextActivePart(end);
  } while (begin != kNever);
  return stretches;
}

Window Activity::Span() const {
  if (period_ns_ == kNever || window_.end_ns == kNever) return window_;
  const TimeNs last = window_.end_ns - 1;
  return {window_.begin_ns, std::min(last - Phase(last) + active_ns_, window_.end_ns)};
}

void Activity::OnFollowed(TimeNs t) {
  if (followed_ns_ == kNever) followed_ns_ = t + delay_ns_;
}

void Activity::OnCondition(TimeNs t, bool holds) {
  if (by_level_) {
    if (changes_.size() == kChangesMax) changes_.erase(changes_.begin(), changes_.begin() + 2);
    changes_.push_back(t);
  } else if (holds && risen_ns_ == kNever && followed_ns_ <= t && window_.Contains(t)) {
    risen_ns_ = t;
  }
}

Window Activity::OpenWindow() const {
  return {std::max({window_.begin_ns, followed_ns_, risen_ns_}), window_.end_ns};
}

TimeNs Activity::Phase(TimeNs t) const {
  return (t - (window_.begin_ns == kPowerOn ? followed_ns_ : window_.begin_ns)) % period_ns_;
}

bool Activity::IsInActivePart(TimeNs t) const {
  return OpenWindow().Contains(t) && (period_ns_ == kNever || Phase(t) < active_ns_);
}

bool Activity::ConditionHolds(TimeNs t) const {
  const auto changes = std::upper_bound(changes_.begin(), changes_.end(), t) - changes_.begin();
  return !by_level_ || changes % 2 == 1;
}

TimeNs Activity::NextActivePart(TimeNs t) const {
  const Window window = OpenWindow();
  TimeNs next = window.begin_ns;
  if (t >= next) {
    if (t >= window.end_ns || period_ns_ == kNever) return kNever;
    next = t - Phase(t) + period_ns_;
  } else if (period_ns_ != kNever && next != kNever && Phase(next) >= active_ns_) {
    next += period_ns_ - Phase(next);  // it opened in the rest of a period
  }
  return next < window.end_ns ? next : kNever;
}

TimeNs Activity::NextPartEdge(TimeNs t) const {
  if (!IsInActivePart(t)) return NextActivePart(t);
  if (active_ns_ == period_ns_) return window_.end_ns;  // never interrupted
  return std::min(t - Phase(t) + active_ns_, window_.end_ns);
}

}  // namespace tiltproof::faults
