#include "firmware/actuator_writer.h"

namespace tiltproof::firmware {

ActuatorWriter::ActuatorWriter(link::Dialect dialect, Port& port) : sender_(dialect, port) {}

void ActuatorWriter::Send(TimeNs now, const Actuators& command) {
  sender_.Send(now, link::EncodeActuators(sender_.dialect(), command));
}

}  // namespace tiltproof::firmware
