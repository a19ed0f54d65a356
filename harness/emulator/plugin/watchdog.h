// The independent watchdog, IWDG (RM0090, section 21): once started it resets the processor unless it is fed in
// time. Its own clock, the LSI, has 32 kHz here (17 to 47 kHz on a chip: datasheet DS8626, table 35).
#pragma once

#include <cstdint>

#include "harness/emulator/plugin/parts.h"

namespace tiltproof::qemu {

class Watchdog final : public RegisterBlock {
 public:
  void Init(void (*bite)()) {
    bite_ = bite;
    timer_.Init([](void* self) { static_cast<Watchdog*>(self)->bite_(); }, this);
    Map("iwdg", 0x40003000);
    Reset();
  }
  // Off until the firmware starts it again.
  void Reset() {
    timer_.Cancel();
    started_ = unlocked_ = false;
    Word(kPrescaler) = 0;
    Word(kReload) = kReloadMax;
  }

 private:
  static constexpr std::uint32_t kReloadMax = 0xFFF;
  static constexpr std::int64_t kLsiHz = 32'000;
  static constexpr std::uint32_t kKey = 0x0, kPrescaler = 0x4,
                                 kReload = 0x8;  // SR, 0xC, reads as 0: never busy

  void Feed() {
    // The counter runs at LSI / (4 << prescaler); 6 and 7 both divide by 256.
    const std::int64_t divider = std::int64_t{4} << (Word(kPrescaler) < 6 ? Word(kPrescaler) : 6);
    timer_.Set(Now() + divider * (Word(kReload) + 1) * kNsPerSecond / kLsiHz);
  }
  void Write(std::uint32_t offset, std::uint32_t value) override {
    if (offset == kKey) {
      unlocked_ = value == 0x5555;
      if (value == 0xCCCC) started_ = true;
      if (value == 0xCCCC || (value == 0xAAAA && started_)) Feed();
    } else if (unlocked_ && offset == kPrescaler) {
      Word(kPrescaler) = value & 7;
    } else if (unlocked_ && offset == kReload) {
      Word(kReload) = value & kReloadMax;
    }
  }

  void (*bite_)() = nullptr;
  Timer timer_;
  bool started_ = false, unlocked_ = false;
};

}  // namespace tiltproof::qemu
