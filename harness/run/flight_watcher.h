// Who is told of a lockstep flight while it is flown: a page that shows it. Nothing in the flight depends on it,
// and it must not wait for anything.
//
//   FlightWatcher watcher;
//   watcher.on_row = [&](std::span<const double> row) { ring.Append(row); };
//   options.watcher = &watcher;
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

namespace tiltproof::harness {

struct FlightWatcher {
  // Each row of the trace (TraceLayout) as it is logged; without watched variables, which come later.
  std::function<void(std::span<const double> row)> on_row = [](auto) {};
  // The state of a client's supervisor, whenever it was looked at.
  std::function<void(std::size_t client, std::uint32_t state)> on_state = [](auto, auto) {};
};

}  // namespace tiltproof::harness
