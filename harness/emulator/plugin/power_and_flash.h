// The power controller and the flash interface, as far as a start-up uses them.
#pragma once

#include <cstdint>
#include <functional>
#include <utility>

#include "harness/emulator/plugin/parts.h"

namespace tiltproof::qemu {

// PWR (RM0090, section 5.4): the regulator is ready at once.
class Pwr final : public RegisterBlock {
 public:
  // `changed`: the scale may have.
  void Init(std::function<void()> changed) {
    changed_ = std::move(changed);
    Map("pwr", 0x40007000);
    Reset();
  }
  void Reset() {
    ClearWords();
    Word(kControl) = kScale1;
  }
  // The regulator's scale: scale 2 is for lower clocks (section 5.1.3).
  bool is_scale_1() const { return (Word(kControl) & kScale1) != 0; }

 private:
  static constexpr std::uint32_t kControl = 0, kStatus = 4;
  static constexpr std::uint32_t kScale1 = 1u << 14;  // VOS
  static constexpr std::uint32_t kBackupRegulator = 1u << 9, kBackupRegulatorReady = 1u << 3,
                                 kScaleReady = 1u << 14;
  static constexpr std::uint32_t kOverDrive = 3u
                                              << 16;  // enabled and switched; in CSR: ready. STM32F42x, F43x

  std::uint32_t Read(std::uint32_t offset) override {
    if (offset != kStatus) return Word(offset);
    const std::uint32_t status = Word(kStatus);
    return status | kScaleReady | (Word(kControl) & kOverDrive) |
           ((status & kBackupRegulator) != 0 ? kBackupRegulatorReady : 0);
  }
  void Write(std::uint32_t offset, std::uint32_t value) override {
    Word(offset) = offset == kStatus ? value & (kBackupRegulator | 1u << 8) : value;
    if (offset == kControl) changed_();
  }

  std::function<void()> changed_;
};

// The flash interface (section 3.9): the wait states read back, and the keys unlock. The flash itself cannot be erased:
// the attempt ends with the error of a protected sector.
class FlashInterface final : public RegisterBlock {
 public:
  // `changed`: the wait states may have.
  void Init(std::function<void()> changed) {
    changed_ = std::move(changed);
    Map("flash-interface", 0x40023C00);
    Reset();
  }
  std::uint32_t wait_states() const { return Word(kAccess) & 7; }
  void Reset() {
    ClearWords();
    Word(kControl) = kLock;
    Word(kOptions) = 0x0FFFAAED;
    first_key_ = first_option_key_ = shut_ = false;
  }

 private:
  static constexpr std::uint32_t kAccess = 0x00, kKey = 0x04, kOptionKey = 0x08, kStatus = 0x0C,
                                 kControl = 0x10, kOptions = 0x14;
  static constexpr std::uint32_t kLock = 1u << 31, kStart = 1u << 16, kProtectionError = 1u << 4,
                                 kOptionLock = 1;

  std::uint32_t Read(std::uint32_t offset) override {
    return offset == kKey || offset == kOptionKey ? 0 : Word(offset);
  }
  void Write(std::uint32_t offset, std::uint32_t value) override {
    switch (offset) {
      case kAccess:
        Word(kAccess) = value & 0x1F07;
        changed_();
        break;
      case kKey:  // after a wrong key: locked until the next reset (section 3.6.1)
        if (first_key_ && value == 0xCDEF89AB && !shut_) {
          Word(kControl) &= ~kLock;
        } else if (value != 0x45670123) {
          shut_ = true;
        }
        first_key_ = value == 0x45670123;
        break;
      case kOptionKey:
        if (first_option_key_ && value == 0x4C5D6E7F) Word(kOptions) &= ~kOptionLock;
        first_option_key_ = value == 0x08192A3B;
        break;
      case kStatus:
        Word(kStatus) &= ~value;
        break;
      case kControl:
        if ((Word(kControl) & kLock) != 0) break;
        if ((value & kStart) != 0) Word(kStatus) |= kProtectionError;
        Word(kControl) = value & ~kStart;
        break;
      case kOptions:
        if ((Word(kOptions) & kOptionLock) == 0) Word(kOptions) = value;
        break;
      default:
        break;
    }
  }

  std::function<void()> changed_;
  bool first_key_ = false, first_option_key_ = false, shut_ = false;
};

}  // namespace tiltproof::qemu
