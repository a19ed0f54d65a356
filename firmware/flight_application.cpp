#include "firmware/flight_application.h"

namespace tiltproof::firmware {

FlightApplication::FlightApplication(const Build& build, link::Dialect dialect, Port& port, std::size_t place)
    : sensor_cycle_(build, dialect, port),
      control_(build),
      actuator_writer_(dialect, port),
      reference_receiver_(dialect, build.checks) {
  if (build.redundancy != Redundancy::kNone) redundant_board_.emplace(build.redundancy, place, port);
}

TimeNs FlightApplication::Start(TimeNs now) {
  sensor_cycle_.Start(now);
  return Tick(now);
}

void FlightApplication::Receive(Uart uart, std::span<const std::uint8_t> bytes) {
  if (uart == Uart::kMain) {
    sensor_cycle_.Receive(bytes);
  } else if (uart == Uart::kReference) {
    reference_receiver_.Receive(bytes);
  } else if (redundant_board_) {
    redundant_board_->Receive(uart, bytes);
  }
}

TimeNs FlightApplication::Tick(TimeNs now) {
  if (const auto reference = reference_receiver_.TakeReference()) control_.Follow(*reference);
  if (redundant_board_) {
    if (const auto integrals = redundant_board_->TakeIntegrals(control_.integrals()))
      control_.SetIntegrals(*integrals);
  }
  while (const auto item = sensor_cycle_.Next(now)) {
    if (redundant_board_) NoteItem(*item);
    ++control_count_;
    // Without integrals a command would differ from the one that acts, and the model would take that for a fault.
    if (item->kind != ControlItem::Kind::kRequest && redundant_board_ && !redundant_board_->commands())
      continue;
    if (const auto command = control_.Do(*item)) actuator_writer_.Send(now, *command);
  }
  return sensor_cycle_.wake_ns();
}

void FlightApplication::NoteItem(const ControlItem& item) {
  if (item.kind == ControlItem::Kind::kSensors) redundant_board_->NoteReply();
  if (item.kind == ControlItem::Kind::kRequest)
    redundant_board_->BeginPeriod(item.time_ns, control_.integrals());
}

Role FlightApplication::role() const {
  if (redundant_board_) return redundant_board_->role();
  const SupervisorState state = status().state;
  if (IsFailsafe(state)) return Role::kFailed;
  return state == SupervisorState::kInit ? Role::kStandby : Role::kActive;
}

}  // namespace tiltproof::firmware
