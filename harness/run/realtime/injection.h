// A fault that somebody injects while a flight in real time goes on: from his text to the nodes, as ports of the command
// `inject`, and into the scenario that is flown.
//
//   Injector injector(options.injections);
//   const auto done = injector.Turn(scenario, running, now, [&](const auto& ports) { Send(ports); });  // in the harness
//   const AddedFault fault = FromPorts(command.ports);                                                 // in a node
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "harness/dds/messages.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {

// What the conductor needs of whoever lets people inject.
struct Injections {
  // The text of a fault that somebody wants, once.
  std::function<std::optional<std::string>()> next;
  // The scenario with that fault; throws std::exception that says what is wrong with it.
  std::function<Scenario(const Scenario& scenario, const AddedFault& fault)> add;
  struct Answer {
    bool accepted = false;
    std::string text;  // why not
    faults::FaultSpec fault;
  };
  // What became of it.
  std::function<void(const Answer& answer)> answer;
};

// What fits into one port.
inline constexpr std::size_t kInjectedBytesMax = dds::kPathBytesMax - 1;

class Injector {
 public:
  // Null: nobody can inject.
  explicit Injector(const Injections* injections) : injections_(injections) {}

  // Takes what somebody wants, at simulation time `now_ns`: checks it, tells the nodes by `tell`, which returns when all
  // have it, adds it to `scenario`, and answers. Returns what was done, for the events.
  std::optional<std::string> Turn(Scenario& scenario, bool running, TimeNs now_ns,
                                  const std::function<void(const std::vector<dds::Port>& ports)>& tell);

 private:
  const Injections* injections_;
  int count_ = 0;  // of what was injected
};

AddedFault FromPorts(const std::vector<dds::Port>& ports);

}  // namespace tiltproof::harness
