// Helpers for models that edit bits: the data and parity bits of a chunk, numbered from 0 as a UART sends them,
// the least significant data bit of a byte first and its parity bit last; and texts that describe them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "faults/model.h"
#include "link/check.h"

namespace tiltproof::faults {

// Flips bits of a chunk and keeps the list for the activation record. Without parity, each byte has its data bits only.
class BitFlipper {
 public:
  BitFlipper(link::Chunk& chunk, const WireContext& context, const link::CharacterFormat& character)
      : chunk_(chunk),
        context_(context),
        has_parity_(character.has_parity()),
        data_bits_(static_cast<std::size_t>(character.data_bits)),
        byte_bits_(static_cast<std::size_t>(character.content_bits())) {}
  ~BitFlipper();
  BitFlipper(const BitFlipper&) = delete;
  BitFlipper& operator=(const BitFlipper&) = delete;

  std::size_t BitCount() const { return byte_bits_ * chunk_.bytes.size(); }
  void Flip(std::size_t bit) {
    const std::size_t byte = bit / byte_bits_, place = bit % byte_bits_;
    CheckIndex(byte, chunk_.bytes.size(), "a bit that flips is one of the chunk's");
    if (place < data_bits_)
      chunk_.bytes[byte] = static_cast<std::uint8_t>(chunk_.bytes[byte] ^ (1U << place));
    if (has_parity_) {
      chunk_.parity_errors.resize(chunk_.bytes.size());
      chunk_.parity_errors[byte] ^= 1U;  // two flips in a character hide each other
    }
    if (context_.what != nullptr) Note(bit);
    ++flipped_count_;
  }

 private:
  void Note(std::size_t bit);

  link::Chunk& chunk_;
  const WireContext& context_;
  bool has_parity_;
  std::size_t data_bits_, byte_bits_;
  std::size_t flipped_count_ = 0;
  std::string list_;
};

// True if a receiver that reads 00 of a low line notices that the parity bit, low as well, is wrong.
inline bool LowIsParityError(const link::CharacterFormat& character) {
  return character.has_parity() && character.ParityBit(0);
}

// "byte 12 7e -> 5e"
std::string ByteChange(std::size_t index, std::uint8_t before, std::uint8_t after);
// "7e"
std::string Hex(std::uint8_t byte);

}  // namespace tiltproof::faults
