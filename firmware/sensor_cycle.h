// Activity 1 of 4 over time: leads the paper's periodic cycle (section 2.1, Figure 4). It decides when to ask
// the server, and tells the control activity the result.
//
//   SensorCycle cycle(build, dialect, port);
//   cycle.Start(now);                                        // power-on
//   for (;;) {                                               // at cycle.wake_ns(), or when bytes have come
//     cycle.Receive(bytes);
//     while (const auto item = cycle.Next(now)) Control(*item);
//   }
//
// Timing. The firmware leads. It sends `start`; when that frame's last bit has left, it sends the first
// request; then it sends one request every 12 ms, counted from the first one (a period that could not begin
// in time begins late, and the grid stays). A valid reply is passed on at once. When none has arrived by the
// next tick, `paper` only asks again; `tolerant` sends a command at the time-out within the period, and still uses
// a reply that comes later.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "firmware/builds.h"
#include "firmware/frame_sender.h"
#include "firmware/port.h"
#include "firmware/sensor_reader.h"
#include "firmware/tolerant/tolerant_control.h"

namespace tiltproof::firmware {

// The input of the control activity: at least one per period.
struct ControlItem {
  enum class Kind : std::uint8_t {
    kSensors,    // a valid reply: a control step is due
    kTimeout,    // none in time: a command is due without
    kRequest,    // one has been sent (LateReplies::kKept only)
    kNoSensors,  // the period has ended without one: only a sign of life
    kBlind       // the same, with which the line counts as blind (Build::blind_periods_limit)
  };
  Kind kind = Kind::kNoSensors;
  Sensors sensors;       // of kSensors
  TimeNs time_ns = 0;    // now
  RequestTimes request;  // of kRequest
};

class SensorCycle {
 public:
  // `build` and `port` must outlive the cycle.
  SensorCycle(const Build& build, link::Dialect dialect, Port& port);

  // Power-on, once.
  void Start(TimeNs now);

  // Bytes from the main line's receiver, in order, in any pieces. Decodes only; Next acts on what has arrived.
  void Receive(std::span<const std::uint8_t> bytes) { sensor_reader_.Receive(bytes); }

  // Does what is due at `now`, which does not decrease, up to the next item for the control activity, and
  // returns that; nullopt when everything is done until wake_ns().
  std::optional<ControlItem> Next(TimeNs now);

  // When to call Next at the latest.
  TimeNs wake_ns() const { return next_request_ns_ < timeout_ns_ ? next_request_ns_ : timeout_ns_; }

 private:
  void SendStart(TimeNs now);
  void BeginPeriod(TimeNs now);
  std::optional<ControlItem> TakeRequest(TimeNs now);
  void NoteReply(TimeNs now);
  ControlItem::Kind NoteMissingReply(TimeNs now);

  const Build& build_;
  Port& port_;
  FrameSender start_sender_;
  SensorReader sensor_reader_;

  TimeNs next_request_ns_ = kNever;
  TimeNs timeout_ns_ = kNever;       // when the current period's time-out expires
  TimeNs origin_ns_ = 0;             // when `start` had left
  bool request_is_fresh_ = false;    // a request has been sent and not been passed on
  bool start_is_fresh_ = false;      // `start` has been sent and no request since
  bool heard_server_ = false;        // a valid reply has arrived
  std::uint32_t blind_periods_ = 0;  // in a row, up to now
};

}  // namespace tiltproof::firmware
