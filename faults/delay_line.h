// Values of the past, for models that delay a signal.
//
//   DelayLine<float> line(FromSeconds(0.02));
//   line.Push(FromSeconds(1.00), 3.5F);
//   line.Push(FromSeconds(1.02), 3.7F);
//   const float value = line.Delayed();  // 3.5
#pragma once

#include <deque>

#include "link/check.h"
#include "link/time.h"

namespace tiltproof::faults {

template <class Value>
class DelayLine {
 public:
  explicit DelayLine(TimeNs delay_ns) : delay_ns_(delay_ns) {}

  // Times do not descend.
  void Push(TimeNs t, Value value) {
    past_.push_back({t, value});
    while (past_.size() > 1 && past_[1].time_ns <= t - delay_ns_) past_.pop_front();
  }
  // The last value at or before the delay ago, or the first one of all as long as there is none. After a Push.
  Value Delayed() const {
    Check(!past_.empty(), "a delayed value was pushed before");
    return past_.front().value;
  }

 private:
  struct Entry {
    TimeNs time_ns;
    Value value;
  };
  TimeNs delay_ns_;
  std::deque<Entry> past_;
};

}  // namespace tiltproof::faults
