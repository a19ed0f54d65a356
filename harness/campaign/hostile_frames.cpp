#include "harness/campaign/hostile_frames.h"

#include <array>
#include <cstring>
#include <limits>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

using faults::Random;
using link::Framing;

auto At(LineBytes& bytes, std::size_t at) { return bytes.begin() + static_cast<std::ptrdiff_t>(at); }

std::uint8_t AnyByte(Random& random) { return static_cast<std::uint8_t>(random.Below(256)); }

// A byte that means something to the framing or its check.
std::uint8_t ByteOfMeaning(const Framing& framing, Random& random) {
  const std::span<const std::uint8_t> bytes = framing.special_bytes();
  return bytes[random.Below(bytes.size())];
}

void AppendFlag(const Framing& framing, LineBytes& bytes) {
  if (const auto flag = framing.flag()) bytes.push_back(*flag);
}

// A value of a message, which is a row of numbers, becomes one that no sender should send.
void BreakValue(LineBytes& payload, Random& random) {
  using Limits = std::numeric_limits<float>;
  const std::array<float, 12> values = {Limits::quiet_NaN(),
                                        Limits::infinity(),
                                        -Limits::infinity(),
                                        -0.F,
                                        Limits::denorm_min(),
                                        Limits::max(),
                                        Limits::lowest(),
                                        3e9F,  // of no 32-bit integer
                                        1e4F,
                                        -1e3F,
                                        100.5F,
                                        static_cast<float>(2 * random.Uniform() - 1)};
  if (payload.size() < sizeof(float)) return;
  const float value = values[random.Below(values.size())];
  std::memcpy(&payload[random.Below(payload.size() / sizeof(float)) * sizeof(float)], &value, sizeof value);
}

// A length that a buffer may not have.
std::size_t OddLength(std::size_t usual, Random& random) {
  constexpr std::array<std::size_t, 10> kEdges = {0, 1, 2, 63, 64, 128, 255, 256, 257, 300};
  switch (random.Below(4)) {
    case 0:
      return usual / 2;
    case 1:
      return usual + 1 + random.Below(8);
    case 2:
      return usual - std::min<std::size_t>(usual, 1 + random.Below(4));
    default:
      return kEdges[random.Below(kEdges.size())];
  }
}

void RandomBytes(const Framing& framing, LineBytes& bytes, std::size_t more_bytes_max, Random& random) {
  if (random.Below(2) == 0) bytes.resize(bytes.size() + random.Below(more_bytes_max + 1));
  for (std::size_t changes = 1 + random.Below(8); changes > 0 && !bytes.empty(); --changes)
    bytes[random.Below(bytes.size())] =
        random.Below(2) == 0 ? ByteOfMeaning(framing, random) : AnyByte(random);
}

// Another content in the first valid frame, under a checksum that is right.
template <class Change>
void WithContent(const Framing& framing, LineBytes& bytes, const Change& change) {
  const std::unique_ptr<link::FrameReader> reader = framing.MakeReader();
  std::span<const std::uint8_t> rest(bytes);
  while (const auto read = reader->Next(rest)) {
    if (!read->ok) continue;
    LineBytes payload(read->payload.begin(), read->payload.end());
    change(payload);
    const LineBytes frame = framing.Encode(payload);
    const auto at = bytes.erase(At(bytes, read->begin), At(bytes, read->end));
    bytes.insert(at, frame.begin(), frame.end());
    return;
  }
}

// Decoders compare single bytes, most of them at the beginning.
void ChangePayloadByte(LineBytes& payload, Random& random) {
  constexpr std::size_t kHead = 8;
  if (payload.empty()) return;
  const std::size_t size = random.Below(2) == 0 ? std::min(payload.size(), kHead) : payload.size();
  payload[random.Below(size)] = AnyByte(random);
}

}  // namespace

void ChangeContent(const Framing& framing, LineBytes& bytes, Random& random, const ChangeBytes& change) {
  constexpr std::size_t kMoreBytesMax = 8;
  WithContent(framing, bytes, [&](LineBytes& payload) {
    switch (random.Below(4)) {
      case 0:
        payload.resize(OddLength(payload.size(), random));
        break;
      case 1:
        change(payload, kMoreBytesMax);
        break;
      default:
        BreakValue(payload, random);
    }
  });
}

void ChangeContent(const Framing& framing, LineBytes& bytes, Random& random) {
  ChangeContent(framing, bytes, random, [&](LineBytes& content, std::size_t more_bytes_max) {
    RandomBytes(framing, content, more_bytes_max, random);
  });
}

void BreakBytes(const Framing& framing, LineBytes& bytes, Random& random) {
  if (bytes.empty()) return;
  const std::size_t at = random.Below(bytes.size());
  const std::uint8_t meaning = ByteOfMeaning(framing, random);
  switch (random.Below(6)) {
    case 0:
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ 1U << random.Below(8));
      break;
    case 1:
      bytes[at] = meaning;
      break;
    case 2:
      bytes.insert(At(bytes, at), meaning);
      break;
    case 3:
      bytes.erase(At(bytes, at));
      break;
    case 4:
      bytes.resize(at);  // cut short
      break;
    default:  // a shared flag, or none at all
      bytes.erase(random.Below(2) == 0 ? bytes.begin() : bytes.end() - 1);
  }
}

HostileFrames::HostileFrames(const link::Protocol& protocol, link::Direction direction)
    : protocol_(protocol), framing_(*protocol.framing) {
  for (const link::MessageType& type : protocol.messages)
    if (type.direction == direction) types_.push_back(&type);
  if (types_.empty()) ThrowBrokenInvariant("a message in each direction of a protocol");
}

LineBytes HostileFrames::Payload(Random& random) const {
  const link::MessageType& type = *types_[random.Below(types_.size())];
  std::vector<double> values;
  for (const link::MessageField& field : type.fields) {
    // Mostly near zero, sometimes anywhere in the range.
    const auto max = static_cast<float>(field.max);
    const float limit = random.Below(8) == 0 ? 1.F : std::min(1.F, 1.F / std::max(1.F, max));
    values.push_back(static_cast<double>(static_cast<float>(2 * random.Uniform() - 1) * limit * max));
  }
  const link::Payload payload = protocol_.Encode(type, values);
  return {payload.span().begin(), payload.span().end()};
}

LineBytes HostileFrames::Valid(Random& random) const { return framing_.Encode(Payload(random)); }

LineBytes HostileFrames::Make(Random& random) const {
  LineBytes said;
  switch (random.Below(12)) {
    case 0:  // what an honest sender says
      return Valid(random);
    case 1: {  // a wrong checksum
      if (framing_.check_bytes() == 0) return Valid(random);
      const std::uint64_t last = (std::uint64_t{1} << 8 * framing_.check_bytes()) - 1;
      const auto damage = static_cast<std::uint32_t>(1 + random.Below(last));
      return framing_.Encode(Payload(random), damage);
    }
    case 2:  // a length that is wrong, under a right checksum
    case 3: {
      LineBytes payload = Payload(random);
      const std::size_t used = payload.size();
      payload.resize(OddLength(used, random));
      for (std::size_t i = used; i < payload.size(); ++i) payload[i] = AnyByte(random);
      return framing_.Encode(payload);
    }
    case 4: {  // one that consists of bytes that are escaped, or of others of meaning
      const std::uint8_t byte = ByteOfMeaning(framing_, random);
      return framing_.Encode(
          LineBytes(OddLength(protocol_.messages.front().payload_bytes + 64, random), byte));
    }
    case 5: {  // no frame at all
      said.resize(1 + random.Below(300));
      const bool meaning = random.Below(2) == 0;
      for (std::uint8_t& byte : said) byte = meaning ? ByteOfMeaning(framing_, random) : AnyByte(random);
      return said;
    }
    case 6:  // short frames of one to four bytes between two flags
      for (std::size_t frames = 1 + random.Below(16); frames > 0; --frames) {
        AppendFlag(framing_, said);
        for (std::size_t bytes = random.Below(5); bytes > 0; --bytes) said.push_back(AnyByte(random));
      }
      AppendFlag(framing_, said);
      return said;
    case 7: {  // values that no sender should send, in each field
      LineBytes payload = Payload(random);
      for (std::size_t i = 1 + random.Below(4); i > 0; --i) BreakValue(payload, random);
      return framing_.Encode(payload);
    }
    case 8:  // several, one behind the other, with flags that they share or not
      for (std::size_t frames = 2 + random.Below(3); frames > 0; --frames) {
        if (!said.empty() && random.Below(2) == 0 && !framing_.opening().empty()) said.pop_back();
        const LineBytes frame = Valid(random);
        said.insert(said.end(), frame.begin(), frame.end());
      }
      break;
    default:
      said = Valid(random);
  }
  return Change(std::move(said), random);
}

LineBytes HostileFrames::ChangeOneByte(LineBytes bytes, Random& random) const {
  WithContent(framing_, bytes, [&](LineBytes& payload) { ChangePayloadByte(payload, random); });
  if (bytes.size() > kHostileBytesMax) bytes.resize(kHostileBytesMax);
  return bytes;
}

LineBytes HostileFrames::Change(LineBytes bytes, Random& random) const {
  for (std::size_t changes = 1 + random.Below(3); changes > 0; --changes) {
    const std::size_t what = random.Below(12);
    if (what >= 8) {
      bytes = ChangeOneByte(std::move(bytes), random);
    } else if (what < 3) {
      ChangeContent(framing_, bytes, random);
    } else if (what < 7) {
      BreakBytes(framing_, bytes, random);
    } else {  // its beginning, and the end of another
      const LineBytes other = Valid(random);
      bytes.resize(random.Below(bytes.size() + 1));
      bytes.insert(bytes.end(), other.begin() + static_cast<std::ptrdiff_t>(random.Below(other.size())),
                   other.end());
    }
  }
  if (bytes.size() > kHostileBytesMax) bytes.resize(kHostileBytesMax);
  if (bytes.empty()) bytes.push_back(framing_.special_bytes().front());
  return bytes;
}

}  // namespace tiltproof::harness
