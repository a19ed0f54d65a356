#include "firmware/flight_application.h"

#include <algorithm>

#include "firmware/frame_sender.h"

namespace tiltproof::firmware {

FlightApplication::FlightApplication(const Build& build, link::Dialect dialect, Port& port)
    : build_(build),
      dialect_(dialect),
      port_(port),
      sensor_reader_(dialect, build.checks, port),
      control_law_(*build.gain, build.feed_forward),
      actuator_writer_(dialect, port),
      reference_receiver_(build.checks) {}

TimeNs FlightApplication::Start(TimeNs now) {
  port_.Log(now, build_.name);
  SendStart(now);
  return Tick(now);
}

void FlightApplication::Receive(Uart uart, std::span<const std::uint8_t> bytes) {
  if (uart == Uart::kMain) {
    sensor_reader_.Receive(bytes);
  } else {
    reference_receiver_.Receive(bytes);
  }
}

TimeNs FlightApplication::Tick(TimeNs now) {
  if (const auto sensors = sensor_reader_.TakeReply()) {
    Control(now, *sensors);
  }
  if (now >= reply_timeout_ns_) {
    reply_timeout_ns_ = kNever;
    actuator_writer_.Repeat(now);
  }
  // Twice at one instant when a `start` leaves without taking time.
  while (now >= next_request_ns_) {
    BeginPeriod(now);
  }
  return std::min(next_request_ns_, reply_timeout_ns_);
}

void FlightApplication::SendStart(TimeNs now) {
  next_request_ns_ = SendFrame(port_, now, link::EncodeStart(dialect_, build_.feed_forward));
  start_is_fresh_ = true;
}

void FlightApplication::BeginPeriod(TimeNs now) {
  if (sensor_reader_.waiting() && !start_is_fresh_) NoteMissingReply(now);
  if (build_.retries_start && !heard_server_ && !start_is_fresh_) {
    SendStart(now);
    return;
  }
  start_is_fresh_ = false;
  sensor_reader_.Request(now);
  do {
    next_request_ns_ += kControlPeriodNs;
  } while (next_request_ns_ <= now);
  reply_timeout_ns_ = build_.reply_timeout_ns == kNever ? kNever : now + build_.reply_timeout_ns;
}

void FlightApplication::Control(TimeNs now, const Sensors& sensors) {
  NoteReply(now);
  reply_timeout_ns_ = kNever;
  actuator_writer_.Write(now, control_law_.Step(sensors, reference_receiver_.Current(sensors)));
}

void FlightApplication::NoteReply(TimeNs now) {
  if (!heard_server_) {
    heard_server_ = true;
    port_.Log(now, "first valid reply");
  } else if (blind_periods_ != 0) {
    port_.Log(now, "replies are back");
  }
  blind_periods_ = 0;
  status_.state = SupervisorState::kNormal;
}

void FlightApplication::NoteMissingReply(TimeNs now) {
  if (++blind_periods_ == 1) port_.Log(now, "no valid reply within the period");
  if (heard_server_ && blind_periods_ == build_.blind_periods_limit) {
    status_.state = SupervisorState::kBlind;
    ++status_.failsafe_count;
    port_.Log(now, "fail-safe: blind, holding the last command");
  }
}

}  // namespace tiltproof::firmware
