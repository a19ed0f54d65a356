#include "link/raw_framing.h"

#include <array>

namespace tiltproof::link {
namespace {

// All that is there belongs to one chunk.
class WholeCutter final : public FrameCutter {
 public:
  std::optional<std::size_t> FindEnd(std::span<const std::uint8_t> bytes) override {
    return bytes.empty() ? std::nullopt : std::optional(bytes.size());
  }
  void Reset() override {}
};

class NoReader final : public FrameReader {
 public:
  std::optional<FrameReading> Next(std::span<const std::uint8_t>& bytes) override {
    bytes = {};
    return std::nullopt;
  }
  std::optional<FrameReading> Finish() override { return std::nullopt; }
};

class RawFraming final : public Framing {
 public:
  std::string_view name() const override { return "bytes"; }
  std::span<const std::uint8_t> opening() const override { return {}; }
  void AppendBehindOpening(std::span<const std::uint8_t> payload, std::uint32_t /*damage*/,
                           std::vector<std::uint8_t>& to) const override {
    to.insert(to.end(), payload.begin(), payload.end());
  }
  std::optional<FrameParts> Split(std::span<const std::uint8_t> /*frame*/) const override {
    return std::nullopt;
  }
  std::vector<ByteRole> Roles(std::span<const std::uint8_t> frame) const override {
    return std::vector<ByteRole>(frame.size(), ByteRole::kPayload);
  }
  std::unique_ptr<FrameReader> MakeReader() const override { return std::make_unique<NoReader>(); }
  std::unique_ptr<FrameCutter> MakeCutter() const override { return std::make_unique<WholeCutter>(); }
  std::optional<FrameEnd> frame_end() const override { return std::nullopt; }
  std::optional<std::uint8_t> flag() const override { return std::nullopt; }
  std::optional<std::uint8_t> escape() const override { return std::nullopt; }
  std::size_t check_bytes() const override { return 0; }
  std::span<const std::uint8_t> special_bytes() const override { return kSpecialBytes; }

 private:
  static constexpr std::array<std::uint8_t, 1> kSpecialBytes = {0};
};

}  // namespace

const std::shared_ptr<const Protocol>& RawProtocol() {
  static const std::shared_ptr<const Protocol> protocol = [] {
    auto raw = std::make_shared<Protocol>();
    raw->name = "bytes";
    raw->framing = std::make_shared<const RawFraming>();
    return raw;
  }();
  return protocol;
}

}  // namespace tiltproof::link
