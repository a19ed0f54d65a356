#include "harness/run/merge_logs.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace tiltproof::harness {
namespace {

template <class T>
void MoveTo(std::vector<T>& to, std::vector<T>&& from) {
  if (to.empty()) {
    to = std::move(from);
  } else {
    to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
  }
}

// A fault acts in one part alone, and each part knows all faults: the larger count is the fault's.
void TakeOverCounts(std::vector<std::int64_t>& to, const std::vector<std::int64_t>& from) {
  to.resize(std::max(to.size(), from.size()), 0);
  for (std::size_t i = 0; i < from.size(); ++i) to[i] = std::max(to[i], from[i]);
}

}  // namespace

void Append(RunLog& log, PlantLog&& part) {
  log.trace.AppendRows(std::move(part.rows));
  log.hover_input = part.hover_input;
  log.input_min = part.input_min;
  log.input_max = part.input_max;
  log.starts_accepted_count = part.starts_accepted_count;
  MoveTo(log.request_times_ns, std::move(part.request_times_ns));
  MoveTo(log.actuator_times_ns, std::move(part.actuator_times_ns));
  MoveTo(log.events, std::move(part.events));
  MoveTo(log.activations, std::move(part.activations));
  TakeOverCounts(log.fault_activation_counts, part.activation_counts);
}

void Append(RunLog& log, LineLog&& part, TimeNs origin) {
  part.link.ShiftOrigin(origin);
  log.link.Append(std::move(part.link));
  for (RunEvent& event : part.events) event.time_ns -= origin;
  MoveTo(log.reply_latency_ns, std::move(part.reply_latency_ns));
  MoveTo(log.client_round_trip_ns, std::move(part.client_round_trip_ns));
  MoveTo(log.events, std::move(part.events));
  MoveTo(log.activations, std::move(part.activations));
  TakeOverCounts(log.fault_activation_counts, part.activation_counts);
  log.counts = part.counts;
  log.accepted_wrong_count = part.accepted_wrong_count;
  log.accepted_stale_count = part.accepted_stale_count;
  log.resync_max_ns = part.resync_max_ns;
}

void Append(RunLog& log, faults::FaultSchedule& counts, TimeNs origin) {
  TakeOverCounts(log.fault_activation_counts, counts.ActivationCounts());
  MoveTo(log.activations, counts.TakeActivations(origin));
}

void DropRecords(PlantLog& part) {
  part.rows.clear();
  part.request_times_ns.clear();
  part.actuator_times_ns.clear();
  part.events.clear();
  part.activations.clear();
}

void DropRecords(LineLog& part) {
  part.link = {};
  part.reply_latency_ns.clear();
  part.client_round_trip_ns.clear();
  part.events.clear();
  part.activations.clear();
}

void SortByTime(RunLog& log) {
  const auto earlier = [](const auto& a, const auto& b) { return a.time_ns < b.time_ns; };
  std::stable_sort(log.events.begin(), log.events.end(), earlier);
  std::stable_sort(log.activations.begin(), log.activations.end(), earlier);
}

}  // namespace tiltproof::harness
