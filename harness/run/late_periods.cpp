#include "harness/run/late_periods.h"

#include <algorithm>

namespace tiltproof::harness {

LatePeriods CountLatePeriods(std::span<const LateSpan> late, TimeNs end_ns, TimeNs period_ns) {
  LatePeriods periods;
  std::int64_t counted_to = -1;  // the last period counted
  for (const LateSpan& span : late) {
    // The flight is over while the logs are gathered.
    if (span.begin_ns >= end_ns || span.end_ns <= 0) continue;
    periods.longest_ns = std::max(periods.longest_ns, span.end_ns - span.begin_ns);
    const std::int64_t first = std::max(std::max<TimeNs>(span.begin_ns, 0) / period_ns, counted_to + 1);
    const std::int64_t last = std::min(span.end_ns, end_ns - 1) / period_ns;
    if (last < first) continue;
    periods.count += last - first + 1;
    counted_to = last;
  }
  return periods;
}

}  // namespace tiltproof::harness
