#include "firmware/actuator_writer.h"

#include "firmware/frame_sender.h"

namespace tiltproof::firmware {

ActuatorWriter::ActuatorWriter(link::Dialect dialect, Port& port) : dialect_(dialect), port_(port) {}

void ActuatorWriter::Write(TimeNs now, const Actuators& actuators) {
  last_ = actuators;
  SendFrame(port_, now, link::EncodeActuators(dialect_, actuators));
}

void ActuatorWriter::Repeat(TimeNs now) {
  if (last_) SendFrame(port_, now, link::EncodeActuators(dialect_, *last_));
}

}  // namespace tiltproof::firmware
