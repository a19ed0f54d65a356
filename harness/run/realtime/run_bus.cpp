#include "harness/run/realtime/run_bus.h"

#include <unistd.h>

#include "harness/dds/qos.h"
#include "harness/run/run_id.h"

namespace tiltproof::harness {

RunBus::RunBus(const RealtimeOptions& options, const std::function<void()>& wake)
    : bus({.domain = options.place.domain,
           .tag = options.place.tag,
           .interface = options.interface,
           .peers = options.peers,
           .xmit_loss = 0}),
      nodes(bus, wake, wake),
      acks(bus, circle, wake),
      states(bus, circle, wake),
      plant_states(bus, circle, wake) {
  heartbeat_.node_id = "harness-" + options.place.run_id;
  heartbeat_.kind = dds::NodeKind::kHarness;
  heartbeat_.host = HostName();
  heartbeat_.pid = getpid();
  heartbeat_.run_id = options.place.run_id;
  heartbeat_.version = TILTPROOF_VERSION;
}

void RunBus::Beat(std::chrono::steady_clock::time_point now) {
  if (now < next_beat_) return;
  next_beat_ = now + std::chrono::nanoseconds(dds::kHeartbeatPeriodNs);
  ++heartbeat_.sequence;
  heartbeats_.Write(heartbeat_);
}

}  // namespace tiltproof::harness
