// Activity 3 of 4: sends the inputs that the control law computed (paper, section 2.1, service "actuators";
// no reply).
#pragma once

#include <optional>

#include "firmware/port.h"
#include "link/messages.h"

namespace tiltproof::firmware {

class ActuatorWriter {
 public:
  // `port` must outlive the writer.
  ActuatorWriter(link::Dialect dialect, Port& port);

  void Write(TimeNs now, const Actuators& actuators);

  // Sends the last command once more; nothing when there has been none, for the server then holds the inputs
  // of hover.
  void Repeat(TimeNs now);

 private:
  link::Dialect dialect_;
  Port& port_;
  std::optional<Actuators> last_;
};

}  // namespace tiltproof::firmware
