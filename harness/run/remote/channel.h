// Ordered messages in both directions between the harness and one of its processes in a lockstep flight.
//
// Two kinds: a unix socket (the fast one) and Cyclone DDS (the one that crosses hosts). Exactly one side
// speaks at a time, so neither needs flow control.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "harness/dds/bus.h"
#include "link/time.h"

namespace tiltproof::harness {

// The other side is gone, or has been silent for too much of its own time (harness/process/own_time.h).
struct ChannelLost : std::runtime_error {
  ChannelLost(bool silent_in, const std::string& text) : std::runtime_error(text), silent(silent_in) {}
  bool silent;  // it may still be there
};

// The error when no answer arrives.
inline ChannelLost Silent(bool stopped_itself) {
  return {true,
          stopped_itself ? "the other process has stopped itself" : "the other process does not answer"};
}

class Channel {
 public:
  virtual ~Channel() = default;
  virtual void Send(std::span<const std::uint8_t> message) = 0;
  // Waits for the next message, at most `limit_ns` of the other side's own time. Throws ChannelLost.
  virtual std::vector<std::uint8_t> Receive(TimeNs limit_ns) = 0;
};

// Over one end of a connected stream socket, which it owns. `peer`: the process at the other end; -1:
// unknown.
std::unique_ptr<Channel> MakeUnixChannel(int socket, pid_t peer = -1);

// The bus of a lockstep flight. A stopped process remains a member for an hour. That a process has ended is
// detected by other means.
dds::BusConfig LockstepBus(int domain, const std::string& run_id);

// Over the bus, in a node: to the harness of that run, which has that participant.
std::unique_ptr<Channel> MakeDdsChannel(dds::Bus& bus, const std::string& run_id, const std::string& node_id,
                                        const dds::Participant& harness);

// Over the bus, in the harness: to all of the run's nodes, once they are there. Throws ChannelLost.
struct DdsPeer {
  std::string node_id;
  pid_t pid = -1;
  int pidfd = -1;  // readable when its process has ended. Not owned
  dds::Participant participant{};
};
std::vector<std::unique_ptr<Channel>> MakeDdsChannels(dds::Bus& bus, const std::string& run_id,
                                                      const std::vector<DdsPeer>& peers);

}  // namespace tiltproof::harness
