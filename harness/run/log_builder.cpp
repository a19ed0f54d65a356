#include "harness/run/log_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "faults/activity.h"
#include "faults/registry.h"
#include "harness/run/line.h"
#include "harness/run/protocol_use.h"

namespace tiltproof::harness {
namespace {

constexpr std::size_t kReservedRowsMax = 10'000;  // two minutes

template <class T>
void SortByTime(std::vector<T>& records) {
  std::stable_sort(records.begin(), records.end(),
                   [](const T& a, const T& b) { return a.time_ns < b.time_ns; });
}

// Calls visit(row, value) for the last value at or before the time of each row; both are in order of time.
template <class T, class Visit>
void ForEachRow(Trace& trace, const std::vector<std::pair<TimeNs, T>>& values, const Visit& visit) {
  std::size_t next = 0;
  for (std::size_t row = 0; row < trace.row_count(); ++row) {
    while (next < values.size() && ToSeconds(values[next].first) <= trace.at(row, 0)) ++next;
    if (next > 0) visit(row, values[next - 1]);
  }
}

bool IsKnown(const record::Bytes& bytes) {
  return static_cast<std::size_t>(bytes.direction) < link::kDirectionCount &&
         bytes.side <= ByteSide::kPassedOn;
}

}  // namespace

LogBuilder::LogBuilder(const Scenario& scenario, const VehicleSignals& vehicle, RecordSink* observer,
                       const LogParts& parts)
    : scenario_(scenario),
      layout_(vehicle, scenario),
      observer_(observer),
      parts_(parts),
      lines_(scenario.lines.size()) {
  for (std::size_t client = 0; client < scenario.client_count(); ++client)
    clients_.emplace_back(*scenario.link.protocol);
  log_.trace = Trace(layout_.columns);
  const TimeNs period_ns = scenario.link.protocol->control_period_ns;
  log_.trace.Reserve(
      std::min(static_cast<std::size_t>(scenario.duration_ns / period_ns) + 2, kReservedRowsMax));
  log_.fault_activation_counts.assign(scenario.faults.size(), 0);
  log_.clients.resize(scenario.client_count());
  for (std::size_t client = 0; scenario.has_several_clients() && client < log_.clients.size(); ++client)
    log_.clients[client].id = scenario.client_id(client);
}

void LogBuilder::Write(const Record& record) {
  const std::size_t owner = record.client.value_or(0);
  if (owner >= clients_.size()) {
    const auto* bytes = std::get_if<record::Bytes>(&record.body);
    const bool is_line = owner - clients_.size() < lines_.size();
    if (parts_.bytes && is_line && bytes != nullptr && IsKnown(*bytes))
      lines_[owner - clients_.size()].Append(record.time_ns, bytes->bytes, {owner, bytes->direction},
                                             bytes->side);
    return;
  }
  if (observer_ != nullptr) observer_->Write(record);
  std::visit([&](const auto& body) { Add(record, body); }, record.body);
}

void LogBuilder::Add(const Record& /*of*/, const record::Row& row) {
  Trace& trace = log_.trace;
  if (row.values.size() != trace.columns().size() || !std::isfinite(row.values[0])) return;
  const std::size_t count = trace.row_count();
  // A node that was started again has a clock of its own.
  if (count > 0 && row.values[0] <= trace.at(count - 1, 0)) return;
  std::copy(row.values.begin(), row.values.end(), trace.AppendRow().begin());
}

void LogBuilder::Add(const Record& of, const record::Bytes& bytes) {
  if (!IsKnown(bytes)) return;
  const std::size_t client = of.client.value_or(0);
  if (bytes.direction == link::Direction::kToPlant && bytes.side == ByteSide::kSent)
    clients_[client].history.Receive(of.time_ns, bytes.bytes);
  if (parts_.bytes)
    clients_[client].link.Append(of.time_ns, bytes.bytes, {client, bytes.direction}, bytes.side);
}

void LogBuilder::Add(const Record& of, const record::Counters& counters) {
  clients_[of.client.value_or(0)].counters.emplace_back(of.time_ns, counters.counts);
}

void LogBuilder::Add(const Record& of, const record::Event& event) {
  log_.events.push_back({of.time_ns, event.kind, event.text, of.client});
}

void LogBuilder::Add(const Record& of, const record::FirmwareText& line) {
  std::string& log = ClientOf(of).firmware_log;
  if (log.size() > kFirmwareLogBytesMax) return;
  log += fmt::format("{:.6f} {}\n", ToSeconds(of.time_ns), line.text);
  if (log.size() > kFirmwareLogBytesMax)
    log +=
        fmt::format("{:.6f} tiltproof: the log is full ({} MiB): later lines of the firmware are not kept\n",
                    ToSeconds(of.time_ns), kFirmwareLogBytesMax >> 20);
}

void LogBuilder::Add(const Record& of, const record::Accepted& accepted) {
  ClientLog& client = ClientOf(of);
  if (accepted.kind == record::AcceptedKind::kRequest)
    client.request_times_ns.push_back(of.time_ns);
  else
    client.actuator_times_ns.push_back(of.time_ns);
}

void LogBuilder::Add(const Record& of, const record::Reply& reply) {
  ClientOf(of).reply_latency_ns.push_back(reply.latency_ns);
}

void LogBuilder::Add(const Record& of, const record::Answer& answer) {
  ClientOf(of).client_round_trip_ns.push_back(answer.round_trip_ns);
}

void LogBuilder::Add(const Record& of, const record::State& state) {
  std::vector<ToldChange>& states = clients_[of.client.value_or(0)].states;
  if (states.empty() || states.back().value != state.state) states.push_back({of.time_ns, state.state});
}

void LogBuilder::Add(const Record& of, const record::Role& role) {
  std::vector<ToldChange>& roles = clients_[of.client.value_or(0)].roles;
  if (roles.empty() || roles.back().value != role.role) roles.push_back({of.time_ns, role.role});
}

void LogBuilder::Add(const Record& of, const record::Watched& watched) {
  if (watched.values.size() == scenario_.watch.size())
    clients_[of.client.value_or(0)].watched.emplace_back(of.time_ns, watched.values);
}

void LogBuilder::Add(const Record& /*of*/, const faults::Activation& activation) {
  if (activation.fault < scenario_.faults.size()) log_.activations.push_back(activation);
}

void LogBuilder::Add(const Record& /*of*/, const record::ActivationCounts& counts) {
  std::vector<std::int64_t>& to = log_.fault_activation_counts;
  to.resize(scenario_.faults.size());
  // Counts of a part of another build, or damaged ones, may have any length.
  for (std::size_t i = 0; i < std::min(counts.counts.size(), to.size()); ++i) to[i] += counts.counts[i];
}

void LogBuilder::Add(const Record& of, const record::Late& late) { late_.emplace_back(of.time_ns, late); }

void LogBuilder::Add(const Record& /*of*/, const record::PlantEnd& end) {
  log_.hover_input = end.hover_input;
  log_.input_min = end.input_min;
  log_.input_max = end.input_max;
  log_.redundancy = end.redundancy;
  for (std::size_t i = 0; i < std::min(log_.clients.size(), end.starts_accepted_counts.size()); ++i)
    log_.clients[i].starts_accepted_count = end.starts_accepted_counts[i];
}

void LogBuilder::Add(const Record& of, const record::LineEnd& end) {
  ClientLog& client = ClientOf(of);
  client.counts = end.counts;
  client.accepted_wrong_count = end.accepted_wrong_count;
  client.accepted_stale_count = end.accepted_stale_count;
  client.resync_max_ns = end.resync_max_ns;
}

void LogBuilder::Add(const Record& of, const record::ClientEnd& end) {
  ClientLog& client = ClientOf(of);
  if (end.failsafe_entered_count) client.failsafe_entered_count = end.failsafe_entered_count;
  if (end.receive_overruns_count) client.receive_overruns_count = end.receive_overruns_count;
  if (end.deadline_missed_count) client.deadline_missed_count = end.deadline_missed_count;
  if (!end.unmodelled_blocks.empty()) client.unmodelled_blocks = end.unmodelled_blocks;
  if (!end.stacks.empty()) client.stacks = end.stacks;
  if (end.firmware_end) log_.firmware_end = end.firmware_end;
  if (end.loss) client.loss = end.loss;
}

void LogBuilder::Add(const Record& /*of*/, const record::FirmwareTime& time) {
  by_firmware_.emplace_back(time.use, time.origin);
}

void LogBuilder::Add(const Record& of, const record::End& end) {
  log_.end_reason = end.reason;
  log_.end_text = end.text;
  log_.end_ns = of.time_ns;
  log_.wall_s = end.wall_s;
  if (end.firmware_end) log_.firmware_end = end.firmware_end;
}

void LogBuilder::AddCounters() {
  for (std::size_t client = 0; client < clients_.size(); ++client) {
    if (clients_[client].counters.empty()) continue;
    const std::size_t begin = layout_.link_counters + client * kLineCounters;
    ForEachRow(log_.trace, clients_[client].counters, [&](std::size_t row, const auto& counters) {
      PutCounters(counters.second, log_.trace.mutable_row(row).subspan(begin));
    });
  }
}

// Rows and samples have the same times, but a flight that ends early may have one more of either.
void LogBuilder::AddWatched() {
  for (std::size_t client = 0; client < clients_.size(); ++client)
    ForEachRow(log_.trace, clients_[client].watched, [&](std::size_t row, const auto& watched) {
      if (log_.trace.at(row, 0) != ToSeconds(watched.first)) return;
      const std::size_t begin = layout_.watch + client * scenario_.watch.size();
      std::ranges::copy(watched.second, log_.trace.mutable_row(row).subspan(begin).begin());
    });
}

// Rows have columns only for the faults with which the flight started.
void LogBuilder::AddInjected() {
  Trace& trace = log_.trace;
  log_.fault_activation_counts.resize(scenario_.faults.size());
  for (std::size_t i = layout_.watch - layout_.active; i < scenario_.faults.size(); ++i) {
    const faults::FaultSpec& fault = scenario_.faults[i];
    const faults::Activity activity(fault, faults::WindowOf(fault));
    std::vector<double> active;
    for (std::size_t r = 0; r < trace.row_count(); ++r) {
      active.push_back(activity.Contains(FromSeconds(trace.at(r, 0))) ? 1.0 : 0.0);
      trace.mutable_row(r)[layout_.faults_active_count] += active.back();
    }
    trace.InsertColumn(layout_.active + i, "active_" + fault.id, active);
  }
}

void LogBuilder::AddStates() {
  for (std::size_t client = 0; client < clients_.size(); ++client) {
    const std::optional<ClientLoss>& loss = log_.clients[client].loss;
    const TimeNs until_ns = loss ? loss->time_ns : kNever;
    SortByTime(clients_[client].states);
    AddTold(SupervisorStateColumn(scenario_, client), clients_[client].states, until_ns, log_.trace);
    if (!scenario_.has_several_clients()) continue;
    SortByTime(clients_[client].roles);
    AddTold(RoleColumn(scenario_, client), clients_[client].roles, until_ns, log_.trace);
  }
}

void LogBuilder::AddLateness() {
  for (const OwnLateness& own : by_firmware_)
    if (own.total() && (!log_.firmware_use || own.total()->run_ns > log_.firmware_use->run_ns))
      log_.firmware_use = own.total();
  for (const auto& begin_and_late : late_) {
    const record::Late& late = begin_and_late.second;
    const LateSpan span{begin_and_late.first, late.end_ns};
    const bool by_firmware =
        std::any_of(by_firmware_.begin(), by_firmware_.end(),
                    [&](const OwnLateness& own) { return own.Explains(span, late.processors); });
    if (late.kind == record::LateKind::kBoard) {
      if (!by_firmware) log_.board_disturbed.push_back(span);
    } else {
      (by_firmware ? log_.firmware_late : log_.harness_late).push_back(span);
    }
  }
  for (std::vector<LateSpan>* spans : {&log_.harness_late, &log_.firmware_late, &log_.board_disturbed})
    std::sort(spans->begin(), spans->end(), [](const LateSpan& a, const LateSpan& b) {
      return std::pair(a.begin_ns, a.end_ns) < std::pair(b.begin_ns, b.end_ns);
    });
}

RunLog LogBuilder::Take() {
  AddCounters();
  AddWatched();
  AddInjected();
  if (parts_.states) AddStates();
  AddLateness();
  for (PerClient& client : clients_) log_.link.Append(std::move(client.link));
  for (LinkLog& line : lines_) log_.link.Append(std::move(line));
  SortByTime(log_.events);
  SortByTime(log_.activations);
  const link::Protocol& protocol = *scenario_.link.protocol;
  for (std::size_t client = 0; client < clients_.size(); ++client) {
    clients_[client].history.AddTo(log_, client);
    if (parts_.bytes) AddProtocolUse(log_, client, protocol, scenario_.link.main_rate());
  }
  if (parts_.bytes) ExplainNeverStarted(log_, protocol);
  return std::move(log_);
}

}  // namespace tiltproof::harness
