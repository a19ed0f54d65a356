// The harness on the bus during a run: what it says to the nodes, and what it hears of them.
//
//   RunBus bus(options, wake);
//   bus.circle.Admit(member.participant, member.id);  // from here on it is heard
//   bus.commands.Write(command);
//   for (auto& ack : bus.acks.Take()) ...
//   bus.Beat(SteadyClock::now());                     // on every turn
#pragma once

#include <chrono>
#include <functional>

#include "harness/dds/bus.h"
#include "harness/run/realtime/realtime_flight.h"

namespace tiltproof::harness {

struct RunBus {
  // `wake` is called, in a thread of DDS, when something has come. Throws as dds::Bus does.
  RunBus(const RealtimeOptions& options, const std::function<void()>& wake);

  // Says that the harness lives, when it is time.
  void Beat(std::chrono::steady_clock::time_point now);

  dds::Bus bus;
  dds::Circle circle;  // the members, once they are adopted: only they take part in the run
  dds::Publisher<dds::RunScenario> scenarios{bus};
  dds::Publisher<dds::RunCommand> commands{bus};
  dds::Publisher<dds::FaultCommand> fault_commands{bus};
  dds::Subscriber<dds::Heartbeat> nodes;
  dds::Subscriber<dds::RunAck> acks;
  dds::Subscriber<dds::RunState> states;
  dds::Subscriber<dds::PlantState> plant_states;

 private:
  dds::Publisher<dds::Heartbeat> heartbeats_{bus};
  dds::Heartbeat heartbeat_;
  std::chrono::steady_clock::time_point next_beat_;
};

}  // namespace tiltproof::harness
