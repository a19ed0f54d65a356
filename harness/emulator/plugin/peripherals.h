// Peripherals that the emulated STM32F405 lacks, mapped over its address space.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/qemu_internals.h"

namespace tiltproof::qemu {

// A timer of the virtual clock. Lives as long as the emulator.
class Timer {
 public:
  void Init(void (*callback)(void*), void* opaque) {
    timer_init_full(memory_.data(), nullptr, kClockVirtual, kScaleNs, 0, callback, opaque);
  }
  // Replaces the time set before. In the past: as soon as possible.
  void Set(std::int64_t at_ns) { timer_mod(memory_.data(), at_ns); }
  void Cancel() { timer_del(memory_.data()); }

 private:
  alignas(16) std::array<std::uint8_t, kTimerBytes> memory_{};
};

// Registers at an address, in front of what is there.
class Overlay {
 public:
  using Read = std::uint64_t (*)(void* opaque, std::uint64_t offset, unsigned size);
  using Write = void (*)(void* opaque, std::uint64_t offset, std::uint64_t value, unsigned size);
  void Init(const char* name, std::uint64_t address, std::uint64_t size, Read read, Write write,
            void* opaque) {
    ops_ = {.read = read, .write = write, .valid = {}, .impl = {}};
    memory_region_init_io(region_.data(), nullptr, &ops_, opaque, name, size);
    memory_region_add_subregion_overlap(get_system_memory(), address, region_.data(), 1);
  }

 private:
  MemoryRegionOps ops_{};
  alignas(16) std::array<std::uint8_t, kMemoryRegionBytes> region_{};
};

// The independent watchdog, IWDG (RM0090, section 21): once started it resets the processor unless it is fed in
// time. Its own clock, the LSI, has 32 kHz here (17 to 47 kHz on a chip: datasheet DS8626, table 35).
class Watchdog {
 public:
  void Init(void (*bite)()) {
    bite_ = bite;
    timer_.Init([](void* self) { static_cast<Watchdog*>(self)->bite_(); }, this);
    overlay_.Init("iwdg", 0x40003000, 0x10, ReadRegister, WriteRegister, this);
  }
  // Off until the firmware starts it again.
  void Reset() {
    timer_.Cancel();
    started_ = unlocked_ = false;
    prescaler_ = 0;
    reload_ = kReloadMax;
  }

 private:
  static constexpr std::uint32_t kReloadMax = 0xFFF;
  static constexpr std::int64_t kLsiHz = 32'000;
  enum : std::uint64_t { kKey = 0x0, kPrescaler = 0x4, kReload = 0x8 };  // SR, 0xC, reads as 0: never busy

  void Feed() {
    // The counter runs at LSI / (4 << prescaler); 6 and 7 both divide by 256.
    const std::int64_t divider = std::int64_t{4} << (prescaler_ < 6 ? prescaler_ : 6);
    timer_.Set(qemu_clock_get_ns(kClockVirtual) + divider * (reload_ + 1) * 1'000'000'000 / kLsiHz);
  }
  static std::uint64_t ReadRegister(void* opaque, std::uint64_t offset, unsigned /*size*/) {
    const auto& self = *static_cast<Watchdog*>(opaque);
    return offset == kPrescaler ? self.prescaler_ : offset == kReload ? self.reload_ : 0;
  }
  static void WriteRegister(void* opaque, std::uint64_t offset, std::uint64_t value, unsigned /*size*/) {
    auto& self = *static_cast<Watchdog*>(opaque);
    if (offset == kKey) {
      self.unlocked_ = value == 0x5555;
      if (value == 0xCCCC) self.started_ = true;
      if (value == 0xCCCC || (value == 0xAAAA && self.started_)) self.Feed();
    } else if (self.unlocked_ && offset == kPrescaler) {
      self.prescaler_ = value & 7;
    } else if (self.unlocked_ && offset == kReload) {
      self.reload_ = value & kReloadMax;
    }
  }

  void (*bite_)() = nullptr;
  Timer timer_;
  Overlay overlay_;
  bool started_ = false, unlocked_ = false;
  std::uint32_t prescaler_ = 0, reload_ = kReloadMax;
};

// RCC_CSR (RM0090, section 7.3.21): why the processor was reset.
class ResetFlags {
 public:
  void Init() { overlay_.Init("rcc-csr", 0x40023874, 4, ReadRegister, WriteRegister, this); }
  void Add(harness::lockstep::ResetCause cause) {
    using harness::lockstep::ResetCause;
    flags_ |= kPin;  // every reset pulls the pin
    if (cause == ResetCause::kSoftware) flags_ |= 1u << 28;
    if (cause == ResetCause::kWatchdog) flags_ |= 1u << 29;
  }

 private:
  static constexpr std::uint32_t kPin = 1u << 26, kPower = 1u << 27, kBrownOut = 1u << 25, kRemove = 1u << 24;

  static std::uint64_t ReadRegister(void* opaque, std::uint64_t /*offset*/, unsigned /*size*/) {
    return static_cast<ResetFlags*>(opaque)->flags_;
  }
  static void WriteRegister(void* opaque, std::uint64_t /*offset*/, std::uint64_t value, unsigned /*size*/) {
    if ((value & kRemove) != 0) static_cast<ResetFlags*>(opaque)->flags_ = 0;
  }

  Overlay overlay_;
  std::uint32_t flags_ = kPin | kPower | kBrownOut;
};

// The receiving half of a USART, its SR and DR (RM0090, section 30.6), in front of the emulated one. There
// are two reasons: the emulated one never raises an error flag, and each read of its registers wakes QEMU's
// main thread, which costs more than everything else in a flight. The other registers are passed on, and
// known here.
class UsartReceiver {
 public:
  static constexpr std::uint32_t kFraming = 1u << 1, kNoise = 1u << 2, kOverrun = 1u << 3;

  // `number`: 1 to 6, of USART1 ... UART4, UART5, USART6. False when the machine has none.
  bool Init(int number, void* chardev) {
    constexpr std::array<std::uint64_t, 6> kAddresses = {0x40011000, 0x40004400, 0x40004800,
                                                         0x40004C00, 0x40005000, 0x40011400};
    if (number < 1 || number > static_cast<int>(kAddresses.size())) return false;
    // At any place in the tree of devices.
    const std::string path = "usart[" + std::to_string(number - 1) + "]";
    void* device = object_resolve_path(path.c_str(), nullptr);
    if (device == nullptr) return false;
    usart_ = sysbus_mmio_get_region(device, 0);
    chardev_ = chardev;
    overlay_.Init("usart-receiver", kAddresses[static_cast<std::size_t>(number - 1)], 4 * kRegisterCount,
                  ReadRegister, WriteRegister, this);
    return true;
  }

  // Whether the last byte has been read.
  bool Free() const { return qemu_chr_be_can_write(chardev_) > 0; }
  // A byte has arrived, with these flags. Only while Free(); lost when the firmware has not enabled its receiver.
  void Deliver(std::uint8_t byte, std::uint32_t flags) {
    qemu_chr_be_write(chardev_, &byte, 1);
    if (Free()) return;
    data_ = byte;
    flags_ |= flags;
  }
  // A byte has arrived and is lost: the old one stays (section 30.3.3).
  void Overrun() { flags_ |= kOverrun; }
  harness::lockstep::UsartRegisters Registers(harness::lockstep::Usart usart) const {
    return {usart, registers_[kBaudRate / 4], registers_[kControl1 / 4], registers_[kControl3 / 4]};
  }
  void Reset() {
    flags_ = seen_flags_ = 0;
    complete_ = kComplete;
    registers_ = {};
  }

 private:
  static constexpr std::uint64_t kStatus = 0, kData = 4, kBaudRate = 8, kControl1 = 0xC, kControl3 = 0x14;
  static constexpr std::size_t kRegisterCount = 7;
  static constexpr std::uint32_t kNotEmpty = 1u << 5, kComplete = 1u << 6, kTransmitterEmpty = 1u << 7;

  std::uint32_t Status() const { return kTransmitterEmpty | complete_ | flags_ | (Free() ? 0 : kNotEmpty); }
  void Write(std::uint64_t offset, std::uint64_t value) {
    memory_region_dispatch_write(usart_, offset, value, kMemOp32LittleEndian, 0);
  }
  static std::uint64_t ReadRegister(void* opaque, std::uint64_t offset, unsigned /*size*/) {
    auto& self = *static_cast<UsartReceiver*>(opaque);
    if (offset == kStatus) {
      self.seen_flags_ = self.flags_;
      return self.Status();
    }
    if (offset != kData) return self.registers_[offset / 4];
    // The flags are cleared when SR and then DR have been read.
    self.flags_ &= ~self.seen_flags_;
    self.seen_flags_ = 0;
    // For the emulated receiver the byte has now been read, so it withdraws its interrupt.
    self.Write(kStatus, self.Status() & ~kNotEmpty);
    return self.data_;
  }
  static void WriteRegister(void* opaque, std::uint64_t offset, std::uint64_t value, unsigned /*size*/) {
    auto& self = *static_cast<UsartReceiver*>(opaque);
    // Sent at once; and SR's bits can only be cleared.
    if (offset == kData) self.complete_ = kComplete;
    if (offset > kData) self.registers_[offset / 4] = static_cast<std::uint32_t>(value);
    if (offset == kStatus) {
      self.complete_ &= static_cast<std::uint32_t>(value);
      value &= self.Status();
    }
    self.Write(offset, value);
  }

  void* usart_ = nullptr;
  void* chardev_ = nullptr;
  Overlay overlay_;
  std::uint32_t data_ = 0;
  std::array<std::uint32_t, kRegisterCount> registers_{};  // of SR and DR nothing
  std::uint32_t flags_ = 0, seen_flags_ = 0;               // errors
  std::uint32_t complete_ = kComplete;                     // TC
};

}  // namespace tiltproof::qemu
