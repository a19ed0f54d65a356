// Pushes random and mutated byte streams through FrameDecoder and the slow reference, and stops at the first
// difference.
//
//   decoder_stress [COUNT [SEED]]       COUNT streams, default 100000; the same seed gives the same streams
//   on every machine
//
// Every stream goes through the decoder whole, byte by byte and in random chunks; one decoder in four goes on
// after Finish() with a second stream. Payloads that are accepted go through all message decoders. Exit 0
// when all agree, 1 at a difference (which it prints), 2 on wrong usage.
#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "firmware/messages.h"
#include "tests/fuzz/differential.h"

namespace {

using tiltproof::testing::Bytes;
namespace link = tiltproof::link;

// Draws that are the same on every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  // Uniform in [0, n), n > 0; the bias of the modulo does not matter here.
  std::size_t Below(std::size_t n) { return static_cast<std::size_t>(engine_() % n); }
  std::uint8_t Byte() { return static_cast<std::uint8_t>(engine_() >> 56); }
  bool OneIn(std::size_t n) { return Below(n) == 0; }

 private:
  std::mt19937_64 engine_;
};

// Bytes that mean something to the protocol, or to a checksum modulo 255.
std::uint8_t HostileByte(Random& random) {
  constexpr std::array<std::uint8_t, 8> kBytes = {0x7E, 0x7D, 0x5E, 0x5D, 0x00, 0xFF, 0x20, 0x7F};
  return kBytes[random.Below(kBytes.size())];
}

Bytes RandomBytes(Random& random, std::size_t count, std::size_t hostile_one_in) {
  Bytes bytes(count);
  for (std::uint8_t& byte : bytes) byte = random.OneIn(hostile_one_in) ? HostileByte(random) : random.Byte();
  return bytes;
}

// A message as it may be flown, now and then with a value that is out of range.
Bytes PlausibleMessage(Random& random) {
  const auto value = [&random] {
    if (random.OneIn(4)) return 0.0F;
    const float magnitude = random.OneIn(200) ? 1e5F : 20.0F;
    return (static_cast<float>(random.Below(2001)) * 1e-3F - 1.0F) * magnitude;
  };
  tiltproof::Sensors sensors;
  for (const auto& field : tiltproof::kSensorFields) sensors.*field.in_float = value();
  tiltproof::Actuators actuators;
  for (const auto& field : tiltproof::kActuatorFields) actuators.*field.in_float = value();
  tiltproof::Reference reference;
  for (const auto& field : tiltproof::kReferenceFields) reference.*field.in_float = value();
  const link::Dialect dialect = random.OneIn(2) ? link::Dialect::kPaper : link::Dialect::kProvant;
  const std::array<link::MessageBytes, 5> messages = {
      link::EncodeSensors(sensors), link::EncodeReference(reference),
      link::EncodeActuators(dialect, actuators), link::EncodeStart(dialect, actuators),
      link::EncodeReadSensors(dialect)};
  const auto bytes = messages[random.Below(messages.size())].span();
  return Bytes(bytes.begin(), bytes.end());
}

Bytes MakePayload(Random& random) {
  if (random.OneIn(3)) return PlausibleMessage(random);
  constexpr std::array<std::size_t, 4> kMessageLengths = {4, 20, 28, 64};
  std::size_t length = random.Below(24);
  if (random.OneIn(2)) length = kMessageLengths[random.Below(kMessageLengths.size())];
  if (random.OneIn(64)) length = 250 + random.Below(12);  // around the limit
  return RandomBytes(random, length, 1 + random.Below(16));
}

void Mutate(Random& random, Bytes& stream) {
  if (stream.empty()) return;
  const std::size_t at = random.Below(stream.size());
  const auto place = stream.begin() + static_cast<std::ptrdiff_t>(at);
  switch (random.Below(7)) {
    case 0:
      *place = static_cast<std::uint8_t>(*place ^ 1U << random.Below(8));
      break;
    case 1:
      *place = random.Byte();
      break;
    case 2:
      *place = HostileByte(random);
      break;
    case 3:
      stream.erase(place);
      break;
    case 4:
      stream.insert(place, HostileByte(random));
      break;
    case 5:
      stream.resize(at);
      break;
    default: {  // 00 <-> FF, which the checksum cannot see
      const auto zero = std::find(place, stream.end(), std::uint8_t{0x00});
      if (zero != stream.end()) *zero = 0xFF;
    }
  }
}

Bytes MakeStream(Random& random) {
  if (random.OneIn(4)) return RandomBytes(random, random.Below(96), 1 + random.Below(8));
  Bytes stream;
  const std::size_t frame_count = 1 + random.Below(3);
  for (std::size_t i = 0; i < frame_count; ++i) {
    const Bytes frame = tiltproof::testing::SlowEncode(MakePayload(random));
    const bool shares_flag = !stream.empty() && random.OneIn(2);
    stream.insert(stream.end(), frame.begin() + (shares_flag ? 1 : 0), frame.end());
  }
  for (std::size_t count = random.Below(4); count > 0; --count) Mutate(random, stream);
  return stream;
}

struct Summary {
  std::uint64_t streams = 0;
  std::uint64_t bytes = 0;
  std::array<std::uint64_t, link::kFrameStatusCount> events{};
  std::uint64_t messages_tried = 0;
  std::uint64_t messages_accepted = 0;
};

void TryMessages(const Bytes& payload, Summary& summary) {
  tiltproof::Sensors sensors;
  tiltproof::Reference reference;
  link::ClientMessage message;
  const std::array<link::MessageStatus, 4> results = {
      link::DecodeSensors(payload, sensors), link::DecodeReference(payload, reference),
      link::DecodeClientMessage(link::Dialect::kPaper, payload, message),
      link::DecodeClientMessage(link::Dialect::kProvant, payload, message)};
  summary.messages_tried += results.size();
  for (const link::MessageStatus result : results)
    summary.messages_accepted += result == link::MessageStatus::kOk;
}

bool ParseNumber(const char* text, std::uint64_t& number) {
  const char* const end = text + std::strlen(text);
  const auto [stop, error] = std::from_chars(text, end, number);
  return error == std::errc() && stop == end;
}

}  // namespace

int main(int argc, char** argv) {
  std::uint64_t count = 100'000;
  std::uint64_t seed = 1;
  if (argc > 3 || (argc > 1 && !ParseNumber(argv[1], count)) || (argc > 2 && !ParseNumber(argv[2], seed))) {
    std::fprintf(stderr, "usage: decoder_stress [COUNT [SEED]]\n");
    return 2;
  }
  Random random(seed);
  Summary summary;
  for (; summary.streams < count; ++summary.streams) {
    std::vector<Bytes> streams = {MakeStream(random)};
    if (random.OneIn(4)) streams.push_back(MakeStream(random));
    const std::array<tiltproof::testing::Chunking, 3> chunkings = {
        tiltproof::testing::Chunking{}, {1}, {random.Below(5), 1 + random.Below(40), random.Below(12)}};
    for (const tiltproof::testing::Chunking& chunking : chunkings) {
      const std::string difference = tiltproof::testing::Disagreement(streams, chunking);
      if (difference.empty()) continue;
      std::printf("seed %llu, stream %llu:\n%s", static_cast<unsigned long long>(seed),
                  static_cast<unsigned long long>(summary.streams), difference.c_str());
      return 1;
    }
    for (const Bytes& stream : streams) {
      summary.bytes += stream.size();
      for (const tiltproof::testing::SeenEvent& event : tiltproof::testing::Decode(stream)) {
        ++summary.events[static_cast<std::size_t>(event.status)];
        if (event.status == link::FrameStatus::kOk) TryMessages(event.payload, summary);
      }
    }
  }
  std::printf("seed %llu: %llu runs, %llu bytes, decoder and reference agree in 3 chunkings\n",
              static_cast<unsigned long long>(seed), static_cast<unsigned long long>(summary.streams),
              static_cast<unsigned long long>(summary.bytes));
  for (std::size_t i = 0; i < summary.events.size(); ++i) {
    std::printf("  %-16s %llu\n", std::string(link::Name(static_cast<link::FrameStatus>(i))).c_str(),
                static_cast<unsigned long long>(summary.events[i]));
  }
  std::printf("  messages         %llu of %llu accepted\n",
              static_cast<unsigned long long>(summary.messages_accepted),
              static_cast<unsigned long long>(summary.messages_tried));
  return 0;
}
