#include "firmware/ports/stm32f4/usart.h"

#include <algorithm>

#include "firmware/ports/stm32f4/stm32f4.h"
#include "firmware/ports/stm32f4/symbols.h"
#include "link/frame.h"

constinit tiltproof::stm32f4::ByteRing<kReceiveRingBytes> main_receive_ring;
constinit tiltproof::stm32f4::ByteRing<kTransmitRingBytes> main_transmit_ring;
constinit tiltproof::stm32f4::ByteRing<kReceiveRingBytes> reference_receive_ring;
constinit tiltproof::stm32f4::ByteRing<kConsoleRingBytes> console_transmit_ring;

TiltproofReceiveErrors tiltproof_receive_errors;

namespace tiltproof::stm32f4 {
namespace {

using firmware::Uart;

TimeNs main_idle_ns = 0;  // when the main line's transmitter has sent all that it was given

void Start(UsartRegisters& usart, unsigned irq, std::uint32_t divider, std::uint32_t control) {
  NvicPriority(irq) = Priority(kUsartPriority);
  NvicEnable(irq) = Bit(irq % 32);
  usart.BRR = divider;
  usart.CR2 = 0;  // one stop bit
  usart.CR3 = 0;  // no flow control
  usart.CR1 = control | kUsartCr1Enable;
}

constexpr std::uint32_t kReceiverFlags =
    kUsartSrReceived | kUsartSrOverrun | kUsartSrFramingError | kUsartSrNoise;

void Receive(UsartRegisters& usart, std::uint32_t status, ByteRing<kReceiveRingBytes>& ring,
             TiltproofReceiveErrorCounts& errors, Uart uart) {
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
void Pump(UsartRegisters& usart, ByteRing<size>& ring) {
  const InterruptLock lock;
  const std::span<const std::uint8_t> bytes = ring.Front();
  if (!bytes.empty() && (usart.SR & kUsartSrTransmitEmpty) != 0) {
    usart.DR = bytes.front();
    ring.Drop(1);
  }
  if (ring.Front().empty()) Clear(usart.CR1, kUsartCr1TransmitEmptyInterrupt);
}

template <std::uint32_t size>
bool Send(UsartRegisters& usart, ByteRing<size>& ring, std::span<const std::uint8_t> bytes) {
  // Several tasks may send: a frame goes in as one.
  const InterruptLock lock;
  ring.MendIndices();
  if (ring.Room() < bytes.size()) return false;
  for (const std::uint8_t byte : bytes) ring.Put(byte);
  Set(usart.CR1, kUsartCr1TransmitEmptyInterrupt);
  return true;
}

}  // namespace

void StartUsarts() {
  Start(Usart1(), kIrqUsart1, BaudDivider(kApb2Hz, kConsoleBaud), kUsartCr1Transmit);
  constexpr std::uint32_t kReceiver = kUsartCr1Receive | kUsartCr1ReceivedInterrupt;
  Start(Usart2(), kIrqUsart2, BaudDivider(kApb1Hz, kLineBaud), kReceiver | kUsartCr1Transmit);
  Start(Usart3(), kIrqUsart3, BaudDivider(kApb1Hz, kLineBaud), kReceiver);
}

TimeNs SendMain(std::span<const std::uint8_t> bytes) {
  const bool sent = Send(Usart2(), main_transmit_ring, bytes);
  const TimeNs now = Now();
  const InterruptLock lock;
  const TimeNs begin = std::max(now, main_idle_ns);
  if (!sent) return begin;
  main_idle_ns = begin + static_cast<TimeNs>(bytes.size()) * ByteTimeNs(kApb1Hz, kLineBaud);
  return main_idle_ns;
}

void SendConsole(std::span<const std::uint8_t> bytes) { Send(Usart1(), console_transmit_ring, bytes); }

}  // namespace tiltproof::stm32f4

extern "C" {

void USART1_IRQHandler() { tiltproof::stm32f4::Pump(tiltproof::stm32f4::Usart1(), console_transmit_ring); }

void USART2_IRQHandler() {
  using namespace tiltproof::stm32f4;
  UsartRegisters& usart = Usart2();
  const std::uint32_t status = usart.SR;
  Receive(usart, status, main_receive_ring, tiltproof_receive_errors.main, tiltproof::firmware::Uart::kMain);
  // Called for the transmitter, or it has something to do: most calls are for the receiver alone.
  if ((status & kReceiverFlags) == 0 || !main_transmit_ring.Front().empty()) Pump(usart, main_transmit_ring);
}

void USART3_IRQHandler() {
  using namespace tiltproof::stm32f4;
  UsartRegisters& usart = Usart3();
  Receive(usart, usart.SR, reference_receive_ring, tiltproof_receive_errors.reference,
          tiltproof::firmware::Uart::kReference);
}

}  // extern "C"
