// A lockstep flight with the line, the plant and the firmware each in a process of its own: the same conductor,
// the same trace hash, and proof that nothing hides in shared memory.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "harness/client/make_client.h"
#include "harness/run/bus_place.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

enum class Transport : std::uint8_t { kDds, kSocket };

struct DistributedOptions {
  Transport transport = Transport::kDds;
  std::string program;        // this program, to start the processes with
  std::string scenario_yaml;  // the resolved scenario
  ClientSource firmware;
  BusPlace place;  // over DDS
  std::atomic<std::int64_t>* progress_ns = nullptr;
  const std::atomic<bool>* interrupted = nullptr;
};

// Throws std::runtime_error when the processes cannot be started.
RunLog FlyDistributed(const Scenario& scenario, const DistributedOptions& options);

}  // namespace tiltproof::harness
