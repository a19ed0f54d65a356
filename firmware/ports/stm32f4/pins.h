// Pins of the chip (RM0090, section 8.4). Internal to this folder.
//
//   SetPin(GpioA(), 2, PinMode::kAlternate, 7, Pull::kUp);   // USART2 TX
#pragma once

#include <cstdint>

#include "firmware/ports/stm32f4/stm32f4.h"

namespace tiltproof::stm32f4 {

enum class PinMode : std::uint32_t { kOutput = 1, kAlternate = 2 };
enum class Pull : std::uint32_t { kNone = 0, kUp = 1 };

inline void SetPin(GpioRegisters& port, unsigned pin, PinMode mode, unsigned function, Pull pull) {
  Modify(port.AFR[pin / 8], 0xFU << 4 * (pin % 8), function << 4 * (pin % 8));
  Modify(port.OSPEEDR, 3U << 2 * pin, 1U << 2 * pin);  // medium: edges fast enough for 1 Mbaud
  Modify(port.PUPDR, 3U << 2 * pin, static_cast<std::uint32_t>(pull) << 2 * pin);
  Modify(port.MODER, 3U << 2 * pin, static_cast<std::uint32_t>(mode) << 2 * pin);
}

}  // namespace tiltproof::stm32f4
