#include "harness/client/overrun_rows.h"

#include <fmt/format.h>

#include <utility>

namespace tiltproof::harness {
namespace {

// Bytes lost further apart than this are different stories.
constexpr TimeNs kGap = 24 * kNsPerMs;

}  // namespace

std::optional<DeviceEvent> OverrunRows::Take(BootTime at) {
  std::optional<DeviceEvent> before;
  if (count_ > 0 && at - last_ > kGap) before = End();
  if (count_++ == 0) first_ = at;
  last_ = at;
  return before;
}

std::optional<DeviceEvent> OverrunRows::End() {
  const std::int64_t count = std::exchange(count_, 0);
  if (count == 0) return std::nullopt;
  return DeviceEvent{.time_ns = first_,
                     .fault = std::nullopt,
                     .kind = kOverrunEvent,
                     .text = fmt::format("{} line: {} byte{} lost within {:.3f} ms", line_, count,
                                         count == 1 ? "" : "s", ToSeconds(last_ - first_) * 1e3),
                     .overruns_count = count};
}

}  // namespace tiltproof::harness
