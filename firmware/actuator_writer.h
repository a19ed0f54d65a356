// Activity 3 of 4: sends the inputs that the control law computed (paper, section 2.1, service "actuators";
// no reply).
#pragma once

#include <optional>

#include "firmware/messages.h"
#include "firmware/port.h"

namespace tiltproof::firmware {

struct ActuatorCommand {
  bool repeats = false;  // the last command once more
  Actuators actuators;   // for a command that is not a repetition
};

class ActuatorWriter {
 public:
  // `port` must outlive the writer.
  ActuatorWriter(link::Dialect dialect, Port& port);

  // Repeating before the first command sends nothing, because the server then holds the hover inputs.
  void Send(TimeNs now, const ActuatorCommand& command);

 private:
  link::Dialect dialect_;
  Port& port_;
  std::optional<Actuators> last_;
};

}  // namespace tiltproof::firmware
