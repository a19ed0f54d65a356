// Frames of the paper's protocol as a sender makes them, for faults that edit messages.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <vector>

#include "harness/scenario/shipped_protocols.h"
#include "link/frame.h"
#include "link/protocol.h"
#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {

inline const link::Protocol& PaperProtocol() {
  static const auto protocol = harness::FindProtocol("paper");
  return *protocol;
}

// Frame n of a line that sends this message every 12 ms; its values are n, n + 0.5, n + 1 ...
inline link::Chunk MessageFrame(const std::string& message, std::int64_t n) {
  const link::MessageType& type = *PaperProtocol().Find(message);
  std::vector<double> values;
  for (std::size_t i = 0; i < type.fields.size(); ++i)
    values.push_back(static_cast<double>(n) + 0.5 * static_cast<double>(i));
  const link::Payload payload = PaperProtocol().Encode(type, values);
  std::array<std::uint8_t, link::FrameBytesMax(link::kPayloadBytesMax)> buffer{};
  const auto frame = link::EncodeFrame(payload.span(), buffer).bytes;
  link::Chunk chunk{.begin_ns = kOriginAtPowerOn.ToBootTime(FrameTime(n)),
                    .bytes = {frame.begin(), frame.end()},
                    .message = PlaceInPaper(message),
                    .number = static_cast<std::uint64_t>(n)};
  return chunk;
}

// Sends `count` such frames through a schedule: the chunks that came out at each of them.
inline std::vector<std::vector<link::Chunk>> SendMessages(FaultSchedule& schedule, const std::string& message,
                                                          std::int64_t count) {
  schedule.SetOrigin(kOriginAtPowerOn);
  std::vector<std::vector<link::Chunk>> out;
  for (std::int64_t n = 0; n < count; ++n) {
    out.push_back({MessageFrame(message, n)});
    schedule.Filter(PaperProtocol().Find(message)->direction)->Apply(out.back());
  }
  return out;
}
inline std::vector<std::vector<link::Chunk>> SendMessages(FaultSpec spec, const std::string& message,
                                                          std::int64_t count, std::uint64_t seed = 1) {
  if (PaperProtocol().Find(message)->direction == link::Direction::kToPlant) spec.target = Target::kToPlant;
  FaultSchedule schedule = AtTheLine({spec}, seed);
  return SendMessages(schedule, message, count);
}

// All of it as one stream: what a receiver's decoder says.
struct Heard {
  link::FrameStatus status;
  Bytes payload;
};
inline std::vector<Heard> Decoded(const std::vector<std::vector<link::Chunk>>& out) {
  link::FrameDecoder decoder;
  std::vector<Heard> heard;
  for (const auto& chunks : out) {
    for (const link::Chunk& chunk : chunks) {
      std::span<const std::uint8_t> bytes = chunk.bytes;
      while (const auto event = decoder.Next(bytes))
        heard.push_back({event->status, {event->payload.begin(), event->payload.end()}});
    }
  }
  return heard;
}

inline std::vector<float> ValuesOf(const Bytes& payload) {
  std::vector<float> values;
  for (std::size_t i = 0; i + 4 <= payload.size(); i += 4) {
    float value = 0;
    std::memcpy(&value, &payload[i], 4);
    values.push_back(value);
  }
  return values;
}

}  // namespace tiltproof::faults
