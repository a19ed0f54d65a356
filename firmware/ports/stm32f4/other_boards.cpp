#include "firmware/ports/stm32f4/other_boards.h"

#include "firmware/ports/stm32f4/pins.h"
#include "firmware/ports/stm32f4/stm32f4.h"
#include "firmware/ports/stm32f4/symbols.h"
#include "firmware/ports/stm32f4/usart_line.h"

constinit tiltproof::stm32f4::ByteRing<kReceiveRingBytes> cross_receive_ring, second_cross_receive_ring;
constinit tiltproof::stm32f4::ByteRing<kTransmitRingBytes> cross_transmit_ring, second_cross_transmit_ring;

TiltproofReceiveErrorCounts tiltproof_cross_receive_errors[2];

extern "C" {
extern const std::uint32_t tiltproof_place = 0;
std::uint32_t tiltproof_role;
}

namespace tiltproof::stm32f4 {
namespace {

// From the interrupt of a line to another board.
void Serve(UsartRegisters& usart, firmware::Uart uart, ByteRing<kReceiveRingBytes>& receive_ring,
           ByteRing<kTransmitRingBytes>& transmit_ring, TiltproofReceiveErrorCounts& errors) {
  Receive(usart, usart.SR, receive_ring, errors, uart);
  Pump(usart, transmit_ring);
}

}  // namespace

// Alternate function 8 is USART6 and UART4 (data sheet DS8626, alternate functions).
void StartCrossLines() {
  Set(Rcc().AHB1ENR, kRccAhb1GpioC);
  Set(Rcc().APB1ENR, kRccApb1Uart4);
  Set(Rcc().APB2ENR, kRccApb2Usart6);
  DataBarrier();
  constexpr unsigned kCrossUsart = 8;
  for (const unsigned pin : {6U, 7U, 10U, 11U})
    SetPin(GpioC(), pin, PinMode::kAlternate, kCrossUsart, Pull::kUp);
  StartUsart(Usart6(), kIrqUsart6, BaudDivider(kApb2Hz, kLineBaud), kReceiver | kUsartCr1Transmit);
  StartUsart(Uart4(), kIrqUart4, BaudDivider(kApb1Hz, kLineBaud), kReceiver | kUsartCr1Transmit);
}

void SendToOtherBoard(firmware::Uart uart, std::span<const std::uint8_t> bytes) {
  if (uart == firmware::Uart::kCross) Send(Usart6(), cross_transmit_ring, bytes);
  if (uart == firmware::Uart::kSecondCross) Send(Uart4(), second_cross_transmit_ring, bytes);
}

}  // namespace tiltproof::stm32f4

extern "C" {

void USART6_IRQHandler() {
  using namespace tiltproof::stm32f4;
  Serve(Usart6(), tiltproof::firmware::Uart::kCross, cross_receive_ring, cross_transmit_ring,
        tiltproof_cross_receive_errors[0]);
}

void UART4_IRQHandler() {
  using namespace tiltproof::stm32f4;
  Serve(Uart4(), tiltproof::firmware::Uart::kSecondCross, second_cross_receive_ring,
        second_cross_transmit_ring, tiltproof_cross_receive_errors[1]);
}

}  // extern "C"
