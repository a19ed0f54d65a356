// The time for which a fault has been active, for models that depend on it: a drift, an oscillation.
//
// It counts from the first sample or step in the fault's active time. It starts again after every sample or step
// outside: with `period_s` in each period, with `when` each time that the condition holds again. A sample
// in the active time that the trigger leaves out counts.
//
//   ActiveTime time;
//   const std::optional<TimeNs> elapsed_ns = time.At(context);  // in Act and in Pass, for each sample or step
#pragma once

#include <optional>

#include "faults/model.h"

namespace tiltproof::faults {

class ActiveTime {
 public:
  // Nothing outside the active time.
  std::optional<TimeNs> At(const SampleContext& context) {
    return At(context.activity.Contains(context.time_ns), context.period_ns);
  }
  std::optional<TimeNs> At(const StepContext& context) {
    return At(context.activity.Contains(context.time_ns), context.step_ns);
  }

 private:
  std::optional<TimeNs> At(bool active, TimeNs since_previous_ns) {
    if (!active)
      elapsed_ns_.reset();
    else
      elapsed_ns_ = elapsed_ns_ ? *elapsed_ns_ + since_previous_ns : 0;
    return elapsed_ns_;
  }

  std::optional<TimeNs> elapsed_ns_;
};

}  // namespace tiltproof::faults
