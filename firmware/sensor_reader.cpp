#include "firmware/sensor_reader.h"

#include <algorithm>

namespace tiltproof::firmware {
namespace {

// Sensors fail alone, messages as a whole.
constexpr std::size_t kRefusedMax = 2;

}  // namespace

SensorReader::SensorReader(link::Dialect dialect, ValueChecks checks, LateReplies late_replies, Port& port)
    : checks_(checks),
      sender_(dialect, port),
      decoder_(CheckOf(dialect)),
      filter_(dialect, link::MessageKind::kReply),
      late_replies_(late_replies) {}

void SensorReader::Request(TimeNs now) {
  if (late_replies_ == LateReplies::kDropped) {
    decoder_.Finish();
    reply_count_ = 0;
  }
  waiting_ = true;
  sent_ns_ = sender_.Send(now, link::EncodeReadSensors(sender_.dialect()));
}

void SensorReader::Receive(std::span<const std::uint8_t> bytes) {
  while (const auto event = decoder_.Next(bytes)) {
    if (event->status == link::FrameStatus::kOk) Accept(event->payload);
  }
}

void SensorReader::Accept(std::span<const std::uint8_t> payload) {
  const bool wanted = late_replies_ == LateReplies::kKept ? reply_count_ < replies_.size() : waiting_;
  if (!wanted) return;
  const auto values = filter_.Values(payload);
  if (!values) return;
  Sensors& reply = replies_[reply_count_];
  const link::MessageStatus status = checks_ == ValueChecks::kNone
                                         ? link::ParseSensors(*values, reply)
                                         : link::DecodeSensorsPartly(*values, kRefusedMax, reply);
  if (status != link::MessageStatus::kOk) return;
  filter_.Accept();
  waiting_ = false;
  ++reply_count_;
}

std::optional<Sensors> SensorReader::TakeReply() {
  if (reply_count_ == 0) return std::nullopt;
  const Sensors reply = replies_[0];
  std::copy(replies_.begin() + 1, replies_.end(), replies_.begin());
  --reply_count_;
  return reply;
}

}  // namespace tiltproof::firmware
