// Common parts of every block of the emulated chip: a timer of the virtual clock, an interrupt, and registers
// mapped over the machine's address space.
//
//   struct Unlocked : RegisterBlock {
//     void Init() { Map("unlocked", 0x40007000); }
//     std::uint32_t Read(std::uint32_t offset) override { return Word(offset) | 1; }
//   };
#pragma once

#include <array>
#include <cstdint>

#include "harness/emulator/plugin/qemu_internals.h"
#include "harness/emulator/plugin/readers.h"

namespace tiltproof::qemu {

inline std::int64_t Now() { return qemu_clock_get_ns(kClockVirtual); }

inline constexpr std::int64_t kNsPerSecond = 1'000'000'000;

// a * b / c without overflow for a >= 0, and b * c up to 2^63.
constexpr std::int64_t MulDiv(std::int64_t a, std::int64_t b, std::int64_t c) {
  return a / c * b + a % c * b / c;
}

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

// An input of the interrupt controller (RM0090, table 62), which one or more blocks raise.
class Interrupt {
 public:
  void Init(int number) { input_ = qdev_get_gpio_in(object_resolve_path("armv7m", nullptr), number); }
  // `source`: 0 to 31, of the blocks that share it.
  void Set(bool level, unsigned source = 0) {
    const std::uint32_t before = sources_;
    sources_ = (sources_ & ~(1u << source)) | static_cast<std::uint32_t>(level) << source;
    if ((before != 0) != (sources_ != 0)) qemu_set_irq(input_, sources_ != 0 ? 1 : 0);
  }

 private:
  void* input_ = nullptr;
  std::uint32_t sources_ = 0;
};

// One page of registers, in front of what the machine has there; words that keep what was written, unless a subclass says
// otherwise. Not a part of a page: QEMU is slow with those.
class RegisterBlock {
 public:
  static constexpr std::uint32_t kBytes = 0x400;

  // Without a clock its registers read 0 and keep nothing (RM0090, section 7.3.10). What it had been doing goes on.
  void SetClock(bool on) { clock_ = on; }
  bool has_clock() const { return clock_; }

  RegisterBlock() = default;
  RegisterBlock(const RegisterBlock&) = delete;
  RegisterBlock& operator=(const RegisterBlock&) = delete;

 protected:
  ~RegisterBlock() = default;

  // In the system's memory, or in another region.
  void Map(const char* name, std::uint64_t address, void* container = nullptr) {
    ops_ = {.read = ReadPart, .write = WritePart, .valid = {}, .impl = {}};
    memory_region_init_io(region_.data(), nullptr, &ops_, this, name, kBytes);
    memory_region_add_subregion_overlap(container != nullptr ? container : get_system_memory(), address,
                                        region_.data(), 1);
  }

  // Access to whole words; `offset` is a multiple of 4.
  virtual std::uint32_t Read(std::uint32_t offset) { return Word(offset); }
  virtual void Write(std::uint32_t offset, std::uint32_t value) { Word(offset) = value; }

  std::uint32_t& Word(std::uint32_t offset) { return words_[offset / 4]; }
  const std::uint32_t& Word(std::uint32_t offset) const { return words_[offset / 4]; }
  void ClearWords() { words_ = {}; }

 private:
  static constexpr std::uint32_t Mask(unsigned size) { return size >= 4 ? ~0u : (1u << 8 * size) - 1; }

  static std::uint64_t ReadPart(void* self, std::uint64_t address, unsigned size) {
    readers.OnRead();
    auto& block = *static_cast<RegisterBlock*>(self);
    if (!block.clock_) return 0;
    const auto offset = static_cast<std::uint32_t>(address);
    return block.Read(offset & ~3u) >> 8 * (offset & 3) & Mask(size);
  }
  // A part of a word leaves the rest of it as it is.
  static void WritePart(void* self, std::uint64_t address, std::uint64_t value, unsigned size) {
    readers.OnWrite();
    auto& block = *static_cast<RegisterBlock*>(self);
    if (!block.clock_) return;
    const auto offset = static_cast<std::uint32_t>(address);
    const unsigned shift = 8 * (offset & 3);
    const std::uint32_t mask = Mask(size) << shift;
    const std::uint32_t rest = size >= 4 ? 0 : block.Word(offset & ~3u) & ~mask;
    block.Write(offset & ~3u, rest | (static_cast<std::uint32_t>(value) << shift & mask));
  }

  MemoryRegionOps ops_{};
  alignas(16) std::array<std::uint8_t, kMemoryRegionBytes> region_{};
  std::array<std::uint32_t, kBytes / 4> words_{};
  bool clock_ = true;
};

// Where the core's own registers are: 0xE0000000 and up is no part of the system's memory, but lies in front of it.
inline void* CoreSpace() {
  static void* const container = object_resolve_path("armv7m-container[0]", nullptr);
  return container;
}

}  // namespace tiltproof::qemu
