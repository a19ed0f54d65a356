// Activity 3 of 4: sends the inputs that the control law computed (paper, section 2.1, service "actuators";
// no reply).
#pragma once

#include <optional>

#include "firmware/messages.h"
#include "firmware/port.h"

namespace tiltproof::firmware {

struct ActuatorCommand {
  bool repeats = false;  // the last command once more
  Actuators actuators;   // of one that does not repeat
};

class ActuatorWriter {
 public:
  // `port` must outlive the writer.
  ActuatorWriter(link::Dialect dialect, Port& port);

  // Repeating before a first command sends nothing, for the server then holds the inputs of hover.
  void Send(TimeNs now, const ActuatorCommand& command);

 private:
  link::Dialect dialect_;
  Port& port_;
  std::optional<Actuators> last_;
};

}  // namespace tiltproof::firmware
