// The last replies that were believed, to tell one that comes once more.
//
//   AcceptedReplies replies;
//   if (!replies.HasOlder(sensors)) replies.Add(sensors);
//
// Two samples of a moving vehicle never agree in all 16 signals to the last bit. Of a vehicle at rest they do: a
// reply that equals the latest one says nothing, one that equals an older one and not the latest is stale.
#pragma once

#include <array>
#include <cstddef>

#include "firmware/signals.h"

namespace tiltproof::firmware {

class AcceptedReplies {
 public:
  bool HasOlder(const Sensors& sensors) const {
    if (count_ == 0 || sensors == Back(0)) return false;
    for (std::size_t age = 1; age < count_; ++age)
      if (sensors == Back(age)) return true;
    return false;
  }

  void Add(const Sensors& sensors) {
    newest_ = (newest_ + 1) % kCount;
    replies_[newest_] = sensors;
    if (count_ < kCount) ++count_;
  }

 private:
  static constexpr std::size_t kCount = 16;  // 0.2 s
  const Sensors& Back(std::size_t age) const { return replies_[(newest_ + kCount - age) % kCount]; }

  std::array<Sensors, kCount> replies_{};
  std::size_t newest_ = 0, count_ = 0;
};

}  // namespace tiltproof::firmware
