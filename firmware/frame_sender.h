// Frame layer, sending side: a message of the client, as a frame, to the main line's transmitter.
#pragma once

#include <array>

#include "firmware/messages.h"
#include "firmware/port.h"
#include "link/frame.h"

namespace tiltproof::firmware {

// Returns when the frame's last stop bit will have left. The client's longest message is the actuators'.
inline TimeNs SendFrame(Port& port, TimeNs now, const link::MessageBytes& message) {
  std::array<std::uint8_t, link::FrameBytesMax(link::kActuatorMessageBytes)> wire;
  return port.Transmit(Uart::kMain, now, link::EncodeFrame(message.span(), wire).bytes);
}

}  // namespace tiltproof::firmware
