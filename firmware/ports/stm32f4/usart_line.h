// A USART over its rings, by interrupt: what the lines of usart.h and of other_boards.h share. Internal to this folder. The
// functions are static: each of both sources has its own, inlined where they are called.
//
//   StartUsart(Usart6(), kIrqUsart6, BaudDivider(kApb2Hz, kLineBaud), kReceiver | kUsartCr1Transmit);
//   Receive(usart, usart.SR, receive_ring, errors, Uart::kCross);   // from its interrupt
//   Pump(usart, transmit_ring);                                     // from its interrupt
//   Send(usart, transmit_ring, bytes);
#pragma once

#include <cstdint>
#include <span>

#include "firmware/port.h"
#include "firmware/ports/stm32f4/byte_ring.h"
#include "firmware/ports/stm32f4/stm32f4.h"
#include "firmware/ports/stm32f4/symbols.h"
#include "firmware/ports/stm32f4/usart.h"
#include "link/frame.h"

namespace tiltproof::stm32f4 {

static void StartUsart(UsartRegisters& usart, unsigned irq, std::uint32_t divider, std::uint32_t control) {
  NvicPriority(irq) = Priority(kUsartPriority);
  NvicEnable(irq) = Bit(irq % 32);
  usart.BRR = divider;
  usart.CR2 = 0;  // one stop bit
  usart.CR3 = 0;  // no flow control
  usart.CR1 = control | kUsartCr1Enable;
}

inline constexpr std::uint32_t kReceiver = kUsartCr1Receive | kUsartCr1ReceivedInterrupt;
inline constexpr std::uint32_t kReceiverFlags =
    kUsartSrReceived | kUsartSrOverrun | kUsartSrFramingError | kUsartSrNoise;

static void Receive(UsartRegisters& usart, std::uint32_t status, ByteRing<kReceiveRingBytes>& ring,
                    TiltproofReceiveErrorCounts& errors, firmware::Uart uart) {
  if ((status & kReceiverFlags) == 0) return;
  // Reading the status, then the byte, clears them all (30.6.1).
  const auto byte = static_cast<std::uint8_t>(usart.DR);
  if ((status & kUsartSrOverrun) != 0) ++errors.overrun;
  if ((status & kUsartSrNoise) != 0) ++errors.noise;
  if ((status & kUsartSrFramingError) != 0) {
    ++errors.framing;
    return;
  }
  if ((status & kUsartSrReceived) == 0) return;  // an overrun that was seen late: its byte is gone
  if (!ring.Put(byte)) ++errors.ring_full;
  if (byte == link::kFlag || ring.Room() < kReceiveRingBytes / 4) OnReceived(uart);
}

// Moves one byte from the ring to the transmitter, if it has room for one. With the ring's last byte its interrupt ends.
template <std::uint32_t size>
static void Pump(UsartRegisters& usart, ByteRing<size>& ring) {
  const InterruptLock lock;
  const std::span<const std::uint8_t> bytes = ring.Front();
  if (!bytes.empty() && (usart.SR & kUsartSrTransmitEmpty) != 0) {
    usart.DR = bytes.front();
    ring.Drop(1);
  }
  if (ring.Front().empty()) Clear(usart.CR1, kUsartCr1TransmitEmptyInterrupt);
}

template <std::uint32_t size>
static bool Send(UsartRegisters& usart, ByteRing<size>& ring, std::span<const std::uint8_t> bytes) {
  // Several tasks may send: a frame goes in as one.
  const InterruptLock lock;
  ring.MendIndices();
  if (ring.Room() < bytes.size()) return false;
  for (const std::uint8_t byte : bytes) ring.Put(byte);
  Set(usart.CR1, kUsartCr1TransmitEmptyInterrupt);
  return true;
}

}  // namespace tiltproof::stm32f4
