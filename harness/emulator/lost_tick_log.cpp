#include "harness/emulator/lost_tick_log.h"

#include <algorithm>

namespace tiltproof::harness {

std::vector<LostTickLog::Span> LostTickLog::Take() {
  using lockstep::RealtimeBoard;
  const std::uint64_t count = board_.lost_tick_count;
  const std::uint64_t oldest = count - std::min(count, RealtimeBoard::kLostTicksKept);
  std::vector<Span> spans;
  const auto add = [&spans, this](Span span) {
    const bool held = std::any_of(held_.begin(), held_.end(), [&](const Span& one) {
      return span.begin_ns <= one.end_ns && one.begin_ns <= span.end_ns;
    });
    if (held) return;
    if (!spans.empty() && span.begin_ns <= spans.back().end_ns) {
      spans.back().begin_ns = std::min(spans.back().begin_ns, span.begin_ns);
      spans.back().end_ns = std::max(spans.back().end_ns, span.end_ns);
    } else {
      spans.push_back(span);
    }
  };
  for (std::uint64_t next = std::max(taken_, oldest); next < count; ++next) {
    const auto& tick = board_.lost_ticks[next % RealtimeBoard::kLostTicksKept];
    Span span{tick.before_ns, tick.at_ns};
    if (next == oldest && oldest > taken_ && taken_ > 0)
      span.begin_ns = std::min(span.begin_ns, last_end_ns_);
    last_end_ns_ = span.end_ns;
    add(span);
  }
  taken_ = count;
  return spans;
}

}  // namespace tiltproof::harness
