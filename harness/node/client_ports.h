// Serial ports of a client node, and the time of a flight on its host.
//
//   const ClientPorts own = ClientPortsOf(ports, options.cable, scenario, place);
//   own.main;        // "/dev/pts/3", which the link node offers; or this node's end of a cable, "/dev/ttyUSB0"
//   own.reference;   // "" when its cable has no line for references
//   own.lines;       // to other boards, in the order of Scenario::line_ends_of()
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "harness/node/node.h"
#include "harness/node/origin_follower.h"
#include "harness/run/realtime/client_parts.h"
#include "harness/scenario/client_spec.h"

namespace tiltproof::harness {

struct ClientPorts {
  std::string main, reference;
  std::vector<std::string> lines = {};
};

// Throws std::runtime_error when its cables lack a line to another board.
inline ClientPorts ClientPortsOf(const Ports& offered, const std::optional<SerialBoard>& cable,
                                 const Scenario& scenario, std::size_t place) {
  ClientPorts own;
  if (cable)
    own = {.main = cable->device, .reference = cable->reference_device};
  else
    own = {.main = FindPort(offered, PartName(scenario, "client", place)),
           .reference = FindPort(offered, PartName(scenario, "client_reference", place))};
  for (const std::string& line : LinesOf(scenario, place)) {
    if (!cable) {
      own.lines.push_back(FindPort(offered, LinePortName(line, scenario.client_id(place))));
      continue;
    }
    const auto device = cable->line_devices.find(line);
    if (device == cable->line_devices.end())
      throw std::runtime_error(
          fmt::format("no cable of the line '{0}': add ,{0}=DEV to the --cable of this node, and its other "
                      "end to that of the "
                      "line's node",
                      line));
    own.lines.push_back(device->second);
  }
  return own;
}

// Calls `found` with t = 0 by this node's clock: as the plant says it, whose clock this host shares; or, at the end of a
// cable from another host, by what the plant publishes, again when the estimate changes.
class OriginWatch {
 public:
  using Found = std::function<void(Origin)>;

  OriginWatch(NodeServices& services, bool other_host, Found found)
      : services_(services), found_(std::move(found)) {
    if (other_host)
      motions_.emplace(services.bus(), services.members(),
                       InLoop(services.loop(), alive_, [this] { OnMotions(); }));
    else
      states_.emplace(services.bus(), services.members(),
                      InLoop(services.loop(), alive_, [this] { OnStates(); }));
  }

 private:
  void OnStates() {
    for (const auto& state : states_->Take())
      // Only the plant's state has it; perhaps only the last state has arrived.
      if (state.run_id == services_.run_id() && state.origin_ns != 0)
        found_(Origin(BootTime(state.origin_ns)));
  }
  void OnMotions() {
    const BootTime now = services_.clock().Now();
    for (const auto& motion : motions_->Take())
      if (motion.run_id == services_.run_id() && follower_.Hear(now, motion.time_ns))
        found_(follower_.origin());
  }

  NodeServices& services_;
  Found found_;
  OriginFollower follower_;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  std::optional<dds::Subscriber<dds::RunState>> states_;
  std::optional<dds::Subscriber<dds::PlantState>> motions_;
};

}  // namespace tiltproof::harness
