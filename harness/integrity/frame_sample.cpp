#include "harness/integrity/frame_sample.h"

#include <algorithm>
#include <cmath>
#include <variant>

namespace tiltproof::harness {
namespace {

constexpr double kShareOfRange = 0.01;
// A field whose range is that of its type has values of everyday size nevertheless.
constexpr double kHalfRangeMax = 1e4;

double DrawValue(const link::MessageField& field, faults::Random& random) {
  const double half = std::min(field.max / 2 - field.min / 2, kHalfRangeMax);
  return field.min / 2 + field.max / 2 + kShareOfRange * (2 * random.Uniform() - 1) * half;
}

}  // namespace

FrameSample::FrameSample(const link::Protocol& protocol, const link::MessageType& type,
                         faults::Random& random)
    : protocol_(&protocol), type_(&type) {
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    std::vector<double> values;
    for (const link::MessageField& field : type.fields) values.push_back(DrawValue(field, random));
    const link::Payload payload = protocol.Encode(type, values);
    payloads_[i].assign(payload.span().begin(), payload.span().end());
    frames_[i] = protocol.framing->Encode(payloads_[i]);
  }
  for (const auto special : {protocol.framing->flag(), protocol.framing->escape()})
    if (special) is_special_[*special] = true;
  if (const auto end = protocol.framing->frame_end())
    if (const auto* header = std::get_if<link::LengthHeader>(&*end)) marks_count_ = header->sync_count;
  content_ = ContentOf(frames_[1]);
  for (std::size_t i = 0; i < frames_[1].size(); ++i) places_.push_back(FindPlace(i));
}

bool FrameSample::IsBetweenFlags() const {
  const auto flag = protocol_->framing->flag();
  const auto opening = protocol_->framing->opening();
  return flag && opening.size() == 1 && opening[0] == *flag && frames_[1].back() == *flag;
}

std::vector<std::uint8_t> FrameSample::ContentOf(std::span<const std::uint8_t> frame) const {
  const auto parts = protocol_->framing->Split(frame);
  if (!parts) return {};
  std::vector<std::uint8_t> content = parts->payload;
  const link::CheckKind kind = protocol_->framing->check().value();
  const std::uint32_t check = link::Checksum(kind, parts->payload) ^ parts->damage;
  for (std::size_t i = 0; i < link::CheckBytes(kind); ++i) content.push_back(link::CheckByte(kind, check, i));
  return content;
}

// Tries it out, so that nothing here depends on the framing.
std::size_t FrameSample::FindPlace(std::size_t wire_place) const {
  std::size_t found = kNone;
  std::vector<std::uint8_t> changed = frames_[1];
  for (int bits = 1; bits < 256; bits *= 2) {
    const auto byte = static_cast<std::uint8_t>(frames_[1][wire_place] ^ bits);
    if (IsSpecial(byte)) continue;
    changed[wire_place] = byte;
    const std::vector<std::uint8_t> content = ContentOf(changed);
    if (content.size() != content_.size()) return kNone;
    const auto [before, after] = std::mismatch(content_.begin(), content_.end(), content.begin());
    if (before == content_.end() || (*before ^ *after) != bits ||
        !std::equal(before + 1, content_.end(), after + 1))
      return kNone;
    const auto place = static_cast<std::size_t>(before - content_.begin());
    if (found != kNone && found != place) return kNone;
    found = place;
  }
  return found;
}

void FrameSample::Count(const link::FrameReading& reading, Received& received) const {
  if (!reading.ok || std::ranges::any_of(payloads_, [&](const auto& sent) {
        return std::ranges::equal(sent, reading.payload);
      }))
    return;
  ++received.passed_check_count;
  if (protocol_->Classify(type_->direction, reading.payload) == nullptr) return;
  ++received.passed_length_count;
  link::Message message;
  if (protocol_->Decode(type_->direction, reading.payload, message) == link::MessageStatus::kOk)
    ++received.accepted_count;
}

Received FrameSample::Receive(std::span<const std::uint8_t> damaged) const {
  Received received;
  const auto reader = protocol_->framing->MakeReader();
  for (std::span<const std::uint8_t> bytes :
       {std::span<const std::uint8_t>(frames_[0]), damaged, std::span<const std::uint8_t>(frames_[2])})
    while (const auto reading = reader->Next(bytes)) Count(*reading, received);
  if (const auto reading = reader->Finish()) Count(*reading, received);
  return received;
}

FrameReceiver::FrameReceiver(const FrameSample& sample)
    : sample_(sample),
      reader_(sample.protocol_->framing->MakeReader()),
      flag_(sample.protocol_->framing->flag()) {
  Received none;
  if (flag_) Feed({&*flag_, 1}, none);
}

Received FrameReceiver::Receive(std::span<const std::uint8_t> damaged) {
  Received received;
  const bool is_read = Feed(damaged, received);
  // Now the reader is where it was before: behind a flag, or behind a frame.
  const bool is_closed = flag_ ? !damaged.empty() && damaged.back() == *flag_ : is_read;
  if (is_closed) return received;
  Feed(sample_.frames_[2], received);
  if (!flag_)
    if (const auto reading = reader_->Finish()) sample_.Count(*reading, received);
  return received;
}

bool FrameReceiver::Feed(std::span<const std::uint8_t> bytes, Received& received) {
  fed_count_ += bytes.size();
  bool is_read = bytes.empty();
  while (const auto reading = reader_->Next(bytes)) {
    sample_.Count(*reading, received);
    is_read = reading->end == fed_count_ && reading->content_end == fed_count_;
  }
  return is_read;
}

}  // namespace tiltproof::harness
