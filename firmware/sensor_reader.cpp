#include "firmware/sensor_reader.h"

#include "firmware/frame_sender.h"

namespace tiltproof::firmware {

SensorReader::SensorReader(link::Dialect dialect, ValueChecks checks, Port& port)
    : dialect_(dialect), checks_(checks), port_(port) {}

void SensorReader::Request(TimeNs now) {
  decoder_.Finish();
  has_reply_ = false;
  waiting_ = true;
  SendFrame(port_, now, link::EncodeReadSensors(dialect_));
}

void SensorReader::Receive(std::span<const std::uint8_t> bytes) {
  while (const auto event = decoder_.Next(bytes)) {
    if (waiting_ && event->status == link::FrameStatus::kOk && Accept(event->payload)) {
      waiting_ = false;
      has_reply_ = true;
    }
  }
}

bool SensorReader::Accept(std::span<const std::uint8_t> payload) {
  const link::MessageStatus status = checks_ == ValueChecks::kNone ? link::ParseSensors(payload, reply_)
                                                                   : link::DecodeSensors(payload, reply_);
  return status == link::MessageStatus::kOk;
}

std::optional<Sensors> SensorReader::TakeReply() {
  if (!has_reply_) return std::nullopt;
  has_reply_ = false;
  return reply_;
}

}  // namespace tiltproof::firmware
