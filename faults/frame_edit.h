// Editing a frame's payload, for models of senders that build frames well but with wrong content.
//
//   FrameEdit edit(chunk.bytes);
//   if (edit.ok()) {
//     edit.payload().push_back(0);
//     edit.WriteTo(chunk.bytes);  // escaped again, with the checksum of the new payload
//   }
//
// A frame that was damaged before stays damaged: the bits in which its checksum was wrong are wrong in the new
// one, too.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tiltproof::faults {

class FrameEdit {
 public:
  explicit FrameEdit(std::span<const std::uint8_t> frame);

  // True if it is a frame with a closing flag and a checksum.
  bool ok() const { return ok_; }
  std::vector<std::uint8_t>& payload() { return payload_; }
  // The frame with the payload as it is now, between the flags that it had.
  void WriteTo(std::vector<std::uint8_t>& frame) const;

 private:
  bool ok_ = false;
  std::size_t flags_before_ = 0;
  std::uint16_t damage_ = 0;  // of the checksum
  std::vector<std::uint8_t> payload_;
};

// A whole frame with that payload.
std::vector<std::uint8_t> FrameOf(std::span<const std::uint8_t> payload);

// Binary32, low byte first.
float FloatAt(std::span<const std::uint8_t> payload, std::size_t offset);
void SetFloat(std::span<std::uint8_t> payload, std::size_t offset, float value);

}  // namespace tiltproof::faults
