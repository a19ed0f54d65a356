#include "harness/campaign/hostile_frames.h"

#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "faults/field_range.h"
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

// A number in a payload, and the ends of what a receiver takes for plausible.
struct Number {
  link::NumberType type{};
  link::ByteOrder order{};
  std::size_t offset = 0;
  double least = 0, largest = 0;  // as on the line
};

template <class Float>
double OddFloat(const Number& number, Random& random) {
  using Limits = std::numeric_limits<Float>;
  const auto values = std::to_array<Float>(
      {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), -Float{0}, Limits::denorm_min(),
       Limits::max(), Limits::lowest(), Float{3e9},  // of no 32-bit integer
       Float{1e4}, Float{-1e3}, Float{100.5}, static_cast<Float>(2 * random.Uniform() - 1),
       std::nextafter(static_cast<Float>(number.largest), Limits::max()),
       std::nextafter(static_cast<Float>(number.least), Limits::lowest())});
  return static_cast<double>(values[random.Below(values.size())]);
}

// A number that no sender should send: of an integer the ends of its type and of its range, and the numbers beyond
// these; of a float also those that are no numbers.
void BreakNumber(const Number& number, LineBytes& payload, Random& random) {
  const std::span<std::uint8_t> bytes = std::span(payload).subspan(number.offset);
  if (number.type == link::NumberType::kF32) {
    StoreNumber(number.type, number.order, OddFloat<float>(number, random), bytes);
  } else if (number.type == link::NumberType::kF64) {
    StoreNumber(number.type, number.order, OddFloat<double>(number, random), bytes);
  } else {
    const auto values =
        std::to_array<double>({link::LeastNumber(number.type), link::LargestNumber(number.type), 0, 1, -1,
                               number.least, number.least - 1, number.largest, number.largest + 1,
                               link::LargestNumber(number.type) * random.Uniform()});
    StoreNumber(number.type, number.order, values[random.Below(values.size())], bytes);
  }
}

// The numbers of a message: its id and its fields. Of bytes that are no message, any number anywhere.
Number NumberIn(const link::Protocol& protocol, const LineBytes& payload, Random& random) {
  const link::MessageType* type = nullptr;
  for (std::size_t i = 0; type == nullptr && i < link::kDirectionCount; ++i)
    type = protocol.Classify(static_cast<link::Direction>(i), payload);
  if (type == nullptr || (type->fields.empty() && !type->id)) {
    Number any{.type = static_cast<link::NumberType>(random.Below(link::kNumberTypeCount)),
               .order = static_cast<link::ByteOrder>(random.Below(2))};
    if (payload.size() < link::NumberBytes(any.type)) any.type = link::NumberType::kU8;
    any.offset = random.Below(payload.size() + 1 - link::NumberBytes(any.type));
    return any;
  }
  const std::size_t at = random.Below(type->fields.size() + (type->id ? 1 : 0));
  if (at == type->fields.size())
    return {.type = type->id->type, .order = type->id->order, .least = 0, .largest = 255};
  const link::MessageField& field = type->fields[at];
  return {.type = field.type,
          .order = field.order,
          .offset = field.offset,
          .least = field.min / field.scale,
          .largest = field.max / field.scale};
}

void BreakValue(const link::Protocol& protocol, LineBytes& payload, Random& random) {
  if (!payload.empty()) BreakNumber(NumberIn(protocol, payload, random), payload, random);
}

// A length that a buffer may not have.
std::size_t OddLength(std::size_t usual, Random& random) {
  // 254 bytes of payload and check are a full block of COBS.
  constexpr std::array<std::size_t, 15> kEdges = {0,   1,   2,   63,  64,  128, 250, 252,
                                                  253, 254, 255, 256, 257, 300, 508};
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
  const std::span<const std::uint8_t> special = framing.special_bytes();
  if (random.Below(4) == 0 &&
      bytes.size() >= special.size()) {  // a payload that looks like the start of a frame
    std::ranges::copy(special, At(bytes, random.Below(bytes.size() + 1 - special.size())));
    return;
  }
  for (std::size_t changes = 1 + random.Below(8); changes > 0 && !bytes.empty(); --changes)
    bytes[random.Below(bytes.size())] =
        random.Below(2) == 0 ? ByteOfMeaning(framing, random) : AnyByte(random);
}

// Another length or code: an end of its range, a little more or less, one that reaches beyond the end, or any.
std::uint8_t OddLengthByte(std::uint8_t usual, std::size_t bytes_left, Random& random) {
  constexpr std::array<std::uint8_t, 8> kEdges = {0x00, 0x01, 0x02, 0x7F, 0x80, 0xFD, 0xFE, 0xFF};
  switch (random.Below(4)) {
    case 0:
      return static_cast<std::uint8_t>(usual + 1 - 2 * random.Below(2));
    case 1:
      return static_cast<std::uint8_t>(bytes_left + random.Below(4));
    case 2:
      return AnyByte(random);
    default:
      return kEdges[random.Below(kEdges.size())];
  }
}

// Breaks a byte that is not payload in one of the frames: each role is as likely as another.
void BreakStructure(const Framing& framing, LineBytes& bytes, Random& random) {
  using link::ByteRole;
  std::vector<std::size_t> begins = {0};
  const std::unique_ptr<link::FrameCutter> cutter = framing.MakeCutter();
  while (const auto size = cutter->FindEnd(std::span(bytes).subspan(begins.back())))
    begins.push_back(begins.back() + *size);
  if (begins.back() == bytes.size()) begins.pop_back();
  if (begins.empty()) return;
  const std::size_t frame = random.Below(begins.size());
  const std::size_t begin = begins[frame];
  const std::size_t end = frame + 1 < begins.size() ? begins[frame + 1] : bytes.size();
  const std::vector<ByteRole> roles = framing.Roles(std::span(bytes).subspan(begin, end - begin));
  std::vector<ByteRole> present;
  for (const ByteRole role : roles)
    if (role != ByteRole::kPayload && std::ranges::find(present, role) == present.end())
      present.push_back(role);
  if (present.empty()) return;
  const ByteRole role = present[random.Below(present.size())];
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < roles.size(); ++i)
    if (roles[i] == role) places.push_back(begin + i);
  const std::size_t at = places[random.Below(places.size())];
  if (role == ByteRole::kLength || role == ByteRole::kCode) {
    bytes[at] = OddLengthByte(bytes[at], end - at, random);
  } else if (role == ByteRole::kCheck) {
    bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ 1U << random.Below(8));
  } else if (random.Below(2) == 0) {
    bytes.erase(At(bytes, at));
  } else {
    bytes.insert(At(bytes, at), bytes[at]);
  }
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

namespace {

// `value`, if it is at most `old` behind `expected` or `ahead` before of it on a circle of `range` numbers.
double NearOrExpected(double value, double expected, double range, double old, double ahead) {
  expected = std::fmod(expected, range);
  const double behind = std::fmod(expected - value + range, range);
  return behind <= old || behind >= range - ahead ? value : expected;
}

// True if it changed a field.
bool RestampPayload(const link::MessageType& type, LineBytes& payload, TimeNs time_ns, TimeNs period_ns) {
  constexpr double kOldPeriods = 4;
  const auto period = static_cast<double>(type.period_ns != 0 ? type.period_ns : period_ns);
  const auto time = static_cast<double>(time_ns);
  bool changed = false;
  for (std::size_t i = 0; i < type.fields.size(); ++i) {
    const link::MessageField& field = type.fields[i];
    if (field.content == link::FieldContent::kSignal || !link::IsInteger(field.type)) continue;
    const double range = link::LargestNumber(field.type) + 1;
    const double before = link::FieldValue(type, payload, i);
    const double after = field.content == link::FieldContent::kSequence
                             ? NearOrExpected(before, std::floor(time / period), range, kOldPeriods, 1)
                             : NearOrExpected(before, std::floor((time + period / 2) / 1e3), range,
                                              kOldPeriods * period / 1e3, 0);
    if (after == before) continue;
    link::SetFieldValue(type, payload, i, after);
    changed = true;
  }
  return changed;
}

}  // namespace

void Restamp(const link::Protocol& protocol, link::Direction direction, LineBytes& bytes, TimeNs time_ns) {
  const Framing& framing = *protocol.framing;
  LineBytes restamped;
  std::size_t copied = 0;  // of `bytes`
  const std::unique_ptr<link::FrameReader> reader = framing.MakeReader();
  std::span<const std::uint8_t> rest(bytes);
  while (const auto read = reader->Next(rest)) {
    const link::MessageType* type = read->ok ? protocol.Classify(direction, read->payload) : nullptr;
    LineBytes payload(read->payload.begin(), read->payload.end());
    if (type == nullptr || !RestampPayload(*type, payload, time_ns, protocol.control_period_ns)) continue;
    // Flags stay, because frames may share them.
    LineBytes frame = framing.Encode(payload);
    if (framing.flag()) frame.pop_back();
    restamped.insert(restamped.end(), At(bytes, copied), At(bytes, read->content_begin));
    restamped.insert(restamped.end(), At(frame, framing.opening().size()), frame.end());
    copied = read->content_end;
  }
  restamped.insert(restamped.end(), At(bytes, copied), bytes.end());
  bytes = std::move(restamped);
}

void ChangeContent(const link::Protocol& protocol, LineBytes& bytes, Random& random,
                   const ChangeBytes& change) {
  constexpr std::size_t kMoreBytesMax = 8;
  WithContent(*protocol.framing, bytes, [&](LineBytes& payload) {
    switch (random.Below(4)) {
      case 0:
        payload.resize(OddLength(payload.size(), random));
        break;
      case 1:
        change(payload, kMoreBytesMax);
        break;
      default:
        BreakValue(protocol, payload, random);
    }
  });
}

void ChangeContent(const link::Protocol& protocol, LineBytes& bytes, Random& random) {
  ChangeContent(protocol, bytes, random, [&](LineBytes& content, std::size_t more_bytes_max) {
    RandomBytes(*protocol.framing, content, more_bytes_max, random);
  });
}

void BreakBytes(const Framing& framing, LineBytes& bytes, Random& random) {
  if (bytes.empty()) return;
  const std::size_t at = random.Below(bytes.size());
  const std::uint8_t meaning = ByteOfMeaning(framing, random);
  switch (random.Below(8)) {
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
    case 5:  // a shared flag, or none at all
      bytes.erase(random.Below(2) == 0 ? bytes.begin() : bytes.end() - 1);
      break;
    default:
      BreakStructure(framing, bytes, random);
  }
}

HostileFrames::HostileFrames(const link::Protocol& protocol, link::Direction direction)
    : protocol_(protocol), framing_(*protocol.framing) {
  for (const link::MessageType& type : protocol.messages)
    if (type.direction == direction) types_.push_back(&type);
}

LineBytes HostileFrames::Payload(Random& random) const {
  Check(!types_.empty(), "a wire on which the protocol has a message");
  const link::MessageType& type = *types_[random.Below(types_.size())];
  std::vector<double> values;
  for (const link::MessageField& field : type.fields) {
    // Mostly near zero, sometimes anywhere in the range.
    const auto [min, max] = faults::MadeUpRange(field);
    const double limit = std::max(std::abs(min), std::abs(max));
    const double reach = random.Below(8) == 0 ? limit : std::min(limit, 1.0);
    values.push_back(std::clamp((2 * random.Uniform() - 1) * reach, min, max));
  }
  const link::Payload payload = protocol_.Encode(type, values);
  return {payload.span().begin(), payload.span().end()};
}

LineBytes HostileFrames::Valid(Random& random) const { return framing_.Encode(Payload(random)); }

// Frames of zero to four bytes: between flags, or behind a length that is theirs or not.
LineBytes HostileFrames::ShortFrames(Random& random) const {
  LineBytes said;
  const std::optional<std::uint8_t> flag = framing_.flag();
  for (std::size_t frames = 1 + random.Below(16); frames > 0; --frames) {
    LineBytes bytes;
    for (std::size_t count = random.Below(5); count > 0; --count) bytes.push_back(AnyByte(random));
    if (flag) {
      said.push_back(*flag);
    } else {
      bytes = framing_.Encode(bytes);
      if (random.Below(2) == 0) BreakStructure(framing_, bytes, random);
    }
    said.insert(said.end(), bytes.begin(), bytes.end());
  }
  if (flag) said.push_back(*flag);
  return said;
}

LineBytes HostileFrames::Make(Random& random) const {
  LineBytes said;
  switch (random.Below(12)) {
    case 0:  // what an honest sender says
      return Valid(random);
    case 1: {  // a wrong check
      if (framing_.check_bytes() == 0) return Valid(random);
      const std::uint64_t last = (std::uint64_t{1} << 8 * framing_.check_bytes()) - 1;
      const auto damage = static_cast<std::uint32_t>(1 + random.Below(last));
      return framing_.Encode(Payload(random), damage);
    }
    case 2:  // a length that is wrong, under a right check
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
    case 6:
      return ShortFrames(random);
    case 7: {  // values that no sender should send, in each field
      LineBytes payload = Payload(random);
      for (std::size_t i = 1 + random.Below(4); i > 0; --i) BreakValue(protocol_, payload, random);
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
      ChangeContent(protocol_, bytes, random);
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
