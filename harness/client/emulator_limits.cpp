#include "harness/client/emulator_limits.h"

#include <fmt/format.h>

#include <algorithm>

namespace tiltproof::harness {

TimeNs EmulatorLimits::LeftForTurn() const {
  // At least a millisecond: 0 is no limit.
  return std::clamp(kProcessorNsPerSecond - second_cost_ns(), kNsPerMs, kTurnNs);
}

bool EmulatorLimits::CostsTooMuch(TimeNs now, TimeNs used_ns) {
  used_ns_ = std::max(used_ns_, used_ns);
  if (second_cost_ns() >= kProcessorNsPerSecond) return true;
  if (now - second_begin_ >= kNsPerS) {
    second_begin_ = now;
    used_before_ns_ = used_ns_;
  }
  return false;
}

void EmulatorLimits::OnReset(TimeNs now, const std::string& cause) {
  if (resets_count_ > kResetsMax) return;
  if (resets_count_ == 0 || now - resets_begin_ > kResetsWithinNs) {
    resets_begin_ = now;
    resets_count_ = 0;
  }
  ++resets_count_;
  resets_end_ = now;
  last_reset_ = cause;
}

void EmulatorLimits::OnBrokenLimit(TimeNs now, const std::string& what) {
  if (!broken_limit_.empty()) return;
  broken_limit_ = what;
  broken_limit_at_ = now;
}

std::string EmulatorLimits::Broken(const std::function<std::string(TimeNs)>& time_text) const {
  if (!broken_limit_.empty())
    return fmt::format("the firmware sets what no chip does, {}: {}", time_text(broken_limit_at_),
                       broken_limit_);
  if (resets_count_ > kResetsMax)
    return fmt::format(
        "the firmware resets again and again: {} times within {:.6f} s, since {} (limit: {} times within {} "
        "s); the last time it was {}",
        resets_count_, ToSeconds(resets_end_ - resets_begin_), time_text(resets_begin_), kResetsMax,
        kResetsWithinNs / kNsPerS, last_reset_);
  return "";
}

}  // namespace tiltproof::harness
