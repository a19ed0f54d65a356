// The DMA controllers (RM0090, section 10), for bytes to and from USARTs: direct mode, one or two buffers, circular or not.
// A transfer itself takes no time; its pace is that of the USART.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <utility>

#include "harness/emulator/plugin/core_registers.h"
#include "harness/emulator/plugin/parts.h"

namespace tiltproof::qemu {

class DmaController final : public RegisterBlock {
 public:
  // `number`: 1 or 2. `enabled`: a stream has been enabled, to whom a USART may already have something to say.
  void Init(int number, std::function<void()> enabled) {
    constexpr std::array<int, 8> kInterrupts1 = {11, 12, 13, 14, 15, 16, 17, 47};
    constexpr std::array<int, 8> kInterrupts2 = {56, 57, 58, 59, 60, 68, 69, 70};
    number_ = number;
    enabled_ = std::move(enabled);
    for (std::size_t i = 0; i < streams_.size(); ++i)
      interrupts_[i].Init((number == 1 ? kInterrupts1 : kInterrupts2)[i]);
    Map("dma", number == 1 ? 0x40026000 : 0x40026400);
  }
  void Reset() {
    for (std::size_t i = 0; i < streams_.size(); ++i) {
      streams_[i] = {};
      Update(i);
    }
  }

  // A USART's receiver has this byte. False when no stream takes it.
  bool Store(int usart, std::uint32_t data_register, std::uint8_t byte) {
    return Move(usart, kToMemory, data_register, byte);
  }
  // A USART's transmitter wants a byte. False when no stream has one.
  bool Load(int usart, std::uint32_t data_register, std::uint8_t& byte) {
    return Move(usart, kFromMemory, data_register, byte);
  }

 private:
  enum Direction : std::uint32_t { kToMemory, kFromMemory };
  struct Stream {
    std::uint32_t control = 0, count = 0, peripheral = 0, memory0 = 0, memory1 = 0, fifo = 0x21;
    std::uint32_t reload = 0;  // the count when it was enabled
    std::uint32_t flags = 0;   // as in LISR for stream 0
  };
  // SxCR (section 10.5.5).
  static constexpr std::uint32_t kEnable = 1u << 0, kErrorInterrupt = 1u << 2, kHalfInterrupt = 1u << 3,
                                 kCompleteInterrupt = 1u << 4, kCircular = 1u << 8,
                                 kMemoryIncrement = 1u << 10, kDoubleBuffer = 1u << 18,
                                 kSecondBuffer = 1u << 19;
  static constexpr std::uint32_t kErrorFlag = 1u << 3, kHalfFlag = 1u << 4, kCompleteFlag = 1u << 5;
  static constexpr std::uint32_t kFlags = 0x3D;
  static constexpr std::array<unsigned, 4> kFlagShifts = {0, 6, 16, 22};

  // True if this channel of a stream is a USART's request (tables 42 and 43).
  bool Requests(std::size_t stream, unsigned channel, int usart, Direction direction) const {
    struct Request {
      int controller;
      unsigned stream, channel;
      int usart;
      Direction direction;
    };
    constexpr Request kRequests[] = {
        {1, 0, 4, 5, kToMemory},   {1, 1, 4, 3, kToMemory},   {1, 2, 4, 4, kToMemory},
        {1, 3, 4, 3, kFromMemory}, {1, 4, 4, 4, kFromMemory}, {1, 4, 7, 3, kFromMemory},
        {1, 5, 4, 2, kToMemory},   {1, 6, 4, 2, kFromMemory}, {1, 7, 4, 5, kFromMemory},
        {2, 1, 5, 6, kToMemory},   {2, 2, 4, 1, kToMemory},   {2, 2, 5, 6, kToMemory},
        {2, 5, 4, 1, kToMemory},   {2, 6, 5, 6, kFromMemory}, {2, 7, 4, 1, kFromMemory},
        {2, 7, 5, 6, kFromMemory}};
    for (const Request& known : kRequests)
      if (known.controller == number_ && known.stream == stream && known.channel == channel &&
          known.usart == usart && known.direction == direction)
        return true;
    return false;
  }

  bool Move(int usart, Direction direction, std::uint32_t data_register, std::uint8_t& byte) {
    for (std::size_t i = 0; i < streams_.size(); ++i) {
      Stream& stream = streams_[i];
      if ((stream.control & kEnable) == 0 || (stream.control >> 6 & 3) != direction ||
          stream.peripheral != data_register || stream.count == 0 ||
          !Requests(i, stream.control >> 25 & 7, usart, direction))
        continue;
      const std::uint32_t unit = 1u << (stream.control >> 11 & 3);  // PSIZE, which is MSIZE in direct mode
      const std::uint32_t done = (stream.control & kMemoryIncrement) != 0 ? stream.reload - stream.count : 0;
      const bool second = (stream.control & kSecondBuffer) != 0;
      const std::uint32_t address = (second ? stream.memory1 : stream.memory0) + done * unit;
      if (address - CoupledRam::kAddress < CoupledRam::kBytes) {
        // No bus leads there from here (section 2.1): a transfer error ends the stream.
        stream.control &= ~kEnable;
        stream.flags |= kErrorFlag;
        Update(i);
        continue;
      }
      std::array<std::uint8_t, 8> item{byte};
      cpu_physical_memory_rw(address, item.data(), unit, direction == kToMemory);
      byte = item[0];
      Count(stream);
      Update(i);
      return true;
    }
    return false;
  }

  static void Count(Stream& stream) {
    if (--stream.count == stream.reload / 2) stream.flags |= kHalfFlag;
    if (stream.count != 0) return;
    stream.flags |= kCompleteFlag;
    if ((stream.control & kDoubleBuffer) != 0) stream.control ^= kSecondBuffer;
    if ((stream.control & (kCircular | kDoubleBuffer)) != 0) {
      stream.count = stream.reload;
    } else {
      stream.control &= ~kEnable;
    }
  }

  void Update(std::size_t i) {
    const Stream& stream = streams_[i];
    const std::uint32_t flags = stream.flags, control = stream.control;
    interrupts_[i].Set(((flags & kCompleteFlag) != 0 && (control & kCompleteInterrupt) != 0) ||
                       ((flags & kHalfFlag) != 0 && (control & kHalfInterrupt) != 0) ||
                       ((flags & kErrorFlag) != 0 && (control & kErrorInterrupt) != 0));
  }

  // Registers: LISR, HISR, LIFCR, HIFCR, then six for each stream (section 10.5.11).
  static constexpr std::uint32_t kClear = 0x08, kStreams = 0x10, kStreamBytes = 0x18;

  std::uint32_t Read(std::uint32_t offset) override {
    if (offset < kClear) {
      std::uint32_t value = 0;
      for (std::size_t i = 0; i < 4; ++i) value |= streams_[offset + i].flags << kFlagShifts[i];
      return value;
    }
    const std::uint32_t i = (offset - kStreams) / kStreamBytes;
    if (offset < kStreams || i >= streams_.size()) return 0;
    const Stream& stream = streams_[i];
    switch ((offset - kStreams) % kStreamBytes) {
      case 0x00:
        return stream.control;
      case 0x04:
        return stream.count;
      case 0x08:
        return stream.peripheral;
      case 0x0C:
        return stream.memory0;
      case 0x10:
        return stream.memory1;
      default:
        return stream.fifo;
    }
  }

  void Write(std::uint32_t offset, std::uint32_t value) override {
    if (offset < kClear) return;
    if (offset < kStreams) {
      for (std::size_t i = 0; i < 4; ++i) {
        const std::size_t stream = offset - kClear + i;
        streams_[stream].flags &= ~(value >> kFlagShifts[i] & kFlags);
        Update(stream);
      }
      return;
    }
    const std::uint32_t i = (offset - kStreams) / kStreamBytes;
    if (i >= streams_.size()) return;
    Stream& stream = streams_[i];
    const bool enabled = (stream.control & kEnable) != 0;
    switch ((offset - kStreams) % kStreamBytes) {
      case 0x00:
        WriteControl(i, value);
        break;
      case 0x04:  // an enabled stream keeps its count and its peripheral (sections 10.5.6 and 10.5.7)
        if (!enabled) stream.count = value & 0xFFFF;
        break;
      case 0x08:
        if (!enabled) stream.peripheral = value;
        break;
      case 0x0C:
        stream.memory0 = value;
        break;
      case 0x10:
        stream.memory1 = value;
        break;
      default:
        stream.fifo = (value & 0x87) | 0x20;  // always empty
    }
  }

  void WriteControl(std::size_t i, std::uint32_t value) {
    Stream& stream = streams_[i];
    const bool was_enabled = (stream.control & kEnable) != 0, enable = (value & kEnable) != 0;
    stream.control = value & 0x0FFFFFFF;
    if (enable && !was_enabled) stream.reload = stream.count;
    // Stopped by software, it says so with TCIF (section 10.3.14); drivers that abort a transfer wait for it.
    if (!enable && was_enabled) stream.flags |= kCompleteFlag;
    Update(i);
    if (enable && !was_enabled) enabled_();
  }

  int number_ = 0;
  std::function<void()> enabled_;
  std::array<Stream, 8> streams_{};
  std::array<Interrupt, 8> interrupts_;
};

// Both controllers: a request goes to the stream that waits for it.
class Dma {
 public:
  void Init(const std::function<void()>& enabled) {
    first_.Init(1, enabled);
    second_.Init(2, enabled);
  }
  // `number`: 1 or 2.
  DmaController& controller(int number) { return number == 1 ? first_ : second_; }
  bool Store(int usart, std::uint32_t data_register, std::uint8_t byte) {
    return first_.Store(usart, data_register, byte) || second_.Store(usart, data_register, byte);
  }
  bool Load(int usart, std::uint32_t data_register, std::uint8_t& byte) {
    return first_.Load(usart, data_register, byte) || second_.Load(usart, data_register, byte);
  }

 private:
  DmaController first_, second_;
};

}  // namespace tiltproof::qemu
