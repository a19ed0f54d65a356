// Helpers for models that edit bits: data bits of a chunk, numbered from 0, eight per byte, least significant
// first as a UART sends them; and texts that describe them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "faults/model.h"
#include "link/check.h"

namespace tiltproof::faults {

// Flips bits of a chunk and keeps the list for the activation record.
class BitFlipper {
 public:
  BitFlipper(link::Chunk& chunk, const WireContext& context) : chunk_(chunk), context_(context) {}
  ~BitFlipper();
  BitFlipper(const BitFlipper&) = delete;
  BitFlipper& operator=(const BitFlipper&) = delete;

  std::size_t BitCount() const { return 8 * chunk_.bytes.size(); }
  void Flip(std::size_t bit) {
    CheckIndex(bit / 8, chunk_.bytes.size(), "a bit that flips is one of the chunk's");
    chunk_.bytes[bit / 8] = static_cast<std::uint8_t>(chunk_.bytes[bit / 8] ^ (1U << (bit % 8)));
    if (context_.what != nullptr) Note(bit);
    ++flipped_count_;
  }

 private:
  void Note(std::size_t bit);

  link::Chunk& chunk_;
  const WireContext& context_;
  std::size_t flipped_count_ = 0;
  std::string list_;
};

// "byte 12 7e -> 5e"
std::string ByteChange(std::size_t index, std::uint8_t before, std::uint8_t after);
// "7e"
std::string Hex(std::uint8_t byte);

}  // namespace tiltproof::faults
