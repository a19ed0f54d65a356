// libFuzzer target: FrameDecoder in several chunkings against the slow reference; every accepted payload goes
// to all message decoders and must be the encoding of what they say.
//
//   build/fuzz/tests/fuzz/fuzz_frame_decoder -max_total_time=60 found tests/fuzz/corpus/frame_decoder
//
// Input: the first byte chooses chunk lengths and where the decoder is finished and goes on; the rest is the
// stream.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "firmware/messages.h"
#include "tests/fuzz/differential.h"

namespace {

using tiltproof::testing::Bytes;
namespace link = tiltproof::link;

void Require(bool holds, const char* what, std::span<const std::uint8_t> bytes) {
  if (holds) return;
  std::fprintf(stderr, "%s: %s\n", what, tiltproof::testing::Hex(bytes).c_str());
  std::abort();
}

bool SameBytes(const link::MessageBytes& message, const Bytes& payload) {
  return std::ranges::equal(message.span(), payload);
}

void CheckMessages(const Bytes& payload) {
  tiltproof::Sensors sensors;
  if (link::DecodeSensors(payload, sensors) == link::MessageStatus::kOk) {
    Require(SameBytes(link::EncodeSensors(sensors), payload), "sensors change in a round trip", payload);
  }
  const bool parsed = link::ParseSensors(payload, sensors) == link::MessageStatus::kOk;
  Require(parsed == (payload.size() == link::kSensorMessageBytes), "parsed a wrong length", payload);
  tiltproof::Reference reference;
  if (link::DecodeReference(payload, reference) == link::MessageStatus::kOk) {
    Require(SameBytes(link::EncodeReference(reference), payload), "a reference changes in a round trip",
            payload);
  }
  for (const link::Dialect dialect : {link::Dialect::kPaper, link::Dialect::kProvant}) {
    link::ClientMessage message;
    if (link::DecodeClientMessage(dialect, payload, message) != link::MessageStatus::kOk) continue;
    const link::MessageBytes again = message.start ? link::EncodeStart(dialect, message.actuators)
                                     : message.read_sensors
                                         ? link::EncodeReadSensors(dialect)
                                         : link::EncodeActuators(dialect, message.actuators);
    Require(SameBytes(again, payload), "a request changes in a round trip", payload);
    Require(link::ClassifyClientPayload(dialect, payload) != link::MessageKind::kUnknown,
            "accepted, not classified", payload);
  }
}

void CheckEncoder(const Bytes& payload) {
  if (payload.size() > link::kPayloadBytesMax) return;
  const Bytes expected = tiltproof::testing::SlowEncode(payload);
  Bytes wire(expected.size());  // exactly long enough
  const link::EncodedFrame frame = link::EncodeFrame(payload, wire);
  Require(std::ranges::equal(frame.bytes, expected), "encoder and reference differ", payload);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::size_t choice = size > 0 ? data[0] : 0;
  const Bytes stream(data + (size > 0 ? 1 : 0), data + size);

  const auto cut = stream.begin() + static_cast<std::ptrdiff_t>(stream.size() * (choice >> 4) / 16);
  const std::vector<Bytes> streams = {Bytes(stream.begin(), cut), Bytes(cut, stream.end())};
  const std::array<tiltproof::testing::Chunking, 3> chunkings = {
      tiltproof::testing::Chunking{}, {1}, {choice % 16, 1 + choice % 7, choice % 3}};
  for (const tiltproof::testing::Chunking& chunking : chunkings) {
    const std::string difference = tiltproof::testing::Disagreement(streams, chunking);
    if (difference.empty()) continue;
    std::fprintf(stderr, "%s", difference.c_str());
    std::abort();
  }

  for (const tiltproof::testing::SeenEvent& event : tiltproof::testing::Decode(stream)) {
    if (event.status == link::FrameStatus::kOk) CheckMessages(event.payload);
  }
  // A fuzzer seldom finds a checksum: the stream is a payload too.
  CheckMessages(stream);
  CheckEncoder(stream);
  return 0;
}
