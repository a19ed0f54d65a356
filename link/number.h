// Numbers of a fixed size in bytes: the fields of messages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace tiltproof::link {

// Their names in protocol files: "u8" ... "f64". f32 and f64 are IEEE-754 binary32 and binary64.
enum class NumberType : std::uint8_t { kU8, kI8, kU16, kI16, kU32, kI32, kF32, kF64 };
inline constexpr std::size_t kNumberTypeCount = 8;
std::string_view Name(NumberType type);

enum class ByteOrder : std::uint8_t { kLittle, kBig };
std::string_view Name(ByteOrder order);

constexpr std::size_t NumberBytes(NumberType type) {
  switch (type) {
    case NumberType::kU8:
    case NumberType::kI8:
      return 1;
    case NumberType::kU16:
    case NumberType::kI16:
      return 2;
    case NumberType::kU32:
    case NumberType::kI32:
    case NumberType::kF32:
      return 4;
    case NumberType::kF64:
      return 8;
  }
  return 8;
}
constexpr bool IsInteger(NumberType type) { return type != NumberType::kF32 && type != NumberType::kF64; }

// The smallest and the largest finite number.
double LeastNumber(NumberType type);
double LargestNumber(NumberType type);

// The bits of the first NumberBytes(type) bytes, which must be there, as an unsigned number.
std::uint64_t LoadBits(NumberType type, ByteOrder order, std::span<const std::uint8_t> bytes);
void StoreBits(NumberType type, ByteOrder order, std::uint64_t bits, std::span<std::uint8_t> bytes);

// The number in these bytes. A double holds each of them exactly.
double LoadNumber(NumberType type, ByteOrder order, std::span<const std::uint8_t> bytes);
// The nearest number of that type. An integer is rounded half away from zero, and a value beyond its range becomes the
// end of the range, as in a sensor that saturates; a NaN becomes 0. An f32 and an f64 keep NaN and infinity.
void StoreNumber(NumberType type, ByteOrder order, double value, std::span<std::uint8_t> bytes);

}  // namespace tiltproof::link
