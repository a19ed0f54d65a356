// Options that everything has that flies many flights through an engine.
//
//   const FlightsOptions options = {.jobs_count = 2, .on_turn = [] { Show(); }};
//   while (!options.is_interrupted()) FlyMore();
#pragma once

#include <atomic>
#include <functional>
#include <string>

namespace tiltproof::harness {

struct FlightsOptions {
  int jobs_count = 1;
  const std::atomic<bool>* interrupted = nullptr;  // ends the flights; may be null
  std::function<void(const std::string& line)> tell = [](const auto&) {};
  std::function<void()> on_turn = [] {};  // about ten times per second, or more often

  bool is_interrupted() const {
    return interrupted != nullptr && interrupted->load(std::memory_order_relaxed);
  }
};

}  // namespace tiltproof::harness
