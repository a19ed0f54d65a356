#include "firmware/builds.h"

#include <array>

#include "firmware/gain_tables.h"
#include "firmware/tolerant/vehicle_dynamics.h"

namespace tiltproof::firmware {
namespace {

// Paper, section 3.
constexpr Actuators kPaperFeedForward = {.f_r_n = 10.2751F, .f_l_n = 10.2799F, .tau_r_nm = 0, .tau_l_nm = 0};

// Inputs of hover of plant/models/tiltrotor_published.sdf, as `tiltproof design-lqr` finds them: with the
// thrusters' weight off their hinges the servos have to hold it.
constexpr Actuators kPublishedFeedForward = {
    .f_r_n = 10.2711796F, .f_l_n = 10.2803541F, .tau_r_nm = -0.0160206049F, .tau_l_nm = -0.0160321965F};

// A round trip takes 0.83 ms at 921600 baud, a command 0.3 ms: one that is sent at the time-out still acts in the
// same step of 4 ms as one that answers a reply in time.
constexpr TimeNs kReplyTimeoutNs = 2 * kNsPerMs;

constexpr Build Tolerant(const char* name, Redundancy redundancy) {
  return {.name = name,
          .gain = &kTiltrotorGain,
          .feed_forward = kPaperFeedForward,
          .checks = ValueChecks::kFiniteAndRange,
          .late_replies = LateReplies::kKept,
          .reply_timeout_ns = kReplyTimeoutNs,
          .command_interval_ns = kModelStepNs,
          .retries_start = true,
          .blind_periods_limit = 5,
          .redundancy = redundancy};
}

constexpr std::array kBuilds = {
    Build{.name = "paper",
          .gain = &kTiltrotorGain,
          .feed_forward = kPaperFeedForward,
          .checks = ValueChecks::kNone,
          .late_replies = LateReplies::kDropped,
          .reply_timeout_ns = kNever,
          .command_interval_ns = kNever,
          .retries_start = false,
          .blind_periods_limit = 0},
    Build{.name = "paper_published",
          .gain = &kTiltrotorPublishedGain,
          .feed_forward = kPublishedFeedForward,
          .checks = ValueChecks::kNone,
          .late_replies = LateReplies::kDropped,
          .reply_timeout_ns = kNever,
          .command_interval_ns = kNever,
          .retries_start = false,
          .blind_periods_limit = 0},
    Tolerant("tolerant", Redundancy::kNone),
    Tolerant("failover", Redundancy::kFailover),
    Tolerant("triplex", Redundancy::kTriplex),
};

}  // namespace

std::span<const Build> Builds() { return kBuilds; }

const Build* FindBuild(std::string_view name) {
  for (const Build& build : kBuilds) {
    if (name == build.name) return &build;
  }
  return nullptr;
}

}  // namespace tiltproof::firmware
