// firmware/port.h on this board.
#pragma once

#include "firmware/port.h"
#include "firmware/ports/stm32f4/console.h"
#include "firmware/ports/stm32f4/usart.h"

namespace tiltproof::stm32f4 {

class Stm32f4Port final : public firmware::Port {
 public:
  // The firmware sends only on the main line. The application's time is that of the last tick, the line's is
  // exact.
  TimeNs Transmit(firmware::Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) override {
    return uart == firmware::Uart::kMain ? SendMain(bytes) : now;
  }
  void Log(TimeNs /*now*/, const char* text) override { ConsoleLine(text).Send(); }
};

// Everything in `ring`, in order, to `receive(bytes)`.
template <class Receiver>
void Drain(ByteRing<kReceiveRingBytes>& ring, const Receiver& receive) {
  for (auto bytes = ring.Front(); !bytes.empty(); bytes = ring.Front()) {
    receive(bytes);
    ring.Drop(bytes.size());
  }
}

}  // namespace tiltproof::stm32f4
