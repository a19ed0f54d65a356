#include "firmware/ports/stm32f4/console.h"

#include <span>

#include "firmware/ports/stm32f4/board.h"
#include "firmware/ports/stm32f4/usart.h"

namespace tiltproof::stm32f4 {

ConsoleLine::ConsoleLine(std::string_view text) {
  const auto now_us = static_cast<std::uint64_t>(Now() / kNsPerUs);
  Number(now_us / 1'000'000, 5).Text(".").Number(now_us % 1'000'000, 6, '0').Text(" ").Text(text);
}

void ConsoleLine::Put(char character) {
  if (size_ < characters_.size() - 2) characters_[size_++] = character;  // room for the line end
}

ConsoleLine& ConsoleLine::Text(std::string_view text) {
  for (const char character : text) Put(character);
  return *this;
}

ConsoleLine& ConsoleLine::Number(std::uint64_t number, unsigned width, char fill) {
  std::array<char, 20> digits;  // of 2^64 - 1
  unsigned count = 0;
  do {
    digits[count++] = static_cast<char>('0' + number % 10);
    number /= 10;
  } while (number != 0);
  for (unsigned i = count; i < width; ++i) Put(fill);
  while (count != 0) Put(digits[--count]);
  return *this;
}

ConsoleLine& ConsoleLine::Hex(std::uint32_t number) {
  for (int shift = 28; shift >= 0; shift -= 4) Put("0123456789abcdef"[number >> shift & 0xF]);
  return *this;
}

void ConsoleLine::Send() {
  characters_[size_++] = '\r';
  characters_[size_++] = '\n';
  SendConsole({reinterpret_cast<const std::uint8_t*>(characters_.data()), size_});
  size_ = 0;
}

}  // namespace tiltproof::stm32f4
