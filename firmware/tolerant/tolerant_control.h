// Activity 2 of 4 of the build `tolerant`: commands that take the line's faults into account.
//
//   TolerantControl control(gain, feed_forward);
//   control.NoteRequest(request);                                        // each one sent
//   if (const auto u = control.OnReply(now, sensors, reference)) Send(*u);     // each valid reply, late ones too
//   if (const auto u = control.OnTimeout(now, reference)) Send(*u);            // when none has come in time
//
// A reply in time is answered as the paper does, from the sample itself: the same bits. Otherwise the command is
// computed from the state that the model predicts for the instant at which it will act.
#pragma once

#include <optional>

#include "firmware/control_law.h"
#include "firmware/supervisor.h"
#include "firmware/tolerant/accepted_replies.h"
#include "firmware/tolerant/actuator_monitor.h"
#include "firmware/tolerant/controlled_descent.h"
#include "firmware/tolerant/lag_estimator.h"
#include "firmware/tolerant/motion_timeline.h"
#include "firmware/tolerant/reply_matcher.h"
#include "firmware/tolerant/signal_screen.h"

namespace tiltproof::firmware {

// On the firmware's clock.
struct RequestTimes {
  TimeNs origin_ns = 0;  // when `start` had left: the server's grid of steps begins
  TimeNs begin_ns = 0;   // the request is given to the transmitter
  TimeNs sent_ns = 0;    // its last bit has left
};

class TolerantControl {
 public:
  // `gain` must outlive it.
  TolerantControl(const Gain& gain, const Actuators& feed_forward)
      : law_(gain, feed_forward), hover_(feed_forward) {}

  void NoteRequest(const RequestTimes& request);
  std::optional<Actuators> OnReply(TimeNs now, const Sensors& sensors, const Reference& reference);
  // At the time-out, and again every 4 ms. nullopt when the period has its command already and the line is good,
  // and before the first reply.
  std::optional<Actuators> OnTimeout(TimeNs now, const Reference& reference);

  void NoteBlind() { supervisor_.On(SupervisorEvent::kBlind); }
  // Once per period, after NoteRequest.
  void NoteReference(bool follows) {
    supervisor_.On(follows ? SupervisorEvent::kReferenceFollowed : SupervisorEvent::kReferenceHeld);
  }
  const Status& status() const { return supervisor_.status(); }
  const Integrals& integrals() const { return law_.integrals(); }
  void SetIntegrals(const Integrals& integrals) { law_.SetIntegrals(integrals); }
  const ActuatorMonitor& actuator_monitor() const { return actuator_monitor_; }
  bool descends() const { return descent_.begun(); }

 private:
  ModelStep StepAt(TimeNs now) const;
  std::optional<Sensors> Accept(TimeNs now, const Sensors& sensors, bool& newest);
  Actuators Command(TimeNs now, const Sensors* fresh, const Reference& received);
  void SuspectLine();
  // The line loses nothing that could be seen, and is late: more than the period's one command would only fill it.
  bool LineIsSlow() const { return replies_late_ && loss_periods_ == 0; }
  void WatchActuators(const Sensors& sensors, const Reference& reference, bool short_of_thrust);

  ControlLaw law_;
  Actuators hover_;
  MotionTimeline timeline_;
  AcceptedReplies accepted_;
  ReplyMatcher matcher_;
  LagEstimator lag_estimator_;
  SignalScreen screen_;
  SignalScreen screen_before_;  // the last sample
  int damaged_count_ = 0;       // replies in a row that were not used because a signal jumped in them
  Supervisor supervisor_;
  ActuatorMonitor actuator_monitor_;
  ControlledDescent descent_;
  Actuators last_command_;
  TimeNs origin_ns_ = 0;
  TimeNs command_flight_ns_ = 0;  // from its computation to its last bit
  ModelStep period_step_ = 0;     // of the present period's request
  bool has_sample_ = false;
  int line_doubt_periods_ = 0;  // that are still to come
  int examined_count_ = 0;      // replies in the present period
  int loss_periods_ = 0;        // for which a request that got no reply still counts
  bool replies_late_ = false;   // the last one came after a time-out
  bool timed_out_ = false;      // in the present period
  bool refused_ = false;        // the present period's reply has come, and was not used
  bool saturated_ = false;      // the last command wanted more than the actuators have
  bool faulty_ = false;         // an actuator was, at the last sample
  bool answered_ = false;       // the present period's reply has had its command
  bool commanded_ = false;      // the present period has a command
  bool new_sample_ = false;     // since the last step of the integrals
};

}  // namespace tiltproof::firmware
