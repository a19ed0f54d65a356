// The nodes that a real-time run starts itself: `tiltproof node KIND` as child processes, one of each kind.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "harness/process/child_process.h"
#include "harness/run/introduction.h"
#include "harness/run/realtime/realtime_flight.h"

namespace tiltproof::harness {

class NodeProcesses {
 public:
  // `harness`: this process, the only one that they obey. `loss` by node: the share of its packets that a
  // fault lets the network lose.
  NodeProcesses(const Scenario& scenario, const RealtimeOptions& options, const dds::Participant& harness,
                std::map<std::string, double> loss);

  // Starts `plant`, `link`, `client` or `base_station`, `link-b` for one of several clients, or `line-cross`, as node `id`.
  // Throws std::runtime_error.
  void Start(const std::string& role, const std::string& id);
  void StartAll();
  const std::vector<std::string>& names() const { return names_; }

  // Null when it was never started.
  ChildProcess* Find(const std::string& role);
  // The participant of the process that was last started for the role, once it has told it.
  std::optional<dds::Participant> ParticipantOf(const std::string& role);
  // Asks all processes to end, kills those that do not, and reaps them.
  void StopAll();

 private:
  const RealtimeOptions& options_;
  dds::Participant harness_;
  std::map<std::string, double> loss_;
  // The command of a role.
  struct Part {
    std::string kind;                       // of the node
    std::optional<ClientSpec> client = {};  // that it is, or has on its ports
    std::optional<std::string> id = {};     // of one of several clients, or of a line between them
    std::string cable = {};                 // of a line
  };
  std::vector<std::string> names_;
  std::map<std::string, Part> parts_;
  std::map<std::string, std::unique_ptr<ChildProcess>> processes_;
  std::map<std::string, std::unique_ptr<Introduction>> introductions_;
};

}  // namespace tiltproof::harness
