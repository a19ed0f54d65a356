#include "harness/integrity/frame_sample.h"

#include <algorithm>
#include <cmath>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr double kShareOfRange = 0.01;
constexpr std::int64_t kFletcherModulus = 255;

}  // namespace

FrameSample::FrameSample(const link::Protocol& protocol, const link::MessageType& type,
                         faults::Random& random)
    : protocol_(&protocol), type_(&type) {
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    std::vector<double> values;
    for (const link::MessageField& field : type.fields) {
      const double share = kShareOfRange * (2 * random.Uniform() - 1);
      values.push_back(share * std::min(std::abs(field.min), std::abs(field.max)));
    }
    const link::Payload payload = protocol.Encode(type, values);
    payloads_[i].assign(payload.span().begin(), payload.span().end());
    frames_[i] = protocol.framing->Encode(payloads_[i]);
  }
  for (const auto special : {protocol.framing->flag(), protocol.framing->escape()})
    if (special) is_special_[*special] = true;
  content_ = ContentOf(frames_[1]);
  for (std::size_t i = 0; i < frames_[1].size(); ++i) places_.push_back(FindPlace(i));
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

Received FrameSample::Receive(std::span<const std::uint8_t> damaged) const {
  Received received;
  const auto reader = protocol_->framing->MakeReader();
  const auto look = [&](const link::FrameReading& reading) {
    if (!reading.ok || std::ranges::any_of(payloads_, [&](const auto& sent) {
          return std::ranges::equal(sent, reading.payload);
        }))
      return;
    ++received.passed_check_count;
    link::Message message;
    if (protocol_->Decode(type_->direction, reading.payload, message) == link::MessageStatus::kOk)
      ++received.accepted_count;
  };
  for (std::span<const std::uint8_t> bytes :
       {std::span<const std::uint8_t>(frames_[0]), damaged, std::span<const std::uint8_t>(frames_[2])})
    while (const auto reading = reader->Next(bytes)) look(*reading);
  if (const auto reading = reader->Finish()) look(*reading);
  return received;
}

FrameCheck::FrameCheck(link::CheckKind kind, std::size_t content_bytes)
    : kind_(kind), payload_bytes_(content_bytes - link::CheckBytes(kind)) {
  using link::CheckKind;
  if (kind != CheckKind::kCrc16Ibm3740 && kind != CheckKind::kCrc16IbmSdlc &&
      kind != CheckKind::kCrc32IsoHdlc)
    return;
  // A change of bits changes a CRC in bits that do not depend on the data.
  const std::vector<std::uint8_t> zeros(content_bytes);
  const std::uint32_t of_zeros = link::Checksum(kind, std::span(zeros).first(payload_bytes_));
  syndromes_.resize(content_bytes);
  for (std::size_t place = 0; place < content_bytes; ++place) {
    for (std::size_t bits = 0; bits < 256; ++bits) {
      std::vector<std::uint8_t> changed = zeros;
      changed[place] = static_cast<std::uint8_t>(bits);
      const auto parts = std::span<const std::uint8_t>(changed);
      syndromes_[place][bits] = link::Checksum(kind, parts.first(payload_bytes_)) ^ of_zeros ^
                                link::LoadCheck(kind, parts.subspan(payload_bytes_));
    }
  }
}

void FrameCheck::Begin(std::span<const std::uint8_t> content) {
  Check(content.size() == payload_bytes_ + link::CheckBytes(kind_), "a check is of contents of one length");
  syndrome_ = 0;
  if (is_linear()) return;
  sum1_ = sum2_ = 0;
  for (std::size_t i = 0; i < link::CheckBytes(kind_); ++i) check_[i] = content[payload_bytes_ + i];
  // So that Holds() compares the sums with the check as it arrives.
  if (kind_ == link::CheckKind::kFletcher16) {
    sum1_ = check_[0];
    sum2_ = check_[1];
  } else if (kind_ == link::CheckKind::kSum8) {
    sum1_ = check_[0];
  }
}

void FrameCheck::Change(std::size_t place, std::uint8_t from, std::uint8_t to) {
  if (is_linear()) {
    syndrome_ ^= syndromes_[place][from ^ to];
  } else if (place >= payload_bytes_) {
    check_[place - payload_bytes_] = to;
  } else {
    const std::int64_t change = std::int64_t{to} - from;
    sum1_ += change;
    sum2_ += change * static_cast<std::int64_t>(payload_bytes_ - place);
  }
}

bool FrameCheck::Holds() const {
  const auto reduced = [](std::int64_t sum, std::int64_t modulus) {
    return ((sum % modulus) + modulus) % modulus;
  };
  switch (kind_) {
    case link::CheckKind::kFletcher16:
      return reduced(sum1_, kFletcherModulus) == check_[0] && reduced(sum2_, kFletcherModulus) == check_[1];
    case link::CheckKind::kSum8:
      return reduced(sum1_, 256) == check_[0];
    case link::CheckKind::kNone:
      return true;
    case link::CheckKind::kCrc16Ibm3740:
    case link::CheckKind::kCrc16IbmSdlc:
    case link::CheckKind::kCrc32IsoHdlc:
      break;
  }
  return syndrome_ == 0;
}

}  // namespace tiltproof::harness
