// Activity 2 of 4: computes a command for the actuators from each reply and the reference to follow.
//
//   ControlActivity control(build);
//   control.Follow(reference);                                // when one has arrived
//   if (const auto command = control.Do(item)) writer.Send(now, *command);
#pragma once

#include <optional>

#include "firmware/builds.h"
#include "firmware/control_law.h"
#include "firmware/reference_follower.h"
#include "firmware/sensor_cycle.h"
#include "firmware/signals.h"
#include "firmware/supervisor.h"
#include "firmware/tolerant/tolerant_control.h"

namespace tiltproof::firmware {

class ControlActivity {
 public:
  // `build` must outlive it.
  explicit ControlActivity(const Build& build);

  // Sets the reference from now on. Before the first one: to stay, at rest, at the position and yaw of the
  // first reply.
  void Follow(const Reference& reference);

  // Normal in a build without supervisor.
  Status status() const { return tolerant_ ? tolerant_->status() : Status{}; }

  const Integrals& integrals() const { return tolerant_ ? tolerant_->integrals() : law_.integrals(); }
  // Goes on with the integrals of another board that flies the same vehicle.
  void SetIntegrals(const Integrals& integrals) {
    tolerant_ ? tolerant_->SetIntegrals(integrals) : law_.SetIntegrals(integrals);
  }

  // nullopt when the item requires no command.
  std::optional<Actuators> Do(const ControlItem& item);

 private:
  std::optional<Actuators> DoTolerantly(const ControlItem& item);

  ControlLaw law_;  // unless:
  std::optional<TolerantControl> tolerant_;
  std::optional<Reference> reference_;         // the last one received, or to stay
  std::optional<ReferenceFollower> follower_;  // of the build with tolerant_, as soon as there is one
};

}  // namespace tiltproof::firmware
