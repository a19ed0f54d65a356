#include "firmware/sensor_cycle.h"

#include "firmware/frame_sender.h"

namespace tiltproof::firmware {

SensorCycle::SensorCycle(const Build& build, link::Dialect dialect, Port& port)
    : build_(build), dialect_(dialect), port_(port), sensor_reader_(dialect, build.checks, port) {}

void SensorCycle::Start(TimeNs now) {
  port_.Log(now, build_.name);
  SendStart(now);
}

std::optional<ControlItem> SensorCycle::Next(TimeNs now) {
  using Kind = ControlItem::Kind;
  if (const auto sensors = sensor_reader_.TakeReply()) {
    NoteReply(now);
    timeout_ns_ = kNever;
    return ControlItem{.kind = Kind::kSensors, .sensors = *sensors};
  }
  if (now >= timeout_ns_) {
    timeout_ns_ = kNever;
    return ControlItem{.kind = Kind::kTimeout, .sensors = {}};
  }
  // Twice at one instant when a `start` leaves without taking time.
  while (now >= next_request_ns_) {
    const bool missed = sensor_reader_.waiting() && !start_is_fresh_;
    if (missed) NoteMissingReply(now);
    BeginPeriod(now);
    if (missed) return ControlItem{.kind = Kind::kNoSensors, .sensors = {}};
  }
  return std::nullopt;
}

void SensorCycle::SendStart(TimeNs now) {
  next_request_ns_ = SendFrame(port_, now, link::EncodeStart(dialect_, build_.feed_forward));
  start_is_fresh_ = true;
}

void SensorCycle::BeginPeriod(TimeNs now) {
  if (build_.retries_start && !heard_server_ && !start_is_fresh_) {
    SendStart(now);
    return;
  }
  start_is_fresh_ = false;
  sensor_reader_.Request(now);
  do {
    next_request_ns_ += kControlPeriodNs;
  } while (next_request_ns_ <= now);
  timeout_ns_ = build_.reply_timeout_ns == kNever ? kNever : now + build_.reply_timeout_ns;
}

void SensorCycle::NoteReply(TimeNs now) {
  if (!heard_server_) {
    heard_server_ = true;
    port_.Log(now, "first valid reply");
  } else if (blind_periods_ != 0) {
    port_.Log(now, "replies are back");
  }
  blind_periods_ = 0;
  status_.state = SupervisorState::kNormal;
}

void SensorCycle::NoteMissingReply(TimeNs now) {
  if (++blind_periods_ == 1) port_.Log(now, "no valid reply within the period");
  if (heard_server_ && blind_periods_ == build_.blind_periods_limit) {
    status_.state = SupervisorState::kBlind;
    ++status_.failsafe_count;
    port_.Log(now, "fail-safe: blind, holding the last command");
  }
}

}  // namespace tiltproof::firmware
