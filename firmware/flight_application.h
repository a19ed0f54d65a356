// The flight firmware as a whole: its four activities composed into the paper's periodic cycle (section 2.1,
// Figure 4; section 2.3, Figure 8). Every port that runs it as one thread uses this class; a port with one
// task an activity composes the same units.
//
//   FlightApplication application(*FindBuild("paper"), link::Dialect::kPaper, port);
//   TimeNs wake = application.Start(now);            // power-on
//   for (;;) {                                       // until `wake` or until bytes arrive
//     application.Receive(Uart::kMain, bytes);
//     wake = application.Tick(now);
//   }
//
// Timing. The firmware leads. It sends `start`; when that frame's last bit has left, it sends the first
// request; then it sends one request every 12 ms, counted from that first one (a period that could not begin
// in time begins late, and the grid stays). A valid reply is answered at once by one control step and its
// actuators. When none has arrived by the next tick, `paper` sends no actuators and asks again; `tolerant`
// repeats its last command at the time-out within the period, and still uses a reply that comes later.
#pragma once

#include <cstdint>
#include <span>

#include "firmware/actuator_writer.h"
#include "firmware/builds.h"
#include "firmware/control_law.h"
#include "firmware/port.h"
#include "firmware/reference_receiver.h"
#include "firmware/sensor_reader.h"

namespace tiltproof::firmware {

enum class SupervisorState : std::uint32_t {
  kNormal = 0,
  kBlind = 1,  // fail-safe: no valid reply for several periods, the last command is held
};

struct Status {
  SupervisorState state = SupervisorState::kNormal;
  std::uint32_t failsafe_count = 0;  // entries of a state other than kNormal since power-on
};

class FlightApplication {
 public:
  // `build` and `port` must outlive the application.
  FlightApplication(const Build& build, link::Dialect dialect, Port& port);

  // Power-on, once. Returns when to call Tick at the latest.
  TimeNs Start(TimeNs now);

  // Bytes from a receiver, in order, in any pieces. Decodes only; Tick acts on what has arrived.
  void Receive(Uart uart, std::span<const std::uint8_t> bytes);

  // Does all that is due at `now`, which does not decrease. Returns when to call again at the latest; sooner
  // if bytes arrive.
  TimeNs Tick(TimeNs now);

  const Status& status() const { return status_; }

 private:
  void SendStart(TimeNs now);
  void BeginPeriod(TimeNs now);
  void Control(TimeNs now, const Sensors& sensors);
  void NoteReply(TimeNs now);
  void NoteMissingReply(TimeNs now);

  const Build& build_;
  link::Dialect dialect_;
  Port& port_;
  SensorReader sensor_reader_;
  ControlLaw control_law_;
  ActuatorWriter actuator_writer_;
  ReferenceReceiver reference_receiver_;

  TimeNs next_request_ns_ = kNever;
  TimeNs reply_timeout_ns_ = kNever;  // when the present period's runs out
  bool start_is_fresh_ = false;       // `start` has been sent and no request since
  bool heard_server_ = false;         // a valid reply has arrived
  std::uint32_t blind_periods_ = 0;   // in a row, up to now
  Status status_;
};

}  // namespace tiltproof::firmware
