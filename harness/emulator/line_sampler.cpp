#include "harness/emulator/line_sampler.h"

namespace tiltproof::harness {

void LineSampler::Put(TimeNs begin_ns, std::uint8_t byte, double sender_bit_ns) {
  sent_.push_back({static_cast<double>(begin_ns), sender_bit_ns, byte});
}

bool LineSampler::Level(double at_ns) const {
  for (const Sent& sent : sent_)
    if (at_ns >= sent.begin_ns && at_ns < sent.end_ns())
      return sent.Bit(static_cast<int>((at_ns - sent.begin_ns) / sent.bit_ns));
  return true;  // idle
}

std::optional<LineSampler::Edge> LineSampler::FallingEdge() const {
  for (const Sent& sent : sent_)
    for (int i = 0; i < 9; ++i) {
      const double at_ns = sent.begin_ns + i * sent.bit_ns;
      const bool falls = !sent.Bit(i) && (i == 0 || sent.Bit(i - 1));
      if (falls && at_ns >= looks_from_ns_) return Edge{at_ns, sent.bit_ns};
    }
  return std::nullopt;
}

std::vector<LineSampler::Received> LineSampler::Take(TimeNs known_until_ns, double receiver_bit_ns,
                                                     double tolerance) {
  std::vector<Received> received;
  while (const auto edge = FallingEdge()) {
    const double place = edge->bit_ns > receiver_bit_ns ? 9 * tolerance : 1 - 10 * tolerance;
    const auto sample_ns = [&](int i) { return edge->at_ns + (i + place) * receiver_bit_ns; };
    if (sample_ns(9) > static_cast<double>(known_until_ns)) break;
    if (Level(sample_ns(0))) {
      looks_from_ns_ = sample_ns(0);  // too short for a start bit
      continue;
    }
    std::uint8_t byte = 0;
    for (int i = 1; i <= 8; ++i)
      if (Level(sample_ns(i))) byte = static_cast<std::uint8_t>(byte | 1 << (i - 1));
    looks_from_ns_ = sample_ns(9);
    received.push_back({static_cast<TimeNs>(edge->at_ns), static_cast<TimeNs>(looks_from_ns_), byte,
                        !Level(looks_from_ns_)});
  }
  while (!sent_.empty() && sent_.front().end_ns() <= looks_from_ns_) sent_.pop_front();
  return received;
}

}  // namespace tiltproof::harness
