// The last resort when actuators fail: brake, stay level, and sink straight down, slowly. Decided once, when the path
// can neither be followed nor the height be held; there is no way back.
//
//   ControlledDescent descent;
//   descent.Watch(sensors, reference, monitor.faulty(), needs_more_thrust);     // each period with a sample
//   if (descent.begun()) command = law.Step(sensors, descent.reference());
#pragma once

#include "firmware/signals.h"

namespace tiltproof::firmware {

class ControlledDescent {
 public:
  static constexpr float kSink_m_s = 0.5F;

  // Decides. `weak`: an actuator is known to be faulty; `short_of_thrust`: a rotor is asked for more than it has.
  void Watch(const Sensors& sensors, const Reference& reference, bool weak, bool short_of_thrust);
  // Once per control period: the reference moves on.
  void BeginPeriod();

  bool begun() const { return begun_; }
  // From where the vehicle was: its velocity fades away, down to the sink.
  const Reference& reference() const { return reference_; }

 private:
  Reference reference_;
  int short_periods_ = 0;  // of thrust, more than not
  int far_periods_ = 0;    // from the path, in a row
  bool begun_ = false;
};

}  // namespace tiltproof::firmware
