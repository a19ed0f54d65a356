#include "harness/terminal/terminal.h"

#include <cstddef>
#include <cstdint>

namespace tiltproof::harness {
namespace {

// A character at the beginning of a text. Without a size: these bytes are no UTF-8.
struct Character {
  std::size_t size = 0;
  std::uint32_t code = 0;
};

// As RFC 3629 has it: nothing overlong, no surrogates, nothing beyond U+10FFFF. `text` is not empty.
Character First(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t first = byte(0);
  if (first < 0x80) return {1, first};
  const std::size_t size = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < size) return {};
  std::uint32_t code = first & (0x7FU >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return {};
    code = (code << 6) | (byte(i) & 0x3FU);
  }
  const bool overlong = (size == 3 && code < 0x800) || (size == 4 && code < 0x10000);
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  return overlong || surrogate || code > 0x10FFFF ? Character{} : Character{size, code};
}

bool IsPrintable(std::uint32_t code) {
  const auto within = [code](std::uint32_t first, std::uint32_t last) {
    return code >= first && code <= last;
  };
  return !(code < 0x20 || within(0x7F, 0x9F) ||                                   // C0, DEL, C1
           within(0x2028, 0x2029) ||                                              // line breaks
           code == 0x061C || within(0x200E, 0x200F) || within(0x202A, 0x202E) ||  // direction of writing
           within(0x2066, 0x2069));
}

std::string Plain(std::string_view text, bool in_lines) {
  std::string plain;
  plain.reserve(text.size());
  while (!text.empty()) {
    const Character character = First(text);
    const std::size_t size = character.size == 0 ? 1 : character.size;
    if ((character.size > 0 && IsPrintable(character.code)) ||
        (in_lines && (text[0] == '\n' || text[0] == '\t'))) {
      plain += text.substr(0, size);
    } else {
      for (const char c : text.substr(0, size))
        plain += fmt::format("\\x{:02x}", static_cast<std::uint8_t>(c));
    }
    text.remove_prefix(size);
  }
  return plain;
}

}  // namespace

std::string Plain(std::string_view text) { return Plain(text, false); }

std::string internal::Printable(const TextLines& lines) { return Plain(lines.text, true); }

void internal::Write(std::FILE* to, const std::string& text) {
  if (to == stderr) {
    std::fputs(text.c_str(), to);
  } else {
    fmt::print(to, "{}", text);
  }
}

}  // namespace tiltproof::harness
