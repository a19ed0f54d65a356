#include "firmware/flight_application.h"

namespace tiltproof::firmware {

FlightApplication::FlightApplication(const Build& build, link::Dialect dialect, Port& port)
    : sensor_cycle_(build, dialect, port),
      control_(build),
      actuator_writer_(dialect, port),
      reference_receiver_(dialect, build.checks) {}

TimeNs FlightApplication::Start(TimeNs now) {
  sensor_cycle_.Start(now);
  return Tick(now);
}

void FlightApplication::Receive(Uart uart, std::span<const std::uint8_t> bytes) {
  if (uart == Uart::kMain) {
    sensor_cycle_.Receive(bytes);
  } else {
    reference_receiver_.Receive(bytes);
  }
}

TimeNs FlightApplication::Tick(TimeNs now) {
  if (const auto reference = reference_receiver_.TakeReference()) control_.Follow(*reference);
  while (const auto item = sensor_cycle_.Next(now)) {
    if (const auto command = control_.Do(*item)) actuator_writer_.Send(now, *command);
    ++control_count_;
  }
  return sensor_cycle_.wake_ns();
}

}  // namespace tiltproof::firmware
