// The firmware under test as the conductor sees it: bytes, times and a status, nothing else.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>

#include "link/time.h"

namespace tiltproof::harness {

enum class Uart : std::uint8_t { kMain = 0, kReference = 1 };

struct ClientStatus {
  std::uint32_t supervisor_state = 0;
  std::uint32_t failsafe_count = 0;
};

// What a client may call while it runs. Times are nanoseconds since power-on.
struct ClientHost {
  std::function<TimeNs(Uart uart, TimeNs now, std::span<const std::uint8_t> bytes)> transmit;
  std::function<void(TimeNs now, std::string_view text)> log;
};

// Lockstep (see firmware/tiltproof_client.h for the rules): each of Start and Grant runs the client at one
// instant and returns the time until which it waits.
class Client {
 public:
  virtual ~Client() = default;
  virtual TimeNs Start(TimeNs now) = 0;
  virtual void Receive(Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) = 0;
  virtual TimeNs Grant(TimeNs now) = 0;
  virtual TimeNs Reset(TimeNs now) = 0;
  virtual std::optional<ClientStatus> Status() = 0;
};

}  // namespace tiltproof::harness
