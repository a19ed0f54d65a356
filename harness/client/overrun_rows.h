// Bytes that a receiver lost since the one before had not been read. What is lost in a row is one event, not one for each
// byte.
//
//   OverrunRows rows("main");
//   if (const auto event = rows.Take(at)) host.event(*event);   // of the row before
//   if (const auto event = rows.End()) host.event(*event);      // at the end of the flight
#pragma once

#include <optional>
#include <string>

#include "harness/client/client.h"

namespace tiltproof::harness {

class OverrunRows {
 public:
  explicit OverrunRows(std::string line) : line_(std::move(line)) {}

  std::optional<DeviceEvent> Take(BootTime at);
  std::optional<DeviceEvent> End();

 private:
  std::string line_;
  std::int64_t count_ = 0;  // of the present row
  BootTime first_, last_;
};

}  // namespace tiltproof::harness
