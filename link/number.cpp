#include "link/number.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
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

// Each number of each message passes here, so that sizes known to the compiler pay.
template <class Act>
auto WithBitsOf(NumberType type, const Act& act) {
  switch (NumberBytes(type)) {
    case 1:
      return act(std::uint8_t{});
    case 2:
      return act(std::uint16_t{});
    case 4:
      return act(std::uint32_t{});
    default:
      return act(std::uint64_t{});
  }
}

// The bits as they stand on the line, from those of this processor, and the other way round.
template <class Bits>
Bits Ordered(ByteOrder order, Bits bits) {
  if ((order == ByteOrder::kBig) == (std::endian::native == std::endian::big)) return bits;
  auto bytes = std::bit_cast<std::array<std::uint8_t, sizeof(Bits)>>(bits);
  std::ranges::reverse(bytes);
  return std::bit_cast<Bits>(bytes);
}

// The number of most messages. It needs neither its size nor its order looked up.
bool IsUsual(NumberType type, ByteOrder order) {
  return type == NumberType::kF32 && order == ByteOrder::kLittle &&
         std::endian::native == std::endian::little;
}

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
  CheckPart(0, NumberBytes(type), bytes.size(), "a number of a message is inside its payload");
  return WithBitsOf(type, [&](auto bits) -> std::uint64_t {
    std::memcpy(&bits, bytes.data(), sizeof(bits));
    return Ordered(order, bits);
  });
}

void StoreBits(NumberType type, ByteOrder order, std::uint64_t bits, std::span<std::uint8_t> bytes) {
  CheckPart(0, NumberBytes(type), bytes.size(), "a number of a message is inside its payload");
  WithBitsOf(type, [&](auto own) {
    own = Ordered(order, static_cast<decltype(own)>(bits));
    std::memcpy(bytes.data(), &own, sizeof(own));
  });
}

double LoadNumber(NumberType type, ByteOrder order, std::span<const std::uint8_t> bytes) {
  if (IsUsual(type, order)) {
    CheckPart(0, sizeof(float), bytes.size(), "a number of a message is inside its payload");
    float value = 0;
    std::memcpy(&value, bytes.data(), sizeof(value));
    return static_cast<double>(value);
  }
  const std::uint64_t bits = LoadBits(type, order, bytes);
  if (type == NumberType::kF32)
    return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
  if (type == NumberType::kF64) return std::bit_cast<double>(bits);
  const double value = static_cast<double>(bits);
  return IsSigned(type) && value > LargestNumber(type) ? value - 2 * (LargestNumber(type) + 1) : value;
}

void StoreNumber(NumberType type, ByteOrder order, double value, std::span<std::uint8_t> bytes) {
  if (IsUsual(type, order)) {
    CheckPart(0, sizeof(float), bytes.size(), "a number of a message is inside its payload");
    const auto number = static_cast<float>(value);
    std::memcpy(bytes.data(), &number, sizeof(number));
    return;
  }
  if (type == NumberType::kF32)
    return StoreBits(type, order, std::bit_cast<std::uint32_t>(static_cast<float>(value)), bytes);
  if (type == NumberType::kF64) return StoreBits(type, order, std::bit_cast<std::uint64_t>(value), bytes);
  const double number =
      std::isnan(value) ? 0 : std::clamp(std::round(value), LeastNumber(type), LargestNumber(type));
  StoreBits(type, order, static_cast<std::uint64_t>(static_cast<std::int64_t>(number)), bytes);
}

}  // namespace tiltproof::link
