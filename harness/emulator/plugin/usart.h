// A USART (RM0090, section 30), both halves: flags, interrupts, DMA requests, and the time that bytes take.
//
//   usart.Init(2, clocks, dma, callbacks);
//   usart.Deliver('A', 0);  // a byte has arrived from the line
//
// The transmitter has a data register and a shift register: TXE when the first has been handed on, TC when the last bit
// has left. Asynchronous mode only, without break, LIN, smart card or flow control. The parity bit is the highest
// bit of a received word (section 30.6.2); the line computes that of a sent byte.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>

#include "harness/emulator/plugin/clock_tree.h"
#include "harness/emulator/plugin/dma.h"
#include "harness/emulator/plugin/parts.h"

namespace tiltproof::qemu {

class UsartUnit final : public RegisterBlock {
 public:
  static constexpr int kCount = 6;  // USART1 to USART3, UART4, UART5, USART6
  static constexpr std::uint32_t kParity = 1u << 0, kFraming = 1u << 1, kNoise = 1u << 2, kOverrun = 1u << 3;

  struct Callbacks {
    std::function<void(int number, std::uint8_t byte)> transmit;  // given to the transmitter
    std::function<void(int number)> taken;                        // the receiver has room again
    std::function<void(int number)> programmed;                   // CR1 has been written
  };
  // Registers and clock that determine its rate and its characters.
  struct Settings {
    std::uint32_t brr, cr1, cr2, cr3, clock_hz;
  };

  // `number`: 1 to kCount.
  void Init(int number, const ClockTree& clocks, Dma& dma, Callbacks callbacks) {
    constexpr std::array<std::uint32_t, kCount> kAddresses = {0x40011000, 0x40004400, 0x40004800,
                                                              0x40004C00, 0x40005000, 0x40011400};
    constexpr std::array<int, kCount> kInterrupts = {37, 38, 39, 52, 53, 71};
    number_ = number;
    clocks_ = &clocks;
    dma_ = &dma;
    callbacks_ = std::move(callbacks);
    const auto index = static_cast<std::size_t>(number - 1);
    address_ = kAddresses[index];
    interrupt_.Init(kInterrupts[index]);
    timer_.Init([](void* self) { static_cast<UsartUnit*>(self)->Serve(); }, this);
    Map("usart-registers", address_);
    Reset();
  }
  // Bytes need no time to be sent: on a line without a rate.
  void SetUnpaced() { unpaced_ = true; }

  void Reset() {
    ClearWords();
    flags_ = kComplete;
    seen_ = 0;
    received_ = 0;
    full_ = shifting_ = idle_follows_ = false;
    Serve();
  }

  // True if the last byte has been read.
  bool Free() const { return (flags_ & kNotEmpty) == 0; }
  bool Receives() const { return On(kReceiverOn); }
  // Input clock of the divider; 0: it has none (RCC).
  std::uint32_t clock_hz() const { return has_clock() ? Clock() : 0; }
  Settings settings() const {
    return {Word(kBaudRate), Word(kControl1), Word(kControl2), Word(kControl3), Clock()};
  }

  // A word has arrived, with these error flags. Lost when the receiver is off.
  void Deliver(std::uint16_t word, std::uint32_t errors) {
    if (!Receives()) return;
    Sync();
    if (Free()) {
      received_ = word;
      flags_ |= kNotEmpty | errors;
    } else {
      flags_ |= kOverrun;  // section 30.3.3: the old byte stays
    }
    AwaitIdle();
    Serve();
  }
  // A byte has arrived and is lost.
  void Overrun() {
    if (!Receives()) return;
    Sync();
    flags_ |= kOverrun;
    AwaitIdle();
    Serve();
  }

  // Does what is due: moves bytes on, answers to DMA, raises or withdraws the interrupt.
  void Serve() {
    Sync();
    if (!Free() && (Word(kControl3) & kDmaReceive) != 0 &&
        dma_->Store(number_, address_ + kData, static_cast<std::uint8_t>(received_)))
      PopByte();
    std::uint8_t byte = 0;
    while (!full_ && On(kTransmitterOn) && (Word(kControl3) & kDmaTransmit) != 0 &&
           dma_->Load(number_, address_ + kData, byte))
      Send(byte);
    UpdateInterrupt();
    Arm();
  }

 private:
  static constexpr std::uint32_t kStatus = 0x00, kData = 0x04, kBaudRate = 0x08, kControl1 = 0x0C,
                                 kControl2 = 0x10, kControl3 = 0x14;
  // SR (section 30.6.1).
  static constexpr std::uint32_t kIdle = 1u << 4, kNotEmpty = 1u << 5, kComplete = 1u << 6,
                                 kTransmitEmpty = 1u << 7;
  static constexpr std::uint32_t kErrors = kFraming | kNoise | kOverrun;
  // CR1: the interrupts' enable bits are in the places of their flags (section 30.6.4).
  static constexpr std::uint32_t kReceiverOn = 1u << 2, kTransmitterOn = 1u << 3, kParityInterrupt = 1u << 8,
                                 kNineBits = 1u << 12, kEnable = 1u << 13, kOver8 = 1u << 15;
  // CR3.
  static constexpr std::uint32_t kErrorInterrupt = 1u << 0, kDmaReceive = 1u << 6, kDmaTransmit = 1u << 7;

  bool On(std::uint32_t half) const {
    const std::uint32_t bits = half | kEnable;
    return (Word(kControl1) & bits) == bits;
  }
  std::uint32_t Clock() const { return clocks_->pclk_hz(number_ == 1 || number_ == 6 ? 2 : 1); }
  std::uint32_t Status() const { return flags_ | (full_ ? 0 : kTransmitEmpty); }

  // Duration of one character with its start and stop bits (sections 30.3.2 and 30.3.4); 0 without a rate.
  std::int64_t ByteNs() const {
    const bool over8 = (Word(kControl1) & kOver8) != 0;
    const std::uint32_t divider = Word(kBaudRate);
    const std::int64_t clocks_per_bit =
        (divider >> 4 & 0xFFF) * (over8 ? 8 : 16) + (divider & (over8 ? 7 : 15));
    constexpr std::array<int, 4> kStopHalfBits = {2, 1, 4, 3};
    const int data_bits = (Word(kControl1) & kNineBits) != 0 ? 9 : 8;
    const std::int64_t half_bits = 2 * (1 + data_bits) + kStopHalfBits[Word(kControl2) >> 12 & 3];
    return half_bits * clocks_per_bit * kNsPerSecond / (2 * std::int64_t{Clock()});
  }

  // Brings the flags up to the present.
  void Sync() {
    const std::int64_t now = Now();
    while (shifting_ && now >= shifted_ns_) {
      if (full_) {
        full_ = false;
        shifted_ns_ += ByteNs();
      } else {
        shifting_ = false;
        flags_ |= kComplete;
      }
    }
    if (idle_follows_ && now >= idle_ns_) {
      idle_follows_ = false;
      flags_ |= kIdle;
    }
  }

  // The line is idle when it has been quiet for a character since the last one (section 30.3.3). A character that begins
  // in that time is known here when it ends: it may take a little longer, from a sender at another rate.
  void AwaitIdle() {
    const std::int64_t byte_ns = ByteNs();
    idle_follows_ = byte_ns != 0;
    idle_ns_ = Now() + byte_ns + byte_ns / 16;
  }

  // When the flags change next in a way that raises an interrupt or asks the DMA.
  void Arm() {
    constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();
    const std::uint32_t control = Word(kControl1);
    std::int64_t next = kNever;
    const bool wants_byte = (control & kTransmitEmpty) != 0 || (Word(kControl3) & kDmaTransmit) != 0;
    if (shifting_ && ((full_ && wants_byte) || (control & kComplete) != 0)) next = shifted_ns_;
    if (idle_follows_ && (control & kIdle) != 0) next = std::min(next, idle_ns_);
    if (next == armed_ns_ && next > Now()) return;
    armed_ns_ = next;
    if (next == kNever) return timer_.Cancel();
    timer_.Set(next);
  }

  void UpdateInterrupt() {
    const std::uint32_t control = Word(kControl1), status = Status();
    const std::uint32_t receiver = (status & kOverrun) != 0 ? kNotEmpty : 0;
    const bool flagged =
        ((status | receiver) & control & (kIdle | kNotEmpty | kComplete | kTransmitEmpty)) != 0;
    const bool error = (Word(kControl3) & kErrorInterrupt) != 0 && (Word(kControl3) & kDmaReceive) != 0 &&
                       (status & kErrors) != 0;
    const bool parity = (control & kParityInterrupt) != 0 && (status & kParity) != 0;
    interrupt_.Set((control & kEnable) != 0 && (flagged || error || parity));
  }

  // Reads DR. The errors and IDLE are cleared when SR and then DR have been read.
  std::uint16_t PopByte() {
    flags_ &= ~(kNotEmpty | (seen_ & (kErrors | kParity | kIdle)));
    seen_ &= ~(kErrors | kParity | kIdle);
    return received_;
  }

  // Writes DR. A byte too many is lost; on the chip it replaces the one that waits.
  void Send(std::uint8_t byte) {
    if (!On(kTransmitterOn) || full_) return;
    // These are cleared when SR has been read and DR is written.
    flags_ &= ~(seen_ & (kComplete | kParity));
    seen_ &= ~(kComplete | kParity);
    if (unpaced_) {
      flags_ |= kComplete;
    } else if (shifting_) {
      full_ = true;
    } else {
      shifting_ = true;
      const std::int64_t byte_ns = ByteNs();
      shifted_ns_ = byte_ns != 0 ? Now() + byte_ns : std::numeric_limits<std::int64_t>::max();  // never
    }
    callbacks_.transmit(number_, byte);
  }

  std::uint32_t Read(std::uint32_t offset) override {
    if (offset == kStatus) {
      Sync();
      seen_ = flags_;
      return Status();
    }
    if (offset != kData) return Word(offset);
    const std::uint16_t word = PopByte();
    UpdateInterrupt();
    if (callbacks_.taken) callbacks_.taken(number_);
    return word;
  }

  void Write(std::uint32_t offset, std::uint32_t value) override {
    Sync();
    if (offset == kStatus) {
      flags_ &= value | ~(kNotEmpty | kComplete);  // these two can be cleared, the others not
    } else if (offset == kData) {
      Send(static_cast<std::uint8_t>(value));
    } else {
      Word(offset) = offset == kControl1 ? value & ~1u : value;  // SBK: no break is sent
    }
    Serve();
    if (offset == kControl1 && callbacks_.programmed) callbacks_.programmed(number_);
  }

  int number_ = 0;
  std::uint32_t address_ = 0;
  const ClockTree* clocks_ = nullptr;
  Dma* dma_ = nullptr;
  Callbacks callbacks_;
  Interrupt interrupt_;
  Timer timer_;
  std::int64_t armed_ns_ = 0;
  bool unpaced_ = false;
  std::uint32_t flags_ = kComplete;  // SR, without TXE
  std::uint32_t seen_ = 0;           // of these, when SR was last read
  std::uint16_t received_ = 0;
  bool full_ = false;            // the data register of the transmitter
  bool shifting_ = false;        // its shift register
  std::int64_t shifted_ns_ = 0;  // when that is empty
  bool idle_follows_ = false;    // unless another byte arrives before idle_ns_
  std::int64_t idle_ns_ = 0;
};

}  // namespace tiltproof::qemu
