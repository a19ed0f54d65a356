#include "firmware/actuator_writer.h"

#include "firmware/frame_sender.h"

namespace tiltproof::firmware {

ActuatorWriter::ActuatorWriter(link::Dialect dialect, Port& port) : dialect_(dialect), port_(port) {}

void ActuatorWriter::Send(TimeNs now, const ActuatorCommand& command) {
  if (!command.repeats) last_ = command.actuators;
  if (last_) SendFrame(port_, now, link::EncodeActuators(dialect_, *last_));
}

}  // namespace tiltproof::firmware
