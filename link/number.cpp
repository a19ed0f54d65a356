#include "link/number.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "link/check.h"

namespace tiltproof::link {
namespace {

using namespace std::string_view_literals;

struct Range {
  double least, largest;
};
constexpr std::array<Range, kNumberTypeCount> kRanges = {
    {{0, std::numeric_limits<std::uint8_t>::max()},
     {std::numeric_limits<std::int8_t>::min(), std::numeric_limits<std::int8_t>::max()},
     {0, std::numeric_limits<std::uint16_t>::max()},
     {std::numeric_limits<std::int16_t>::min(), std::numeric_limits<std::int16_t>::max()},
     {0, std::numeric_limits<std::uint32_t>::max()},
     {std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max()},
     {static_cast<double>(std::numeric_limits<float>::lowest()),
      static_cast<double>(std::numeric_limits<float>::max())},
     {std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max()}}};

bool IsSigned(NumberType type) {
  return type == NumberType::kI8 || type == NumberType::kI16 || type == NumberType::kI32;
}

}  // namespace

std::string_view Name(NumberType type) {
  static constexpr std::array<std::string_view, kNumberTypeCount> kNames = {
      "u8"sv, "i8"sv, "u16"sv, "i16"sv, "u32"sv, "i32"sv, "f32"sv, "f64"sv};
  return kNames[static_cast<std::size_t>(type)];
}

std::string_view Name(ByteOrder order) { return order == ByteOrder::kLittle ? "little"sv : "big"sv; }

double LeastNumber(NumberType type) { return kRanges[static_cast<std::size_t>(type)].least; }
double LargestNumber(NumberType type) { return kRanges[static_cast<std::size_t>(type)].largest; }

std::uint64_t LoadBits(NumberType type, ByteOrder order, std::span<const std::uint8_t> bytes) {
  const std::size_t size = NumberBytes(type);
  CheckPart(0, size, bytes.size(), "a number of a message is inside its payload");
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < size; ++i)
    bits = bits << 8 | bytes[order == ByteOrder::kBig ? i : size - 1 - i];
  return bits;
}

void StoreBits(NumberType type, ByteOrder order, std::uint64_t bits, std::span<std::uint8_t> bytes) {
  const std::size_t size = NumberBytes(type);
  CheckPart(0, size, bytes.size(), "a number of a message is inside its payload");
  for (std::size_t i = 0; i < size; ++i) {
    bytes[order == ByteOrder::kBig ? size - 1 - i : i] = static_cast<std::uint8_t>(bits & 0xFF);
    bits >>= 8;
  }
}

double LoadNumber(NumberType type, ByteOrder order, std::span<const std::uint8_t> bytes) {
  const std::uint64_t bits = LoadBits(type, order, bytes);
  if (type == NumberType::kF32)
    return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
  if (type == NumberType::kF64) return std::bit_cast<double>(bits);
  const double value = static_cast<double>(bits);
  return IsSigned(type) && value > LargestNumber(type) ? value - 2 * (LargestNumber(type) + 1) : value;
}

void StoreNumber(NumberType type, ByteOrder order, double value, std::span<std::uint8_t> bytes) {
  if (type == NumberType::kF32)
    return StoreBits(type, order, std::bit_cast<std::uint32_t>(static_cast<float>(value)), bytes);
  if (type == NumberType::kF64) return StoreBits(type, order, std::bit_cast<std::uint64_t>(value), bytes);
  const double number =
      std::isnan(value) ? 0 : std::clamp(std::round(value), LeastNumber(type), LargestNumber(type));
  StoreBits(type, order, static_cast<std::uint64_t>(static_cast<std::int64_t>(number)), bytes);
}

}  // namespace tiltproof::link
