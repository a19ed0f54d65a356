// Messages in order, both ways, between the harness and one of its processes in a lockstep flight.
//
// Two kinds: a unix socket (the fast one) and Cyclone DDS (the one that crosses hosts). Exactly one side
// speaks at a time, so neither needs flow control.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "link/time.h"

namespace tiltproof::harness {

// The other side is gone, or silent for too long.
struct ChannelLost : std::runtime_error {
  ChannelLost(bool silent_in, const std::string& text) : std::runtime_error(text), silent(silent_in) {}
  bool silent;  // it may still be there
};

class Channel {
 public:
  virtual ~Channel() = default;
  virtual void Send(std::span<const std::uint8_t> message) = 0;
  // Waits for the next message, at most `limit_ns` of wall-clock time. Throws ChannelLost.
  virtual std::vector<std::uint8_t> Receive(TimeNs limit_ns) = 0;
};

// Over one end of a connected stream socket, which it owns.
std::unique_ptr<Channel> MakeUnixChannel(int socket);

// Which side of a channel over DDS this process is.
enum class ChannelSide : std::uint8_t { kHarness, kNode };
struct DdsChannelConfig {
  int domain = 0;
  std::string run_id;   // also the tag that isolates the run
  std::string node_id;  // the node's, on both sides
  ChannelSide side = ChannelSide::kHarness;
  int peer_pidfd = -1;  // readable when the other process has ended; -1: unknown. Not owned
};
// Returns when both directions are matched, or throws ChannelLost.
std::unique_ptr<Channel> MakeDdsChannel(const DdsChannelConfig& config);

}  // namespace tiltproof::harness
