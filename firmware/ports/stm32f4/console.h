// Text lines for a person on the console, each beginning with the time since power-on:
//
//   ConsoleLine("restarted after ").Text("hard fault").Text(" at pc=0x").Hex(pc).Send();
//
//       0.001004 restarted after hard fault at pc=0x080004d2
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace tiltproof::stm32f4 {

class ConsoleLine {
 public:
  explicit ConsoleLine(std::string_view text);  // with the time
  ConsoleLine() = default;                      // without

  ConsoleLine& Text(std::string_view text);  // text that does not fit is cut off
  ConsoleLine& Number(std::uint64_t number, unsigned width = 1, char fill = ' ');
  ConsoleLine& Hex(std::uint32_t number);  // 8 digits

  // May drop the text line: a console that cannot keep up must not delay the flight.
  void Send();

 private:
  void Put(char character);

  std::array<char, 120> characters_;
  std::size_t size_ = 0;
};

}  // namespace tiltproof::stm32f4
