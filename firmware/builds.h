// The builds of the flight firmware: one code, told apart by the values below and by nothing else.
//
//   paper            does what the paper says and no more
//   paper_published  the same with gain and feed-forward designed on the as-published model
//                    (plant/models/tiltrotor_published.sdf)
//   tolerant         takes no value on trust and rides out missing replies
//   failover         tolerant, as one of two boards of which one claims the vehicle
//   triplex          tolerant, as one of three boards that all fly it
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/control_law.h"
#include "firmware/failover/redundant_board.h"
#include "firmware/sensor_reader.h"
#include "link/time.h"

namespace tiltproof::firmware {

struct Build {
  const char* name;
  const Gain* gain;
  Actuators feed_forward;  // inputs of hover
  ValueChecks checks;      // of sensors and references
  // kKept: commands take the line's faults into account (firmware/tolerant/tolerant_control.h).
  LateReplies late_replies;

  // No valid reply that long after a request: the command is computed without. kNever: no actuators in such a
  // period.
  TimeNs reply_timeout_ns;
  // From there on to the end of the period, further commands may be sent so often; kNever: none.
  TimeNs command_interval_ns;
  // Until the first valid reply, each period begins with `start` again, since the server may not have heard
  // the one before.
  bool retries_start;
  // Periods in a row without valid reply, after a first one, that count as one entry of the fail-safe state;
  // 0: there is none.
  std::uint32_t blind_periods_limit;
  Redundancy redundancy = Redundancy::kNone;
};

std::span<const Build> Builds();

// nullptr when there is no such build.
const Build* FindBuild(std::string_view name);

}  // namespace tiltproof::firmware
