#include "harness/run/realtime/log_messages.h"

#include <fmt/format.h>

#include <exception>
#include <limits>

#include "harness/run/late_periods.h"

namespace tiltproof::harness {

namespace {

// Size of a line in firmware.log beside its text.
constexpr std::size_t kTimeBytes = 16;
// A message's overhead in the harness's memory, roughly.
constexpr std::size_t kMessageBytes = 128;
// Marks a node that sent too much, for good.
constexpr std::int64_t kOverfull = std::numeric_limits<std::int64_t>::max();

// A text as it goes over the bus, where programs of others read it: no longer than the bus carries, and without NUL.
std::string Sendable(const std::string& text) {
  std::string sendable = text.substr(0, dds::kTextBytesMax);
  std::replace(sendable.begin(), sendable.end(), '\0', '?');
  return sendable;
}

}  // namespace

void Lateness::WriteTo(RecordSink& sink, const std::string& processors) const {
  const auto write = [&](const std::vector<NodeLateSpan>& of, record::LateKind kind) {
    for (const NodeLateSpan& span : of) {
      if (origin.known() && span.end_ns <= origin.boot_time() - kLatenessReach) continue;
      const BootTime end = origin.known() ? span.end_ns : std::min(span.end_ns, stopped);
      sink.Write({zero().SimulationTime(span.begin_ns),
                  {},
                  record::Late{zero().SimulationTime(end), kind, processors}});
    }
  };
  write(spans, record::LateKind::kNode);
  write(disturbed, record::LateKind::kBoard);
}

LogPublisher::LogPublisher(dds::Bus& bus, std::string run_id, std::string node_id,
                           const dds::Participant& harness)
    : run_id_(std::move(run_id)), node_id_(std::move(node_id)), harness_(harness), records_(bus) {}

void LogPublisher::Write(const Record& record) {
  const std::size_t before = packed_.size_bytes();
  if (const auto* event = std::get_if<record::Event>(&record.body)) {
    packed_.Write({record.time_ns, record.client, record::Event{event->kind, Sendable(event->text)}});
  } else if (const auto* line = std::get_if<record::FirmwareText>(&record.body)) {
    if (firmware_log_bytes_ > kFirmwareLogBytesMax) return;
    firmware_log_bytes_ += line->text.size() + kTimeBytes;
    packed_.Write({record.time_ns, record.client, record::FirmwareText{Sendable(line->text)}});
  } else {
    packed_.Write(record);
  }
  if (packed_.size_bytes() > dds::kPayloadBytesMax) Seal(before, false);
}

void LogPublisher::Seal(std::size_t size_bytes, bool last) {
  dds::Records message;
  message.run_id = run_id_;
  message.node_id = node_id_;
  message.sequence = ++sequence_;
  message.last = last;
  message.payload = packed_.Take(size_bytes);
  waiting_.push_back(std::move(message));
}

void LogPublisher::Flush() {
  if (packed_.size_bytes() > 0) Seal(packed_.size_bytes(), false);
  // The topic keeps nothing for a harness that is not there yet.
  listened_ = listened_ || records_.IsHeardBy(harness_);
  while (listened_ && !waiting_.empty() && records_.Write(waiting_.front())) waiting_.pop_front();
}

void LogPublisher::Close() {
  Seal(packed_.size_bytes(), true);
  Flush();
}

LogCollector::LogCollector(dds::Bus& bus, const dds::Circle& members, const Scenario& scenario,
                           const VehicleSignals& vehicle, std::string run_id,
                           const std::function<void()>& on_data)
    : run_id_(std::move(run_id)),
      records_(bus, members, on_data),
      log_(scenario, vehicle),
      public_log_(bus, scenario, run_id_) {}

bool LogCollector::Accepts(const dds::Records& message) {
  std::int64_t& sent = nodes_[message.node_id].sent_bytes;
  if (sent == kOverfull) return false;
  sent += static_cast<std::int64_t>(kMessageBytes + message.payload.size());
  const auto more_bytes = static_cast<double>(kNodeBytesPerS) * ToSeconds(flown_ns_);
  if (sent <= kNodeBytesMax + static_cast<std::int64_t>(more_bytes)) return true;
  sent = kOverfull;
  if (overfull_.empty())
    overfull_ = fmt::format(
        "the {} node sends more log than a flight can hold: more than {} MiB and {} MiB for each second "
        "flown",
        message.node_id, kNodeBytesMax >> 20, kNodeBytesPerS >> 20);
  return false;
}

void LogCollector::Drain(TimeNs flown_ns) {
  flown_ns_ = flown_ns;
  // The records of one message. Only the harness says that the flight is over.
  struct Gathered final : RecordSink {
    void Write(const Record& record) override {
      if (!std::holds_alternative<record::End>(record.body)) records.push_back(record);
    }
    std::vector<Record> records;
  };
  for (const dds::Records& message : records_.Take()) {
    if (message.run_id != run_id_) continue;
    Node& node = nodes_[message.node_id];
    if (message.last) node.last = message.sequence;
    if (!Accepts(message)) continue;
    Gathered gathered;
    try {
      ReadPacked(message.payload, gathered);
    } catch (const std::exception&) {
      node.damaged = true;
    }
    for (const Record& record : gathered.records) log_.Write(record);
    public_log_.Publish(message.node_id, gathered.records);
  }
}

std::string LogCollector::Missing(const std::string& node_id) const {
  const auto found = nodes_.find(node_id);
  if (found == nodes_.end() || found->second.last == 0) return "its last records";
  const std::int64_t have = records_.CompleteUpTo(run_id_, node_id);
  if (have < found->second.last) return fmt::format("records {} to {}", have + 1, found->second.last);
  return found->second.damaged ? "records that this program can read" : "";
}

bool LogCollector::Complete(const std::string& node_id) const { return Missing(node_id).empty(); }

RunLog LogCollector::Take() {
  Drain(flown_ns_);
  return log_.Take();
}

void CountLateness(RunLog& log, TimeNs period_ns) {
  if (log.end_reason != EndReason::kNeverStarted)
    for (std::vector<LateSpan>* spans : {&log.harness_late, &log.firmware_late, &log.board_disturbed})
      std::erase_if(*spans, [](const LateSpan& span) { return span.end_ns <= -kLatenessReach; });
  const LatePeriods late = CountLatePeriods(log.harness_late, log.end_ns, period_ns);
  log.harness_overrun_count = late.count;
  log.harness_late_max_ns = late.longest_ns;
}

}  // namespace tiltproof::harness
