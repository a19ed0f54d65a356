#include "firmware/sensor_cycle.h"

namespace tiltproof::firmware {

SensorCycle::SensorCycle(const Build& build, link::Dialect dialect, Port& port)
    : build_(build),
      port_(port),
      start_sender_(dialect, port),
      sensor_reader_(dialect, build.checks, build.late_replies, port) {}

void SensorCycle::Start(TimeNs now) {
  port_.Log(now, build_.name);
  SendStart(now);
}

std::optional<ControlItem> SensorCycle::Next(TimeNs now) {
  using Kind = ControlItem::Kind;
  if (request_is_fresh_) return TakeRequest(now);
  if (const auto sensors = sensor_reader_.TakeReply()) {
    NoteReply(now);
    return ControlItem{.kind = Kind::kSensors, .sensors = *sensors, .time_ns = now, .request = {}};
  }
  if (now >= timeout_ns_) {
    const TimeNs again_ns =
        build_.command_interval_ns == kNever ? kNever : timeout_ns_ + build_.command_interval_ns;
    timeout_ns_ = again_ns < next_request_ns_ ? again_ns : kNever;
    return ControlItem{.kind = Kind::kTimeout, .sensors = {}, .time_ns = now, .request = {}};
  }
  // Twice at one instant when a `start` leaves without taking time.
  while (now >= next_request_ns_) {
    const bool missed = sensor_reader_.waiting() && !start_is_fresh_;
    const Kind missing = missed ? NoteMissingReply(now) : Kind::kNoSensors;
    BeginPeriod(now);
    if (missed) return ControlItem{.kind = missing, .sensors = {}, .time_ns = now, .request = {}};
  }
  return TakeRequest(now);
}

std::optional<ControlItem> SensorCycle::TakeRequest(TimeNs now) {
  if (!request_is_fresh_) return std::nullopt;
  request_is_fresh_ = false;
  return ControlItem{
      .kind = ControlItem::Kind::kRequest,
      .sensors = {},
      .time_ns = now,
      .request = {.origin_ns = origin_ns_, .begin_ns = now, .sent_ns = sensor_reader_.sent_ns()}};
}

void SensorCycle::SendStart(TimeNs now) {
  next_request_ns_ = start_sender_.Send(now, link::EncodeStart(start_sender_.dialect(), build_.feed_forward));
  origin_ns_ = next_request_ns_;
  start_is_fresh_ = true;
}

void SensorCycle::BeginPeriod(TimeNs now) {
  if (build_.retries_start && !heard_server_ && !start_is_fresh_) {
    SendStart(now);
    return;
  }
  start_is_fresh_ = false;
  sensor_reader_.Request(now);
  request_is_fresh_ = build_.late_replies == LateReplies::kKept;
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
}

ControlItem::Kind SensorCycle::NoteMissingReply(TimeNs now) {
  if (++blind_periods_ == 1) port_.Log(now, "no valid reply within the period");
  if (!heard_server_ || blind_periods_ != build_.blind_periods_limit) return ControlItem::Kind::kNoSensors;
  port_.Log(now, "fail-safe: blind");
  return ControlItem::Kind::kBlind;
}

}  // namespace tiltproof::firmware
