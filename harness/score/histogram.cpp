#include "harness/score/histogram.h"

#include <algorithm>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

// Bins are of whole nanoseconds: a sample on an edge is never rounded to the wrong side of it.
class Bins {
 public:
  Bins(TimeNs first_ns, TimeNs width_ns, std::int64_t bin_count) : first_ns_(first_ns), width_ns_(width_ns) {
    for (std::int64_t i = 0; i <= bin_count; ++i)
      histogram_.edges.push_back(static_cast<double>(first_ns + i * width_ns) / 1e6);
    histogram_.counts.resize(histogram_.edges.size() + 1, 0);
  }

  void Add(TimeNs sample_ns) {
    const auto last = static_cast<std::int64_t>(histogram_.counts.size()) - 1;
    const std::int64_t bin =
        sample_ns < first_ns_ ? 0 : std::min((sample_ns - first_ns_) / width_ns_ + 1, last);
    CheckIndex(static_cast<std::size_t>(bin), histogram_.counts.size(), "a sample has a bin");
    ++histogram_.counts[static_cast<std::size_t>(bin)];
  }

  Histogram Take() && { return std::move(histogram_); }

 private:
  TimeNs first_ns_, width_ns_;
  Histogram histogram_;
};

}  // namespace

Histogram RequestPeriodHistogram(std::span<const TimeNs> request_times_ns, TimeNs control_period_ns) {
  Check(control_period_ns >= 120, "a control period has bins of a nanosecond or more");
  const TimeNs width_ns = control_period_ns / 120;
  Bins bins(control_period_ns - 20 * width_ns, width_ns, 40);
  for (std::size_t i = 1; i < request_times_ns.size(); ++i)
    bins.Add(request_times_ns[i] - request_times_ns[i - 1]);
  return std::move(bins).Take();
}

Histogram ReplyLatencyHistogram(std::span<const TimeNs> reply_latency_ns, TimeNs control_period_ns) {
  Check(control_period_ns >= 48, "a control period has bins of a nanosecond or more");
  Bins bins(0, control_period_ns / 48, 48);
  for (const TimeNs latency_ns : reply_latency_ns) bins.Add(latency_ns);
  return std::move(bins).Take();
}

}  // namespace tiltproof::harness
