#include "faults/bits.h"

#include <algorithm>

namespace tiltproof::faults {
namespace {

constexpr std::size_t kListedMax = 16;

}  // namespace

BitFlipper::~BitFlipper() {
  std::vector<std::uint8_t>& errors = chunk_.parity_errors;
  if (std::find(errors.begin(), errors.end(), 1) == errors.end()) errors.clear();
  if (context_.what == nullptr || flipped_count_ == 0) return;
  context_.Say(std::to_string(flipped_count_) + (flipped_count_ == 1 ? " bit flipped: " : " bits flipped: ") +
               list_ + (flipped_count_ > kListedMax ? ", ..." : ""));
}

void BitFlipper::Note(std::size_t bit) {
  if (flipped_count_ >= kListedMax) return;
  if (flipped_count_ > 0) list_ += ", ";
  const std::size_t place = bit % byte_bits_;
  list_ += "byte " + std::to_string(bit / byte_bits_) +
           (place < data_bits_ ? " bit " + std::to_string(place) : std::string(" parity bit"));
}

std::string Hex(std::uint8_t byte) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  return {kDigits[byte >> 4], kDigits[byte & 0xF]};
}

std::string ByteChange(std::size_t index, std::uint8_t before, std::uint8_t after) {
  return "byte " + std::to_string(index) + " " + Hex(before) + " -> " + Hex(after);
}

}  // namespace tiltproof::faults
