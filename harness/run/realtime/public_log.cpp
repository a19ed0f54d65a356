#include "harness/run/realtime/public_log.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace tiltproof::harness {
namespace {

constexpr const char* kFirmwareLogKind = "firmware_log";

dds::List<dds::Chunk, dds::kChunksCountMax> ToMessage(const std::vector<link::LogChunk>& chunks) {
  dds::List<dds::Chunk, dds::kChunksCountMax> out;
  for (const link::LogChunk& chunk : chunks) out.push_back({chunk.begin_ns, chunk.bytes});
  return out;
}

}  // namespace

PublicLog::PublicLog(dds::Bus& bus, const Scenario& scenario, std::string run_id)
    : scenario_(scenario), run_id_(std::move(run_id)), taps_(bus), activations_(bus), events_(bus) {}

template <class T>
T PublicLog::Begin(const std::string& node_id, std::int64_t& sequence) const {
  T message;
  message.run_id = run_id_;
  message.node_id = node_id;
  message.sequence = ++sequence;
  return message;
}

void PublicLog::Publish(const std::string& node_id, std::span<const Record> records) {
  // A record that exceeds the limits of a message is not from a node of ours.
  try {
    for (const Record& record : records) {
      if (const auto* event = std::get_if<record::Event>(&record.body))
        PublishEvent(node_id, record.time_ns, event->kind, event->text);
      else if (const auto* line = std::get_if<record::FirmwareText>(&record.body))
        PublishEvent(node_id, record.time_ns, kFirmwareLogKind, line->text);
      else if (const auto* activation = std::get_if<faults::Activation>(&record.body))
        PublishActivation(node_id, *activation);
    }
    // Frames are many, and most flights have no reader of them.
    if (taps_.MatchedCount() > 0) PublishTaps(node_id, records);
  } catch (const std::invalid_argument&) {
  }
}

void PublicLog::PublishEvent(const std::string& node_id, TimeNs time_ns, const std::string& kind,
                             const std::string& text) {
  auto message = Begin<dds::RunEvent>(node_id, sequences_[node_id].event);
  message.time_ns = time_ns;
  message.kind = kind;
  message.text = text;
  events_.Write(message);
}

void PublicLog::PublishActivation(const std::string& node_id, const faults::Activation& activation) {
  if (activation.fault >= scenario_.faults.size()) return;
  auto message = Begin<dds::FaultActivation>(node_id, sequences_[node_id].activation);
  message.fault_id = scenario_.faults[activation.fault].id;
  message.time_ns = activation.time_ns;
  message.what = activation.what.substr(0, dds::kTextBytesMax);
  message.before = ToMessage(activation.before);
  message.after = ToMessage(activation.after);
  activations_.Write(message);
}

// The faults that had a hand in a chunk: a node sends what faults did with the bytes.
dds::Names PublicLog::FaultsOf(TimeNs begin_ns, const record::Bytes& bytes,
                               std::span<const Record> records) const {
  dds::Names ids;
  for (const Record& record : records) {
    const auto* activation = std::get_if<faults::Activation>(&record.body);
    if (activation == nullptr || activation->fault >= scenario_.faults.size()) continue;
    const auto& chunks = bytes.side == ByteSide::kDelivered ? activation->after : activation->before;
    const bool touched = std::any_of(chunks.begin(), chunks.end(), [&](const link::LogChunk& chunk) {
      return chunk.begin_ns == begin_ns && chunk.bytes == bytes.bytes;
    });
    const std::string& id = scenario_.faults[activation->fault].id;
    if (touched && std::find(ids.begin(), ids.end(), id) == ids.end()) ids.push_back(id);
  }
  return ids;
}

void PublicLog::PublishTaps(const std::string& node_id, std::span<const Record> records) {
  dds::SerialTap tap;
  const auto flush = [&] {
    if (tap.frames.empty() && tap.reply_latency_ns.empty() && tap.client_round_trip_ns.empty()) return;
    tap.run_id = run_id_;
    tap.node_id = node_id;
    tap.sequence = ++sequences_[node_id].tap;
    taps_.Write(std::exchange(tap, {}));
  };
  for (const Record& record : records) {
    if (const auto* reply = std::get_if<record::Reply>(&record.body))
      tap.reply_latency_ns.push_back(reply->latency_ns);
    if (const auto* answer = std::get_if<record::Answer>(&record.body))
      tap.client_round_trip_ns.push_back(answer->round_trip_ns);
    const auto* bytes = std::get_if<record::Bytes>(&record.body);
    if (bytes == nullptr || bytes->side == ByteSide::kPassedOn) continue;
    tap.frames.push_back({.begin_ns = record.time_ns,
                          .direction = static_cast<std::uint8_t>(bytes->direction),
                          .delivered = bytes->side == ByteSide::kDelivered,
                          .bytes = bytes->bytes,
                          .fault_ids = FaultsOf(record.time_ns, *bytes, records)});
    if (tap.frames.size() == dds::kChunksCountMax) flush();
  }
  flush();
}

}  // namespace tiltproof::harness
