// A port of general-purpose pins (RM0090, section 8.4): nothing is connected to them, so that an input reads what an
// output drives, or the pull-up.
#pragma once

#include <cstdint>

#include "harness/emulator/plugin/parts.h"

namespace tiltproof::qemu {

class Gpio final : public RegisterBlock {
 public:
  static constexpr int kCount = 9;  // GPIOA to GPIOI

  // `port`: 0 is GPIOA.
  void Init(int port) {
    port_ = port;
    Map("gpio", 0x40020000 + std::uint64_t{kBytes} * static_cast<std::uint64_t>(port));
    Reset();
  }
  // The debugger's pins are set up (section 8.4.1 to 8.4.4).
  void Reset() {
    ClearWords();
    if (port_ == 0) {
      Word(kMode) = 0xA8000000;
      Word(kPull) = 0x64000000;
    } else if (port_ == 1) {
      Word(kMode) = 0x00000280;
      Word(kSpeed) = 0x000000C0;
      Word(kPull) = 0x00000100;
    }
  }

 private:
  static constexpr std::uint32_t kMode = 0x00, kSpeed = 0x08, kPull = 0x0C, kInput = 0x10, kOutput = 0x14,
                                 kSetReset = 0x18;

  std::uint32_t Read(std::uint32_t offset) override {
    if (offset == kInput) return Levels();
    return offset == kSetReset ? 0 : Word(offset);
  }
  void Write(std::uint32_t offset, std::uint32_t value) override {
    if (offset == kSetReset) {  // setting wins
      Word(kOutput) = (Word(kOutput) & ~(value >> 16)) | (value & 0xFFFF);
    } else if (offset == kOutput) {
      Word(kOutput) = value & 0xFFFF;
    } else if (offset != kInput) {
      Word(offset) = value;
    }
  }

  std::uint32_t Levels() const {
    constexpr std::uint32_t kOut = 1, kAnalog = 3, kUp = 1;
    std::uint32_t levels = 0;
    for (unsigned pin = 0; pin < 16; ++pin) {
      const std::uint32_t mode = Word(kMode) >> 2 * pin & 3;
      const bool high = mode == kOut      ? (Word(kOutput) >> pin & 1) != 0
                        : mode == kAnalog ? false
                                          : (Word(kPull) >> 2 * pin & 3) == kUp;
      levels |= static_cast<std::uint32_t>(high) << pin;
    }
    return levels;
  }

  int port_ = 0;
};

}  // namespace tiltproof::qemu
