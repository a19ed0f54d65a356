// Histograms of times: the period of the firmware's requests and the latency of the replies, as in the
// paper's Figure 14. Bins follow only from the protocol's control period, so the histograms of two flights
// can be compared.
//
//   const Histogram periods = RequestPeriodHistogram(log.clients[0].request_times_ns, 12 * kNsPerMs);
//   periods.counts.front();  // shorter than periods.edges.front()
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::harness {

// counts has one entry more than edges: below the first edge, then from each edge up to the next one
// (exclusive), then from the last edge on.
struct Histogram {
  std::vector<double> edges;  // ms
  std::vector<std::int64_t> counts;
  bool operator==(const Histogram&) const = default;
  TILTPROOF_FIELDS(edges, counts)
};

// Times between one request and the next, in 40 bins from 5/6 to 7/6 of the control period: for 12 ms, bins
// of 0.1 ms from 10 ms to 14 ms.
Histogram RequestPeriodHistogram(std::span<const TimeNs> request_times_ns, TimeNs control_period_ns);

// Latencies of replies, in 48 bins from 0 to the control period: for 12 ms, bins of 0.25 ms.
Histogram ReplyLatencyHistogram(std::span<const TimeNs> reply_latency_ns, TimeNs control_period_ns);

}  // namespace tiltproof::harness
