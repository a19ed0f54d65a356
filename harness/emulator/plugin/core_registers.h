// Parts of the Cortex-M4 and the system memory of an STM32F405 that QEMU's machine lacks.
#pragma once

#include <cstdint>

#include "harness/emulator/plugin/parts.h"

namespace tiltproof::qemu {

// The cycle counter, DWT_CYCCNT (ARMv7-M Architecture Reference Manual, section C1.8), from virtual time: at the core
// clock's rate, whatever the number of instructions. Counts while DEMCR.TRCENA and its own enable bit are set.
class CycleCounter final : public RegisterBlock {
 public:
  void Init() {
    Map("dwt", 0xE0001000, CoreSpace());
    Reset();
  }
  void Reset() {
    ClearWords();
    Word(kControl) = 0x40000000;  // four comparators, which do nothing
    traced_ = false;
    begin_ns_ = Now();
  }
  void Trace(bool on) {
    Sync();
    traced_ = on;
  }
  // The core's clock has this rate from now on.
  void Follow(std::uint32_t hz) {
    Sync();
    hz_ = hz;
  }

 private:
  static constexpr std::uint32_t kControl = 0x0, kCycles = 0x4, kEnable = 1;

  void Sync() {
    const std::int64_t now = Now();
    if (traced_ && (Word(kControl) & kEnable) != 0)
      Word(kCycles) +=
          static_cast<std::uint32_t>(MulDiv(now, hz_, kNsPerSecond) - MulDiv(begin_ns_, hz_, kNsPerSecond));
    begin_ns_ = now;
  }
  std::uint32_t Read(std::uint32_t offset) override {
    Sync();
    return traced_ ? Word(offset) : 0;
  }
  void Write(std::uint32_t offset, std::uint32_t value) override {
    Sync();
    if (traced_) Word(offset) = value;
  }

  bool traced_ = false;
  std::uint32_t hz_ = 0;
  std::int64_t begin_ns_ = 0;  // of the cycles that are not counted yet
};

// A page of the system control space, passed on to QEMU's interrupt controller and SysTick, with priorities of 4 bits
// (PM0214, section 4.3.7): QEMU's has 8, and FreeRTOS's check of configPRIO_BITS finds that. Firmware reads its clock
// here often, so what reads is noted, and the page is whole (RegisterBlock).
class SystemControl {
 public:
  // `address`: 0xE000E000, 0xE000E400 or 0xE000EC00.
  void Init(std::uint64_t address, CycleCounter* counter = nullptr) {
    page_ = address & 0xFFF;
    counter_ = counter;
    controller_ = sysbus_mmio_get_region(object_resolve_path("nvic", nullptr), 0);
    timer_ = sysbus_mmio_get_region(object_resolve_path("systick-reg-ns", nullptr), 0);
    ops_ = {.read = nullptr,
            .write = nullptr,
            .read_with_attrs = Read,
            .write_with_attrs = Write,
            .valid = {},
            .impl = {}};
    memory_region_init_io(region_.data(), nullptr, &ops_, this, "system-control", RegisterBlock::kBytes);
    memory_region_add_subregion_overlap(CoreSpace(), address, region_.data(), 1);
  }
  void Reset() { debug_ = 0; }

 private:
  static constexpr std::uint64_t kDebug = 0xDFC;  // DEMCR
  static constexpr std::uint32_t kTrace = 1u << 24;

  // IPR (PM0214, section 4.3.7) and SHPR (4.4.8).
  static bool IsPriority(std::uint64_t offset) {
    return (offset >= 0x400 && offset < 0x600) || (offset >= 0xD18 && offset < 0xD24);
  }
  static int MemOp(unsigned size) { return size == 1 ? 0 : size == 2 ? 1 : 2; }

  struct Place {
    void* region;
    std::uint64_t offset;
  };
  // SysTick has the first registers but one (PM0214, section 4.5).
  Place At(std::uint64_t offset) const {
    constexpr std::uint64_t kTimer = 0x10, kTimerEnd = 0xF0;
    if (offset >= kTimer && offset < kTimerEnd) return {timer_, offset - kTimer};
    return {controller_, offset};
  }

  static std::uint32_t Read(void* opaque, std::uint64_t address, std::uint64_t* value, unsigned size,
                            std::uint32_t attributes) {
    readers.OnRead();
    const auto& self = *static_cast<SystemControl*>(opaque);
    const std::uint64_t offset = self.page_ + address;
    if (offset == kDebug) {
      *value = self.debug_;
      return 0;
    }
    const auto [region, place] = self.At(offset);
    return static_cast<std::uint32_t>(
        memory_region_dispatch_read(region, place, value, MemOp(size), attributes));
  }
  static std::uint32_t Write(void* opaque, std::uint64_t address, std::uint64_t value, unsigned size,
                             std::uint32_t attributes) {
    readers.OnWrite();
    auto& self = *static_cast<SystemControl*>(opaque);
    const std::uint64_t offset = self.page_ + address;
    if (offset == kDebug && self.counter_ != nullptr) {
      self.debug_ = static_cast<std::uint32_t>(value);
      self.counter_->Trace((self.debug_ & kTrace) != 0);
      return 0;
    }
    if (IsPriority(offset)) value &= 0xF0F0F0F0u;
    const auto [region, place] = self.At(offset);
    return static_cast<std::uint32_t>(
        memory_region_dispatch_write(region, place, value, MemOp(size), attributes));
  }

  std::uint64_t page_ = 0;
  CycleCounter* counter_ = nullptr;
  void *controller_ = nullptr, *timer_ = nullptr;
  std::uint32_t debug_ = 0;
  MemoryRegionOps ops_{};
  alignas(16) std::array<std::uint8_t, kMemoryRegionBytes> region_{};
};

// DBGMCU (RM0090, section 38.16): which chip it is. What it would stop at a breakpoint reads back.
class DebugUnit final : public RegisterBlock {
 public:
  void Init() {
    Map("dbgmcu", 0xE0042000, CoreSpace());
    Word(kIdentity) = 0x10076413;  // STM32F405xx/407xx, revision Z
  }

 private:
  static constexpr std::uint32_t kIdentity = 0;
  void Write(std::uint32_t offset, std::uint32_t value) override {
    if (offset != kIdentity) Word(offset) = value;
  }
};

// The device's electronic signature (section 39): unique number and size of the flash. What is near it, one-time
// programmable memory, is empty.
class Signature final : public RegisterBlock {
 public:
  void Init() {
    for (std::uint32_t offset = 0; offset < kBytes; offset += 4) Word(offset) = 0xFFFFFFFF;
    Word(0x210) = 0x00300021;  // where on which wafer
    Word(0x214) = 0x31385111;
    Word(0x218) = 0x34353432;
    Word(0x220) = 1024u << 16 | 0xFFFF;  // KB
    Map("signature", 0x1FFF7800);
  }

 private:
  void Write(std::uint32_t /*offset*/, std::uint32_t /*value*/) override {}
};

// The core-coupled RAM (section 2.3.1), which only the core reaches.
class CoupledRam {
 public:
  static constexpr std::uint32_t kAddress = 0x10000000, kBytes = 64 * 1024;
  void Init() {
    memory_region_init_ram_nomigrate(region_.data(), nullptr, "ccm", kBytes, nullptr);
    memory_region_add_subregion_overlap(get_system_memory(), kAddress, region_.data(), 1);
  }

 private:
  alignas(16) std::array<std::uint8_t, kMemoryRegionBytes> region_{};
};

}  // namespace tiltproof::qemu
