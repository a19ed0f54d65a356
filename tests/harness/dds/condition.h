// Waiting in tests: until something holds, woken by callbacks, with a limit.
//
//   Condition condition;
//   dds::Subscriber<dds::Score> scores(bus, condition.Waker());
//   ASSERT_TRUE(condition.Wait([&] { return scores.MatchedCount() == 1; }));
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>

namespace tiltproof::dds {

class Condition {
 public:
  static constexpr std::chrono::seconds kLimit{20};

  std::function<void()> Waker() {
    return [this] {
      const std::lock_guard lock(mutex_);
      woken_ = true;
      changed_.notify_all();
    };
  }

  // Asks `holds` whenever woken, and every 10 ms besides, for what has no callback.
  bool Wait(const std::function<bool()>& holds, std::chrono::nanoseconds limit = kLimit) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!holds()) {
      if (std::chrono::steady_clock::now() > end) return false;
      std::unique_lock lock(mutex_);
      changed_.wait_for(lock, std::chrono::milliseconds(10), [this] { return woken_; });
      woken_ = false;
    }
    return true;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool woken_ = false;
};

}  // namespace tiltproof::dds
