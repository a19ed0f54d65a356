// The real-time conductor: flies one scenario by the clock on the wall, its parts in nodes, on real serial
// ports.
//
// It leads the nodes through a run (prepare, arm, start, stop, release), carries out faults on nodes, checks
// that all nodes are alive, and gathers their logs into the same RunLog as the lockstep conductor. It is
// never in the control loop, which runs through the ports between plant, link and firmware.
//
// Nodes are child processes that it starts itself, on their own domain and tag; or, attached, nodes that run
// already, here or on other hosts.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "harness/dds/messages.h"
#include "harness/run/bus_place.h"
#include "harness/run/realtime/injection.h"
#include "harness/run/run_log.h"
#include "harness/scenario/client_spec.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

struct RealtimeOptions {
  std::string program;              // this program, to start nodes with
  std::string scenario_yaml;        // the resolved scenario
  std::vector<ClientSpec> clients;  // in the scenario's order; with `attach` the attached nodes decide

  bool attach = false;
  BusPlace place;  // attached: where the nodes are
  std::string interface;
  std::vector<std::string> peers;

  // Scores the flight. The harness adds the run's id and publishes the score on the bus.
  std::function<dds::Score(const RunLog&)> score;
  const Injections* injections = nullptr;  // null: injection is off
  std::atomic<std::int64_t>* progress_ns = nullptr;
  const std::atomic<bool>* interrupted = nullptr;
};

// The domain and tag on which nodes that were started by hand find each other.
inline constexpr int kAttachDomain = 1;
inline constexpr const char* kAttachTag = "tiltproof";

// Flies to the end, or to what ends it early. Throws std::runtime_error when it cannot even begin: the text
// says why. This is a failure of the harness, not of the firmware.
RunLog FlyRealtime(const Scenario& scenario, const plant::VehicleModel& model,
                   const RealtimeOptions& options);

}  // namespace tiltproof::harness
