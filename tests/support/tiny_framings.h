// Two framings as simple as can be: references for those of the product, and a test runs all that depends on the framing
// over them. Each of their readers keeps the bytes since the last frame and asks after every byte.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/scenario/shipped_protocols.h"
#include "link/framing.h"
#include "link/protocol.h"

namespace tiltproof::link {

using TinyBytes = std::vector<std::uint8_t>;

class TinyFraming : public Framing {
 public:
  // True if nothing of a frame is in these bytes.
  virtual bool IsIdle(const TinyBytes& bytes) const = 0;
  // True if the last one of these bytes ends a frame.
  virtual bool Ends(const TinyBytes& bytes) const = 0;

  std::span<const std::uint8_t> opening() const override { return {}; }
  std::optional<std::uint8_t> escape() const override { return std::nullopt; }
  std::unique_ptr<FrameReader> MakeReader() const override { return std::make_unique<Reader>(*this); }
  std::unique_ptr<FrameCutter> MakeCutter() const override { return std::make_unique<Cutter>(*this); }

 private:
  class Reader : public FrameReader {
   public:
    explicit Reader(const TinyFraming& framing) : framing_(framing) {}
    std::optional<FrameReading> Next(std::span<const std::uint8_t>& bytes) override {
      while (!bytes.empty()) {
        frame_.push_back(bytes.front());
        bytes = bytes.subspan(1);
        ++offset_;
        if (framing_.IsIdle(frame_)) frame_.clear();
        if (frame_.empty() || !framing_.Ends(frame_)) continue;
        const auto parts = framing_.Split(frame_);
        return Take(!parts ? "malformed" : parts->damage != 0 ? "bad_checksum" : "ok", parts);
      }
      return std::nullopt;
    }
    std::optional<FrameReading> Finish() override {
      if (frame_.empty()) return std::nullopt;
      return Take("aborted", std::nullopt);
    }

   private:
    FrameReading Take(std::string_view status, const std::optional<FrameParts>& parts) {
      payload_ = parts ? parts->payload : TinyBytes();
      const std::uint64_t begin = offset_ - frame_.size();
      const std::uint64_t flags = status != "aborted" && framing_.flag() ? 1 : 0;
      frame_.clear();
      return {status, status == "ok", payload_, begin, offset_, begin, offset_ - flags};
    }
    const TinyFraming& framing_;
    TinyBytes frame_, payload_;
    std::uint64_t offset_ = 0;
  };

  class Cutter : public FrameCutter {
   public:
    explicit Cutter(const TinyFraming& framing) : framing_(framing) {}
    std::optional<std::size_t> FindEnd(std::span<const std::uint8_t> bytes) override {
      for (std::size_t i = 0; i < bytes.size(); ++i) {
        frame_.push_back(bytes[i]);
        if (framing_.IsIdle(frame_)) frame_.clear();
        if (frame_.empty() || !framing_.Ends(frame_)) continue;
        frame_.clear();
        return i + 1;
      }
      return std::nullopt;
    }
    void Reset() override { frame_.clear(); }

   private:
    const TinyFraming& framing_;
    TinyBytes frame_;
  };
};

// Consistent Overhead Byte Stuffing (Cheshire and Baker, 1999) and CRC-16/IBM-3740, the high byte first: a code, the
// number of bytes up to the next 00, stands in place of each 00; a 00 ends the frame.
class CobsFraming : public TinyFraming {
 public:
  std::string_view name() const override { return "cobs"; }
  bool IsIdle(const TinyBytes& bytes) const override { return bytes.size() == 1 && bytes[0] == 0; }
  bool Ends(const TinyBytes& bytes) const override { return bytes.back() == 0; }

  void AppendBehindOpening(std::span<const std::uint8_t> payload, std::uint32_t damage,
                           TinyBytes& to) const override {
    TinyBytes all(payload.begin(), payload.end());
    const std::uint32_t check = Crc(payload) ^ damage;
    all.push_back(static_cast<std::uint8_t>(check >> 8 & 0xFF));
    all.push_back(static_cast<std::uint8_t>(check & 0xFF));
    std::size_t code = to.size();
    to.push_back(1);
    for (const std::uint8_t byte : all) {
      if (to[code] == 0xFF) {  // a full block, which no 00 follows
        code = to.size();
        to.push_back(1);
      }
      if (byte != 0) {
        to.push_back(byte);
        ++to[code];
      } else {
        code = to.size();
        to.push_back(1);
      }
    }
    to.push_back(0);
  }

  std::optional<FrameParts> Split(std::span<const std::uint8_t> frame) const override {
    FrameParts parts{.opening_bytes = CountFlags(*this, frame), .payload = {}};
    std::span<const std::uint8_t> rest = frame.subspan(parts.opening_bytes);
    if (rest.empty() || rest.back() != 0) return std::nullopt;
    rest = rest.first(rest.size() - 1);
    while (!rest.empty()) {
      const std::size_t code = rest.front();
      if (code == 0 || code > rest.size()) return std::nullopt;
      for (const std::uint8_t byte : rest.subspan(1, code - 1)) {
        if (byte == 0) return std::nullopt;
        parts.payload.push_back(byte);
      }
      rest = rest.subspan(code);
      if (code < 0xFF && !rest.empty()) parts.payload.push_back(0);
    }
    if (parts.payload.size() < 2) return std::nullopt;
    const std::size_t size = parts.payload.size() - 2;
    const auto check = static_cast<std::uint32_t>(parts.payload[size] << 8 | parts.payload[size + 1]);
    parts.payload.resize(size);
    parts.damage = check ^ Crc(parts.payload);
    return parts;
  }

  std::vector<ByteRole> Roles(std::span<const std::uint8_t> frame) const override {
    std::vector<ByteRole> roles(frame.size(), ByteRole::kPayload);
    std::vector<std::size_t> places;  // of the bytes of payload and check
    for (std::size_t code = 0; code + 1 < frame.size(); code += frame[code]) {
      const bool is_full =
          code >= 0xFF && frame[code - 0xFF] == 0xFF && roles[code - 0xFF] == ByteRole::kCode;
      if (code > 0 && !is_full) places.push_back(code);
      roles[code] = ByteRole::kCode;
      for (std::size_t i = 1; i < frame[code]; ++i) places.push_back(code + i);
    }
    for (const std::size_t place : {places[places.size() - 2], places.back()})
      if (roles[place] == ByteRole::kPayload) roles[place] = ByteRole::kCheck;
    roles.back() = ByteRole::kFlagByte;
    return roles;
  }

  std::optional<std::uint8_t> flag() const override { return 0; }
  std::size_t check_bytes() const override { return 2; }
  std::span<const std::uint8_t> special_bytes() const override { return kSpecialBytes; }
  // A multiple of the polynomial changes no CRC.
  BlindSpot blind_spot() const override { return {.bytes_count = 3, .ways_count = 8}; }
  std::string ChangeUnseen(std::span<std::uint8_t> bytes, std::uint32_t way) const override {
    const std::uint32_t change = 0x1'1021U << way;
    for (std::size_t i = 0; i < 3; ++i) bytes[i] ^= static_cast<std::uint8_t>(change >> (16 - 8 * i) & 0xFF);
    return "by the polynomial";
  }

 private:
  static constexpr std::array<std::uint8_t, 4> kSpecialBytes = {0x00, 0x01, 0xFF, 0xFE};
  static std::uint32_t Crc(std::span<const std::uint8_t> bytes) {
    std::uint32_t crc = 0xFFFF;
    for (const std::uint8_t byte : bytes) {
      crc ^= static_cast<std::uint32_t>(byte) << 8;
      for (int bit = 0; bit < 8; ++bit) crc = (crc << 1 ^ ((crc & 0x8000) != 0 ? 0x1021U : 0U)) & 0xFFFF;
    }
    return crc;
  }
};

// A5, the payload's length in two bytes, the lower first, the payload, and the bytes of all that, one upon the other (XOR).
class LengthFraming : public TinyFraming {
 public:
  std::string_view name() const override { return "length"; }
  bool IsIdle(const TinyBytes& bytes) const override { return bytes.size() == 1 && bytes[0] != kBegin; }
  bool Ends(const TinyBytes& bytes) const override {
    return bytes.size() >= 3 && bytes.size() == kOverhead + LengthOf(bytes);
  }

  void AppendBehindOpening(std::span<const std::uint8_t> payload, std::uint32_t damage,
                           TinyBytes& to) const override {
    const std::size_t begin = to.size();
    to.push_back(kBegin);
    to.push_back(static_cast<std::uint8_t>(payload.size() & 0xFF));
    to.push_back(static_cast<std::uint8_t>(payload.size() >> 8));
    to.insert(to.end(), payload.begin(), payload.end());
    to.push_back(static_cast<std::uint8_t>(Xor(std::span(to).subspan(begin)) ^ damage));
  }

  std::optional<FrameParts> Split(std::span<const std::uint8_t> frame) const override {
    if (frame.size() < kOverhead || frame[0] != kBegin || frame.size() != kOverhead + LengthOf(frame))
      return std::nullopt;
    return FrameParts{.payload = {frame.begin() + 3, frame.end() - 1}, .damage = Xor(frame)};
  }

  std::vector<ByteRole> Roles(std::span<const std::uint8_t> frame) const override {
    std::vector<ByteRole> roles(frame.size(), ByteRole::kPayload);
    roles[0] = ByteRole::kSync;
    roles[1] = roles[2] = ByteRole::kLength;
    roles.back() = ByteRole::kCheck;
    return roles;
  }

  std::optional<std::uint8_t> flag() const override { return std::nullopt; }
  std::size_t check_bytes() const override { return 1; }
  std::span<const std::uint8_t> special_bytes() const override { return kSpecialBytes; }

 private:
  static constexpr std::uint8_t kBegin = 0xA5;
  static constexpr std::size_t kOverhead = 4;
  static constexpr std::array<std::uint8_t, 1> kSpecialBytes = {kBegin};
  static std::size_t LengthOf(std::span<const std::uint8_t> frame) {
    return frame[1] | std::size_t{frame[2]} << 8;
  }
  static std::uint32_t Xor(std::span<const std::uint8_t> bytes) {
    std::uint32_t all = 0;
    for (const std::uint8_t byte : bytes) all ^= byte;
    return all;
  }
};

// The paper's protocol with another framing.
inline std::shared_ptr<const Protocol> PaperOver(std::shared_ptr<const Framing> framing) {
  auto protocol = std::make_shared<Protocol>(*harness::FindProtocol("paper"));
  protocol->framing = std::move(framing);
  return protocol;
}

}  // namespace tiltproof::link
