#include "firmware/ports/stm32f4/usart.h"

#include <algorithm>

#include "firmware/ports/stm32f4/stm32f4.h"
#include "firmware/ports/stm32f4/symbols.h"
#include "firmware/ports/stm32f4/usart_line.h"

constinit tiltproof::stm32f4::ByteRing<kReceiveRingBytes> main_receive_ring;
constinit tiltproof::stm32f4::ByteRing<kTransmitRingBytes> main_transmit_ring;
constinit tiltproof::stm32f4::ByteRing<kReceiveRingBytes> reference_receive_ring;
constinit tiltproof::stm32f4::ByteRing<kConsoleRingBytes> console_transmit_ring;

TiltproofReceiveErrors tiltproof_receive_errors;

namespace tiltproof::stm32f4 {
namespace {

TimeNs main_idle_ns = 0;  // when the main line's transmitter has sent all that it was given

}  // namespace

void StartUsarts() {
  StartUsart(Usart1(), kIrqUsart1, BaudDivider(kApb2Hz, kConsoleBaud), kUsartCr1Transmit);
  StartUsart(Usart2(), kIrqUsart2, BaudDivider(kApb1Hz, kLineBaud), kReceiver | kUsartCr1Transmit);
  StartUsart(Usart3(), kIrqUsart3, BaudDivider(kApb1Hz, kLineBaud), kReceiver);
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
