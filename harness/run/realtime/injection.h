// A fault that is injected while a flight in real time goes on: from its text to the nodes, by the command `inject`, and
// into the scenario that is flown.
//
//   Injector injector(options.injections);
//   const auto event = injector.Poll(scenario, running, now, tell);               // in the harness
//   fault.start_ns = KeptBegin(scenario, fault.start_ns, done_until_ns);  // in the node where it acts, which answers it
//
// A command can come late. So the node where the fault acts answers from when on it acts: from the time that the harness
// wants, or from the first control step of which nothing has been done yet. The harness records what the node says.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "harness/dds/messages.h"
#include "harness/run/run_log.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {

// The conductor's interface to the source of injected faults.
struct Injections {
  // The text of a requested fault, once.
  std::function<std::optional<std::string>()> next;
  // The scenario with that fault; throws std::exception that says what is wrong with it.
  std::function<Scenario(const Scenario& scenario, const AddedFault& fault)> add;
  struct Answer {
    bool accepted = false;
    std::string text;  // why not
    faults::FaultSpec fault;
  };
  // Takes the answer to the fault.
  std::function<void(const Answer& answer)> answer;
};

// The longest text of a fault that fits into a command.
inline constexpr std::size_t kInjectedBytesMax = dds::kPathBytesMax - 1;

class Injector {
 public:
  // Null: no fault can be injected.
  explicit Injector(const Injections* injections) : injections_(injections) {}

  // Tells the nodes, and returns the begins that they answer, when all have answered.
  using Tell = std::function<std::vector<TimeNs>(const AddedFault& fault)>;

  // Takes a requested fault, at simulation time `now_ns`: checks it, tells the nodes, adds it to `scenario` as it acts,
  // and answers. Returns the event, at the time of the begin.
  std::optional<RunEvent> Poll(Scenario& scenario, bool running, TimeNs now_ns, const Tell& tell);

 private:
  const Injections* injections_;
  int count_ = 0;  // of what was injected
};

// In a node: the begin that it can keep, which is the one that is wanted, or a later control step. `done_until_ns`: up to
// when it has done its work.
TimeNs KeptBegin(const Scenario& scenario, TimeNs wanted_ns, TimeNs done_until_ns);

}  // namespace tiltproof::harness
