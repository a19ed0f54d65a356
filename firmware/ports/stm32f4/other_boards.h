// The other boards on the vehicle: what an image of the builds failover and triplex has besides.
//
//   StartCrossLines();                              // after StartUsarts()
//   RedundantPort port;                             // firmware/port.h, also on the lines to other boards
//   ReceiveFromOtherBoards([](Uart uart, auto bytes) { ... });
//   tiltproof_role = static_cast<std::uint32_t>(flight_application.role());
//
// The lines have 921600 baud, both ways:
//   Uart::kCross         USART6   PC6 TX, PC7 RX
//   Uart::kSecondCross   UART4    PC10 TX, PC11 RX
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/port.h"
#include "firmware/ports/stm32f4/console.h"
#include "firmware/ports/stm32f4/stm32f4_port.h"
#include "firmware/ports/stm32f4/usart.h"
#include "firmware/tiltproof_client.h"

// Global, under these names, so that tools that read the image find them.
extern tiltproof::stm32f4::ByteRing<kReceiveRingBytes> cross_receive_ring, second_cross_receive_ring;
extern tiltproof::stm32f4::ByteRing<kTransmitRingBytes> cross_transmit_ring, second_cross_transmit_ring;

extern "C" {
// This board's place among several, from 0: a word in flash that is written when the chip is programmed. It is defined in
// another source, so that the compiler cannot know it.
extern const std::uint32_t tiltproof_place;
// This board's role, as tiltproof_client_role() gives it; written once a wake-up.
extern std::uint32_t tiltproof_role;
}

namespace tiltproof::stm32f4 {

void StartCrossLines();

// Passes bytes to the line's transmitter: all of them or, when there is not enough room, none.
void SendToOtherBoard(firmware::Uart uart, std::span<const std::uint8_t> bytes);

// Everything that other boards sent, each line in order, to `receive(uart, bytes)`.
template <class Receiver>
void ReceiveFromOtherBoards(const Receiver& receive) {
  Drain(cross_receive_ring, [&](auto bytes) { receive(firmware::Uart::kCross, bytes); });
  Drain(second_cross_receive_ring, [&](auto bytes) { receive(firmware::Uart::kSecondCross, bytes); });
}

class RedundantPort final : public firmware::Port {
 public:
  TimeNs Transmit(firmware::Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) override {
    if (uart == firmware::Uart::kMain) return SendMain(bytes);
    SendToOtherBoard(uart, bytes);
    return now;
  }
  void Log(TimeNs /*now*/, const char* text) override { ConsoleLine(text).Send(); }
};

}  // namespace tiltproof::stm32f4
