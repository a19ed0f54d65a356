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

}  // namespace

void AddActivations(RunLog& log, std::span<const std::int64_t> counts) {
  // Counts of a part of another build, or damaged ones, may have any length.
  const std::size_t size = std::min(counts.size(), log.fault_activation_counts.size());
  for (std::size_t i = 0; i < size; ++i) log.fault_activation_counts[i] += counts[i];
}

void Append(RunLog& log, PlantLog&& part) {
  log.trace.AppendRows(std::move(part.rows));
  log.hover_input = part.hover_input;
  log.input_min = part.input_min;
  log.input_max = part.input_max;
  log.clients.resize(std::max(log.clients.size(), part.clients.size()));
  for (std::size_t i = 0; i < part.clients.size(); ++i) {
    log.clients[i].starts_accepted_count = part.clients[i].starts_accepted_count;
    MoveTo(log.clients[i].request_times_ns, std::move(part.clients[i].request_times_ns));
    MoveTo(log.clients[i].actuator_times_ns, std::move(part.clients[i].actuator_times_ns));
  }
  MoveTo(log.events, std::move(part.events));
  MoveTo(log.activations, std::move(part.activations));
  AddActivations(log, part.activation_counts);
}

void Append(RunLog& log, LineLog&& part, std::size_t client, Origin origin) {
  const Origin of_log = origin.OrPowerOn();
  log.link.Append(std::move(part.link).Shifted(of_log));
  for (BootEvent& event : part.events) log.events.push_back(ToRunEvent(std::move(event), of_log));
  ClientLog& own = log.clients.at(client);
  MoveTo(own.reply_latency_ns, std::move(part.reply_latency_ns));
  MoveTo(own.client_round_trip_ns, std::move(part.client_round_trip_ns));
  MoveTo(log.activations, std::move(part.activations));
  AddActivations(log, part.activation_counts);
  own.counts = part.counts;
  own.accepted_wrong_count = part.accepted_wrong_count;
  own.accepted_stale_count = part.accepted_stale_count;
  own.resync_max_ns = part.resync_max_ns;
}

void Append(RunLog& log, faults::FaultSchedule& counts, Origin origin) {
  AddActivations(log, counts.ActivationCounts());
  MoveTo(log.activations, counts.TakeActivations(origin));
}

void DropRecords(PlantLog& part) {
  part.rows.clear();
  for (PlantClientLog& client : part.clients) {
    client.request_times_ns.clear();
    client.actuator_times_ns.clear();
  }
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
