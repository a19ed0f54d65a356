// Where frames end (link::FrameEnd) as an argument of the lockstep plug-in, which may hold no comma.
//
//   FrameEndText(std::uint8_t{0x7E});            // "126", a flag
//   ParseFrameEnd("aa55:1:255:2");               // marks AA 55, a length of 1 byte up to 255, a check of 2 bytes
//
// The standard library is all that this needs, because the plug-in uses it.
#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "link/frame_cutter.h"

namespace tiltproof::harness {

inline std::string FrameEndText(const link::FrameEnd& end) {
  const auto* header = std::get_if<link::LengthHeader>(&end);
  if (header == nullptr) return std::to_string(*std::get_if<std::uint8_t>(&end));
  std::string text;
  for (const std::uint8_t byte : header->Sync())
    for (const int nibble : {byte >> 4, byte & 15})
      text += "0123456789abcdef"[static_cast<std::size_t>(nibble)];
  for (const std::size_t number : {header->length_bytes, header->payload_bytes_max, header->check_bytes})
    text += ":" + std::to_string(number);
  return text;
}

// Takes a number from the front of `text`; nullopt when there is none that is at most `max`.
inline std::optional<std::uint32_t> TakeNumber(std::string_view& text, int base, std::uint32_t max) {
  std::uint32_t number = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), number, base);
  if (parsed.ec != std::errc() || number > max) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(parsed.ptr - text.data()));
  return number;
}

// The reverse; nullopt for any other text.
inline std::optional<link::FrameEnd> ParseFrameEnd(std::string_view text) {
  std::string_view sync = text.substr(0, text.find(':'));
  if (sync.size() == text.size()) {
    const auto flag = TakeNumber(text, 10, 255);
    if (!flag || !text.empty()) return std::nullopt;
    return static_cast<std::uint8_t>(*flag);
  }
  text.remove_prefix(sync.size());
  link::LengthHeader header;
  for (; !sync.empty(); sync.remove_prefix(2)) {
    std::string_view two = sync.substr(0, 2);
    const auto byte = TakeNumber(two, 16, 255);
    if (!byte || !two.empty() || sync.size() < 2 || header.sync_count == header.sync.size())
      return std::nullopt;
    header.sync[header.sync_count++] = static_cast<std::uint8_t>(*byte);
  }
  constexpr std::array<std::uint32_t, 3> kMost = {2, 0xFFFF, 4};
  std::array<std::size_t, 3> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (text.empty() || text.front() != ':') return std::nullopt;
    text.remove_prefix(1);
    const auto number = TakeNumber(text, 10, kMost[i]);
    if (!number) return std::nullopt;
    numbers[i] = *number;
  }
  if (!text.empty() || header.sync_count == 0 || numbers[0] == 0) return std::nullopt;
  header.length_bytes = numbers[0];
  header.payload_bytes_max = numbers[1];
  header.check_bytes = numbers[2];
  return header;
}

}  // namespace tiltproof::harness
