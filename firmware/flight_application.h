// The flight firmware as a whole: its four activities composed into the paper's periodic cycle (section 2.1,
// Figure 4; section 2.3, Figure 8). Every port that runs it as one thread uses this class; a port with one
// task per activity composes the same units, with a queue for each arrow.
//
//   FlightApplication application(*FindBuild("paper"), link::Dialect::kPaper, port);
//   TimeNs wake = application.Start(now);            // power-on
//   for (;;) {                                       // until `wake` or until bytes arrive
//     application.Receive(Uart::kMain, bytes);
//     wake = application.Tick(now);
//   }
//
// Timing: sensor_cycle.h. A valid reply is answered at once by one control step and its actuators.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "firmware/actuator_writer.h"
#include "firmware/builds.h"
#include "firmware/control_activity.h"
#include "firmware/failover/redundant_board.h"
#include "firmware/port.h"
#include "firmware/reference_receiver.h"
#include "firmware/sensor_cycle.h"

namespace tiltproof::firmware {

class FlightApplication {
 public:
  // `build` and `port` must outlive the application. `place`: of this board among several, from 0.
  FlightApplication(const Build& build, link::Dialect dialect, Port& port, std::size_t place = 0);

  // Call once, at power-on. Returns when to call Tick at the latest.
  TimeNs Start(TimeNs now);

  // Bytes from a receiver, in order, in any pieces. Decodes only; Tick acts on what has arrived.
  void Receive(Uart uart, std::span<const std::uint8_t> bytes);

  // Does all that is due at `now`, which does not decrease. Returns when to call again at the latest; sooner
  // if bytes arrive.
  TimeNs Tick(TimeNs now);

  Status status() const { return control_.status(); }

  // Active whenever it flies by what it is sent, in a build that is alone.
  Role role() const;

  // The number of times that the control activity has had work, modulo 2^32. From the second period on it grows at
  // least once per period, with replies or without. A watchdog can check this number.
  std::uint32_t control_count() const { return control_count_; }

 private:
  void NoteItem(const ControlItem& item);

  SensorCycle sensor_cycle_;
  ControlActivity control_;
  ActuatorWriter actuator_writer_;
  ReferenceReceiver reference_receiver_;
  std::optional<RedundantBoard> redundant_board_;
  std::uint32_t control_count_ = 0;
};

}  // namespace tiltproof::firmware
