#include "harness/run/realtime/log_messages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <utility>

#include "faults/activity.h"
#include "faults/registry.h"
#include "harness/run/late_periods.h"
#include "harness/run/merge_logs.h"
#include "harness/run/remote/protocol.h"

namespace tiltproof::harness {

namespace {

using link::Direction;

// Kinds of RunEvent that are not events of the flight.
constexpr std::string_view kFirmwareLogKind = "firmware_log";
// Size of a line in firmware.log beside its text.
constexpr std::size_t kTimeBytes = 16;

// t_s and the link counters of a row, in the order of TraceLayout.
constexpr std::size_t kLinkColumnCount = 1 + 3 * link::kDirectionCount;

std::vector<dds::Chunk> ToMessage(const std::vector<link::LogChunk>& chunks) {
  std::vector<dds::Chunk> out;
  for (const auto& chunk : chunks) out.push_back({chunk.begin_ns, chunk.bytes});
  return out;
}
std::vector<link::LogChunk> FromMessage(std::vector<dds::Chunk>&& chunks) {
  std::vector<link::LogChunk> out;
  for (auto& chunk : chunks) {
    link::LogChunk& to = out.emplace_back();
    to.begin_ns = chunk.begin_ns;
    to.bytes = std::move(chunk.bytes);
  }
  return out;
}

// A message's share of the harness's memory, roughly: the content of each record, and this overhead.
constexpr std::size_t kMessageBytes = 128, kFrameBytes = 16, kChunkBytes = 32;
// Marks a node that sent too much, for good.
constexpr std::int64_t kOverfull = std::numeric_limits<std::int64_t>::max();

std::size_t BytesOf(const dds::SerialTap& tap) {
  std::size_t bytes = sizeof(std::int64_t) * (tap.reply_latency_ns.size() + tap.client_round_trip_ns.size());
  for (const auto& frame : tap.frames) bytes += kFrameBytes + frame.bytes.size();
  return bytes;
}
std::size_t BytesOf(const dds::FaultActivation& activation) {
  std::size_t bytes = activation.what.size();
  for (const auto* chunks : {&activation.before, &activation.after})
    for (const auto& chunk : *chunks) bytes += kChunkBytes + chunk.bytes.size();
  return bytes;
}
std::size_t BytesOf(const dds::RunEvent& event) { return event.kind.size() + event.text.size(); }
// Rows are kept by their time, which takes about as much again.
std::size_t BytesOf(const dds::TraceRows& rows) {
  return 2 * sizeof(double) * rows.values.size() +
         sizeof(TimeNs) * (rows.request_times_ns.size() + rows.actuator_times_ns.size());
}

// The faults that had a hand in a chunk.
std::vector<std::string> FaultsOf(const TimedLinkRecord<BootTime>& record, TimeNs begin_ns,
                                  const Scenario& scenario,
                                  const std::vector<faults::Activation>& activations) {
  std::vector<std::string> ids;
  for (const auto& activation : activations) {
    const auto& chunks = record.delivered ? activation.after : activation.before;
    const bool touched = std::any_of(chunks.begin(), chunks.end(), [&](const auto& chunk) {
      return chunk.begin_ns == begin_ns && std::ranges::equal(chunk.bytes, record.bytes);
    });
    const std::string& id = scenario.faults[activation.fault].id;
    if (touched && std::find(ids.begin(), ids.end(), id) == ids.end()) ids.push_back(id);
  }
  return ids;
}

}  // namespace

LogPublisher::LogPublisher(dds::Bus& bus, const Scenario& scenario, std::string run_id, std::string node_id,
                           const dds::Participant& harness)
    : scenario_(scenario),
      run_id_(std::move(run_id)),
      node_id_(std::move(node_id)),
      harness_(harness),
      taps_(bus),
      activations_(bus),
      events_(bus),
      rows_(bus),
      reports_(bus) {
  last_.run_id = run_id_;
  last_.node_id = node_id_;
}

bool LogPublisher::IsHeard() const {
  return taps_.IsHeardBy(harness_) && activations_.IsHeardBy(harness_) && events_.IsHeardBy(harness_) &&
         rows_.IsHeardBy(harness_) && reports_.IsHeardBy(harness_);
}

void LogPublisher::Write(const LineLog& log, Origin origin, const std::vector<CountsSample>& counts) {
  auto tap = Begin<dds::SerialTap>(last_.serial_tap);
  const auto flush = [&] { Send(std::exchange(tap, Begin<dds::SerialTap>(last_.serial_tap))); };
  std::size_t offset = 0;
  while (const auto record = log.link.Next(offset)) {
    const TimeNs begin_ns = origin.SimulationTime(record->begin_ns);
    tap.frames.push_back({.begin_ns = begin_ns,
                          .direction = static_cast<std::uint8_t>(record->wire.direction),
                          .delivered = record->delivered,
                          .bytes = {record->bytes.begin(), record->bytes.end()},
                          .fault_ids = FaultsOf(*record, begin_ns, scenario_, log.activations)});
    if (tap.frames.size() == dds::kChunksCountMax) flush();
  }
  tap.reply_latency_ns = log.reply_latency_ns;
  tap.client_round_trip_ns = log.client_round_trip_ns;
  if (tap.frames.empty() && tap.reply_latency_ns.empty() && tap.client_round_trip_ns.empty()) {
    --last_.serial_tap;
  } else {
    Send(std::move(tap));
  }
  Write(log.activations);
  for (BootEvent event : log.events) Write(ToRunEvent(std::move(event), origin));
  if (counts.empty()) return;
  std::vector<double> values;
  for (const auto& sample : counts) {
    values.push_back(ToSeconds(sample.time_ns));
    for (const auto& count : sample.counts) {
      values.push_back(static_cast<double>(count.frames_sent));
      values.push_back(static_cast<double>(count.frames_accepted));
      values.push_back(static_cast<double>(count.frames_rejected));
    }
  }
  Send(SendRows(values, kLinkColumnCount));
}

dds::TraceRows LogPublisher::SendRows(std::span<const double> values, std::size_t column_count) {
  const std::size_t most = dds::kNumbersCountMax / column_count * column_count;
  for (;;) {
    const auto part = values.first(std::min(values.size(), most));
    values = values.subspan(part.size());
    auto rows = Begin<dds::TraceRows>(last_.trace_rows);
    rows.column_count = static_cast<std::uint32_t>(column_count);
    rows.values.assign(part.begin(), part.end());
    if (values.empty()) return rows;
    Send(std::move(rows));
  }
}

void LogPublisher::Write(const PlantLog& log) {
  if (!log.rows.empty() || !log.clients[0].request_times_ns.empty() ||
      !log.clients[0].actuator_times_ns.empty()) {
    dds::TraceRows rows = SendRows(log.rows, std::max<std::size_t>(log.column_count, 1));
    rows.request_times_ns = log.clients[0].request_times_ns;
    rows.actuator_times_ns = log.clients[0].actuator_times_ns;
    Send(std::move(rows));
  }
  Write(log.activations);
  for (const auto& event : log.events) Write(event);
}

void LogPublisher::Write(const RunEvent& event) {
  if (event.kind == kFirmwareLogKind) {
    if (firmware_log_bytes_ > kFirmwareLogBytesMax) return;
    firmware_log_bytes_ += event.text.size() + kTimeBytes;
  }
  auto message = Begin<dds::RunEvent>(last_.run_event);
  message.time_ns = event.time_ns;
  message.kind = event.kind;
  message.text = event.text.substr(0, dds::kTextBytesMax);
  std::replace(message.text.begin(), message.text.end(), '\0', '?');  // which the bus does not carry
  Send(std::move(message));
}

void LogPublisher::Write(const std::vector<faults::Activation>& activations) {
  for (const auto& activation : activations) {
    auto message = Begin<dds::FaultActivation>(last_.fault_activation);
    message.fault_id = scenario_.faults[activation.fault].id;
    message.time_ns = activation.time_ns;
    message.what = activation.what.substr(0, dds::kTextBytesMax);
    message.before = ToMessage(activation.before);
    message.after = ToMessage(activation.after);
    Send(std::move(message));
  }
}

void LogPublisher::Send(AnyMessage message) {
  waiting_.push_back(std::move(message));
  Retry();
}

bool LogPublisher::TrySend(const AnyMessage& message) {
  struct {
    LogPublisher& self;
    bool operator()(const dds::SerialTap& m) const { return self.taps_.Write(m); }
    bool operator()(const dds::FaultActivation& m) const { return self.activations_.Write(m); }
    bool operator()(const dds::RunEvent& m) const { return self.events_.Write(m); }
    bool operator()(const dds::TraceRows& m) const { return self.rows_.Write(m); }
  } write{*this};
  return std::visit(write, message);
}

void LogPublisher::Retry() {
  // Most topics keep nothing for a harness that is not there yet, and others may be there before.
  listened_ = listened_ || IsHeard();
  while (listened_ && !waiting_.empty() && TrySend(waiting_.front())) waiting_.pop_front();
}

void LogPublisher::Close(NodeTotals totals) {
  Retry();
  if (totals.line) DropRecords(*totals.line);
  if (totals.plant) DropRecords(*totals.plant);
  Packer packer;
  packer(totals);
  last_.payload.assign(packer.bytes().begin(), packer.bytes().end());
  reports_.Write(last_);
}

LogCollector::LogCollector(dds::Bus& bus, const dds::Circle& members, const Scenario& scenario,
                           const VehicleSignals& vehicle, std::string run_id,
                           const std::function<void()>& on_data)
    : scenario_(scenario),
      layout_(vehicle, scenario),
      run_id_(std::move(run_id)),
      taps_(bus, members, on_data),
      activations_(bus, members, on_data),
      events_(bus, members, on_data),
      rows_(bus, members, on_data),
      report_messages_(bus, members, on_data) {
  log_.trace = Trace(layout_.columns);
  log_.fault_activation_counts.assign(scenario.faults.size(), 0);
}

template <class T>
bool LogCollector::Accepts(const T& message) {
  std::int64_t& sent = sent_bytes_[message.node_id];
  if (sent == kOverfull) return false;
  sent += static_cast<std::int64_t>(kMessageBytes + BytesOf(message));
  const auto more_bytes = static_cast<double>(kNodeBytesPerS) * ToSeconds(flown_ns_);
  if (sent > kNodeBytesMax + static_cast<std::int64_t>(more_bytes)) {
    sent = kOverfull;
    if (overfull_.empty())
      overfull_ = fmt::format(
          "the {} node sends more log than a flight can hold: more than {} MiB and {} MiB for each second "
          "flown",
          message.node_id, kNodeBytesMax >> 20, kNodeBytesPerS >> 20);
    return false;
  }
  return message.run_id == run_id_;
}

void LogCollector::Drain(TimeNs flown_ns) {
  flown_ns_ = flown_ns;
  for (auto& tap : taps_.Take()) {
    if (!Accepts(tap)) continue;
    for (auto& frame : tap.frames) {
      if (frame.direction >= link::kDirectionCount) continue;
      link::LogChunk chunk;
      chunk.begin_ns = frame.begin_ns;
      chunk.bytes = std::move(frame.bytes);
      log_.link.Append(chunk, {0, static_cast<Direction>(frame.direction)}, frame.delivered);
    }
    log_.clients[0].reply_latency_ns.insert(log_.clients[0].reply_latency_ns.end(),
                                            tap.reply_latency_ns.begin(), tap.reply_latency_ns.end());
    log_.clients[0].client_round_trip_ns.insert(log_.clients[0].client_round_trip_ns.end(),
                                                tap.client_round_trip_ns.begin(),
                                                tap.client_round_trip_ns.end());
  }
  for (auto& message : activations_.Take()) {
    if (!Accepts(message)) continue;
    if (auto activation = FromMessage(std::move(message))) log_.activations.push_back(std::move(*activation));
  }
  for (auto& event : events_.Take()) {
    if (!Accepts(event)) continue;
    if (event.kind == kFirmwareLogKind) {
      log_.clients[0].firmware_log += fmt::format("{:.6f} {}\n", ToSeconds(event.time_ns), event.text);
    } else {
      log_.events.push_back({event.time_ns, std::move(event.kind), std::move(event.text), std::nullopt});
    }
  }
  for (auto& rows : rows_.Take()) {
    const auto columns = static_cast<std::size_t>(rows.column_count);
    const bool of_plant = columns == log_.trace.columns().size();
    if (!Accepts(rows) || (!of_plant && columns != kLinkColumnCount)) continue;
    for (std::size_t at = 0; at + columns <= rows.values.size(); at += columns) {
      const auto begin = rows.values.begin() + static_cast<std::ptrdiff_t>(at);
      if (!std::isfinite(*begin)) continue;
      Row& row = rows_by_time_[*begin];
      (of_plant ? row.plant : row.link).assign(begin, begin + static_cast<std::ptrdiff_t>(columns));
    }
    log_.clients[0].request_times_ns.insert(log_.clients[0].request_times_ns.end(),
                                            rows.request_times_ns.begin(), rows.request_times_ns.end());
    log_.clients[0].actuator_times_ns.insert(log_.clients[0].actuator_times_ns.end(),
                                             rows.actuator_times_ns.begin(), rows.actuator_times_ns.end());
  }
  for (auto& message : report_messages_.Take()) {
    if (message.run_id != run_id_ || reports_.contains(message.node_id)) continue;
    Report report{std::move(message), {}};
    try {
      Unpacker(report.report.payload).operator()(report.totals);
    } catch (const std::exception&) {
      // By another build, or damaged: as if it had not come, and the log is not whole.
      continue;
    }
    report.report.payload = {};
    const std::string node_id = report.report.node_id;
    reports_.emplace(node_id, std::move(report));
  }
}

std::optional<faults::Activation> LogCollector::FromMessage(dds::FaultActivation&& message) const {
  const auto found = std::find_if(scenario_.faults.begin(), scenario_.faults.end(),
                                  [&](const auto& fault) { return fault.id == message.fault_id; });
  if (found == scenario_.faults.end()) return std::nullopt;
  faults::Activation activation;
  activation.time_ns = message.time_ns;
  activation.fault = static_cast<std::size_t>(found - scenario_.faults.begin());
  activation.what = std::move(message.what);
  activation.before = harness::FromMessage(std::move(message.before));
  activation.after = harness::FromMessage(std::move(message.after));
  return activation;
}

std::string LogCollector::Missing(const std::string& node_id) const {
  const auto found = reports_.find(node_id);
  if (found == reports_.end()) return "its closing report";
  const dds::NodeReport& report = found->second.report;
  std::string text;
  const auto check = [&](const char* name, std::int64_t have, std::int64_t want) {
    if (have < want) text += fmt::format("{}{} {} to {}", text.empty() ? "" : ", ", name, have + 1, want);
  };
  check("serial taps", taps_.CompleteUpTo(run_id_, node_id), report.serial_tap);
  check("fault activations", activations_.CompleteUpTo(run_id_, node_id), report.fault_activation);
  check("events", events_.CompleteUpTo(run_id_, node_id), report.run_event);
  check("trace rows", rows_.CompleteUpTo(run_id_, node_id), report.trace_rows);
  return text;
}

// The nodes' rows know only the faults that the flight began with.
void LogCollector::AddInjected() {
  Trace& trace = log_.trace;
  for (std::size_t i = layout_.watch - layout_.active; i < scenario_.faults.size(); ++i) {
    const faults::FaultSpec& fault = scenario_.faults[i];
    const faults::Activity activity(fault, faults::WindowOf(fault));
    std::vector<double> active;
    for (std::size_t r = 0; r < trace.row_count(); ++r) {
      active.push_back(activity.Contains(FromSeconds(trace.at(r, 0))) ? 1.0 : 0.0);
      trace.mutable_row(r)[layout_.faults_active_count] += active.back();
    }
    trace.AppendColumn("active_" + fault.id, active);
  }
}

bool LogCollector::Complete(const std::string& node_id) const { return Missing(node_id).empty(); }

RunLog LogCollector::Take(TimeNs end_ns) {
  Drain(flown_ns_);
  std::vector<double> values;
  values.reserve(rows_by_time_.size() * log_.trace.columns().size());
  std::vector<double> counts(kLinkColumnCount, 0.0);  // as last heard
  for (auto& [time_s, row] : rows_by_time_) {
    if (!row.link.empty()) counts = row.link;
    if (row.plant.empty()) continue;
    std::copy(counts.begin() + 1, counts.end(),
              row.plant.begin() + static_cast<std::ptrdiff_t>(layout_.link_counters));
    values.insert(values.end(), row.plant.begin(), row.plant.end());
    row.plant = {};  // a long flight would not fit twice
  }
  log_.trace.AppendRows(std::move(values));
  rows_by_time_.clear();
  log_.end_ns = end_ns;
  log_.fault_activation_counts.resize(scenario_.faults.size());
  AddInjected();

  std::vector<SupervisorChange> states;  // of all that were the client's node
  OwnLateness by_firmware;
  for (const auto& [node_id, report] : reports_)
    if (report.totals.firmware_use)
      by_firmware = OwnLateness(*report.totals.firmware_use, report.totals.lateness.origin);
  log_.firmware_use = by_firmware.total();
  for (auto& [node_id, report] : reports_) {
    NodeTotals& totals = report.totals;
    const Origin origin = totals.lateness.origin;
    // Plant, link and client share a host.
    const bool beside_firmware = totals.plant || totals.line || totals.firmware_use;
    const auto add = [&](const std::vector<NodeLateSpan>& spans, std::vector<LateSpan>& to,
                         std::vector<LateSpan>* to_firmware) {
      for (const NodeLateSpan& span : spans) {
        if (!origin.known() || span.end_ns <= origin.boot_time()) continue;
        const LateSpan late{origin.SimulationTime(span.begin_ns), origin.SimulationTime(span.end_ns)};
        if (!beside_firmware || !by_firmware.Explains(late))
          to.push_back(late);
        else if (to_firmware != nullptr)
          to_firmware->push_back(late);
      }
    };
    add(totals.lateness.spans, log_.harness_late, &log_.firmware_late);
    add(totals.lateness.disturbed, log_.board_disturbed, nullptr);
    if (totals.plant) Append(log_, std::move(*totals.plant));
    if (totals.line) Append(log_, std::move(*totals.line), 0, Origin());
    AddActivations(log_, totals.activation_counts);
    states.insert(states.end(), totals.states.begin(), totals.states.end());
    if (totals.firmware_end) log_.firmware_end = std::move(totals.firmware_end);
    if (!totals.unmodelled_blocks.empty())
      log_.clients[0].unmodelled_blocks = std::move(totals.unmodelled_blocks);
    if (totals.client) log_.clients[0].failsafe_entered_count = totals.client->failsafe_count;
  }
  for (std::vector<LateSpan>* spans : {&log_.harness_late, &log_.firmware_late, &log_.board_disturbed})
    std::sort(spans->begin(), spans->end(), [](const LateSpan& a, const LateSpan& b) {
      return std::pair(a.begin_ns, a.end_ns) < std::pair(b.begin_ns, b.end_ns);
    });
  SortByTime(log_);
  std::stable_sort(states.begin(), states.end(),
                   [](const auto& a, const auto& b) { return a.time_ns < b.time_ns; });
  AddSupervisorState(scenario_, 0, states, log_.trace);
  return std::move(log_);
}

void CountLateness(RunLog& log, TimeNs period_ns) {
  const LatePeriods late = CountLatePeriods(log.harness_late, log.end_ns, period_ns);
  log.harness_overrun_count = late.count;
  log.harness_late_max_ns = late.longest_ns;
}

}  // namespace tiltproof::harness
