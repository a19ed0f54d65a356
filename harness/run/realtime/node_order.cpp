#include "harness/run/realtime/node_order.h"

#include <cmath>

#include "link/overloaded.h"

namespace tiltproof::harness {
namespace {

constexpr const char* kLeaveBus = "dds.partition";
constexpr const char* kSetClockRate = "clock.drift";
constexpr const char* kJumpClock = "clock.jump";
// Beyond what a fault allows; a clock that stands still or overflows is of no use.
constexpr double kClockMax_ppm = 500'000, kJumpMax_ms = 1e6;

}  // namespace

dds::FaultCommand ToMessage(const NodeOrder& order) {
  dds::FaultCommand message;
  std::visit(Overloaded{[&](const LeaveBus& leave) {
                          message.type = kLeaveBus;
                          message.duration_ns = leave.duration_ns;
                        },
                        [&](const SetClockRate& rate) {
                          message.type = kSetClockRate;
                          message.parameters = {{"ppm", rate.ppm}};
                        },
                        [&](const JumpClock& jump) {
                          message.type = kJumpClock;
                          message.parameters = {{"jump_ms", ToSeconds(jump.by_ns) * 1e3}};
                        }},
             order);
  return message;
}

std::optional<NodeOrder> FromMessage(const dds::FaultCommand& message) {
  if (message.type == kLeaveBus) return LeaveBus{message.duration_ns};
  const auto parameter = [&](std::string_view name) {
    for (const auto& [key, value] : message.parameters)
      if (key == name) return value;
    return 0.0;
  };
  if (message.type == kSetClockRate) {
    const double ppm = parameter("ppm");
    if (std::abs(ppm) <= kClockMax_ppm) return SetClockRate{ppm};
  }
  if (message.type == kJumpClock) {
    const double jump_ms = parameter("jump_ms");
    if (std::abs(jump_ms) <= kJumpMax_ms) return JumpClock{FromSeconds(jump_ms * 1e-3)};
  }
  return std::nullopt;
}

}  // namespace tiltproof::harness
