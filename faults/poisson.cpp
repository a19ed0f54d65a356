#include "faults/poisson.h"

#include <algorithm>

namespace tiltproof::faults {

const PoissonEvents::Second& PoissonEvents::Load(std::int64_t number) {
  Second& second = seconds_[static_cast<std::size_t>(number % 2)];
  if (second.number == number) return second;
  second.number = number;
  second.events.clear();
  const std::uint64_t key = KeyOf(stream_, static_cast<std::uint64_t>(number));
  Random random(key);
  double t_s = random.Exponential() / rate_hz_;
  while (t_s < 1.0) {
    second.events.push_back(
        {BootTime(number * kNsPerS + static_cast<TimeNs>(t_s * 1e9)), KeyOf(key, second.events.size())});
    t_s += random.Exponential() / rate_hz_;
  }
  return second;
}

void PoissonEvents::In(BootTime from_ns, BootTime to_ns, std::vector<Event>& events) {
  if (!(rate_hz_ > 0.0)) return;
  from_ns = std::max(from_ns, BootTime());
  if (to_ns <= from_ns) return;
  for (std::int64_t number = from_ns.ns() / kNsPerS; number <= (to_ns - 1).ns() / kNsPerS; ++number) {
    const auto& all = Load(number).events;
    auto it = std::lower_bound(all.begin(), all.end(), from_ns,
                               [](const Event& event, BootTime time) { return event.time_ns < time; });
    for (; it != all.end() && it->time_ns < to_ns; ++it) events.push_back(*it);
  }
}

}  // namespace tiltproof::faults
