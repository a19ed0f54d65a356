#include "harness/run/firmware_use.h"

#include <algorithm>

namespace tiltproof::harness {

void FirmwareUse::Add(const Span& span) {
  constexpr std::size_t kSpansMax = 10'000;
  if (processors_count < 2 || spans.size() == kSpansMax) return;
  const TimeNs elapsed_ns = span.end_ns - span.begin_ns;
  const double needed = static_cast<double>(processors_count) - kLeftProcessors;
  if (elapsed_ns <= 0 || static_cast<double>(span.run_ns) < needed * static_cast<double>(elapsed_ns)) return;
  spans.push_back(span);
  spans.back().run_ns = std::min(span.run_ns, processors_count * elapsed_ns);
}

OwnLateness::OwnLateness(const FirmwareUse& use, Origin origin) : processors_(use.processors) {
  if (!origin.known()) return;
  for (const FirmwareUse::Span& span : use.spans) {
    if (span.end_ns > origin.boot_time()) {
      if (!total_) total_.emplace().processors_count = use.processors_count;
      total_->run_ns += span.run_ns;
      total_->elapsed_ns += span.end_ns - span.begin_ns;
      total_->processes_max = std::max(total_->processes_max, span.processes_count);
    }
    const LateSpan with_edges{origin.SimulationTime(span.begin_ns) - FirmwareUse::kLookEveryNs,
                              origin.SimulationTime(span.end_ns) + FirmwareUse::kLookEveryNs};
    if (!spans_.empty() && with_edges.begin_ns <= spans_.back().end_ns)
      spans_.back().end_ns = with_edges.end_ns;
    else
      spans_.push_back(with_edges);
  }
}

bool OwnLateness::Explains(const LateSpan& late, std::string_view processors) const {
  return !processors.empty() && processors == processors_ &&
         std::any_of(spans_.begin(), spans_.end(), [&](const LateSpan& own) {
           return own.begin_ns <= late.begin_ns && late.end_ns <= own.end_ns;
         });
}

}  // namespace tiltproof::harness
