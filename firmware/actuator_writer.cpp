#include "firmware/actuator_writer.h"

#include "firmware/frame_sender.h"

namespace tiltproof::firmware {

ActuatorWriter::ActuatorWriter(link::Dialect dialect, Port& port) : dialect_(dialect), port_(port) {}

void ActuatorWriter::Send(TimeNs now, const Actuators& command) {
  SendFrame(port_, now, link::EncodeActuators(dialect_, command));
}

}  // namespace tiltproof::firmware
