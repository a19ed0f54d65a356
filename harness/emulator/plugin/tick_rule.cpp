#include "harness/emulator/plugin/tick_rule.h"

#include <algorithm>

namespace tiltproof::qemu {

std::optional<TickRule::Span> TickRule::Tick(const Now& now) {
  // QEMU delivers ticks that are overdue all at once: less apart than any firmware's are.
  constexpr std::int64_t kAtOnceNs = 100'000;
  const std::int64_t gap_ns = now.at_ns - before_.at_ns;
  const bool idle = 2 * (now.run_ns - before_.run_ns) < std::max(gap_ns, kAtOnceNs);
  const bool at_once = gap_ns < kAtOnceNs;
  std::optional<Span> lost;
  // After a standstill of the whole emulator the tick that is pending was overdue, too.
  if (now.pending && idle) lost = {at_once ? idle_since_ns_ : before_.at_ns, now.at_ns};
  if (!idle)
    idle_since_ns_ = now.at_ns;
  else if (!at_once)
    idle_since_ns_ = before_.at_ns;
  before_ = now;
  return lost;
}

}  // namespace tiltproof::qemu
