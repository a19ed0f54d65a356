// When the processes of a firmware had the processors of this machine nearly to themselves, and which lateness that
// explains.
//
//   FirmwareUse use{.processors = "a boot 0-1", .processors_count = 2};
//   use.Add({BootTime(0), BootTime(200 * kNsPerMs), 380 * kNsPerMs, 9});   // 380 ms of 400
//   const OwnLateness own(use, Origin(BootTime(0)));
//   const bool by_firmware = own.Explains({12 * kNsPerMs, 20 * kNsPerMs}, "a boot 0-1");
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "harness/run/run_log.h"
#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::harness {

// As the firmware's node looked at it, one look after the other.
struct FirmwareUse {
  static constexpr TimeNs kLookEveryNs = 200 * kNsPerMs;
  // The program may keep a processor busy, and the harness has the others: only a firmware that leaves less than this
  // counts. On a machine with one processor none does.
  static constexpr double kLeftProcessors = 0.5;

  struct Span {
    BootTime begin_ns{}, end_ns{};
    TimeNs run_ns = 0;  // of all its processes, on all processors
    std::int64_t processes_count = 0;
    TILTPROOF_FIELDS(begin_ns, end_ns, run_ns, processes_count)
  };

  // Keeps the span if the firmware had the processors nearly to itself.
  void Add(const Span& span);

  std::string processors = {};  // as OwnProcessors() has them
  std::int64_t processors_count = 1;
  std::vector<Span> spans = {};
  TILTPROOF_FIELDS(processors, processors_count, spans)
};

class OwnLateness {
 public:
  OwnLateness(const FirmwareUse& use, Origin origin);

  // True if the firmware had the processors from the begin to the end of the lateness, which is that of a node with
  // `processors`. A burst begins and ends between two looks, so the look before and the one after belong to it.
  bool Explains(const LateSpan& late, std::string_view processors) const;
  const std::optional<ProcessorUse>& total() const { return total_; }

 private:
  std::string processors_;
  std::vector<LateSpan> spans_;  // apart, in order
  std::optional<ProcessorUse> total_;
};

}  // namespace tiltproof::harness
