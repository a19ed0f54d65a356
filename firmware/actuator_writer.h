// Activity 3 of 4: sends the inputs that the control law computed (paper, section 2.1, service "actuators";
// no reply).
#pragma once

#include "firmware/frame_sender.h"
#include "firmware/port.h"

namespace tiltproof::firmware {

class ActuatorWriter {
 public:
  // `port` must outlive the writer.
  ActuatorWriter(link::Dialect dialect, Port& port);

  void Send(TimeNs now, const Actuators& command);

 private:
  FrameSender sender_;
};

}  // namespace tiltproof::firmware
