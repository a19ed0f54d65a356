#include "harness/emulator/line_sampler.h"

namespace tiltproof::harness {

void LineSampler::Put(TimeNs begin_ns, std::uint8_t byte, double sender_bit_ns,
                      const link::CharacterFormat& format, bool parity_error) {
  sent_.push_back({static_cast<double>(begin_ns), sender_bit_ns, format.WordOf(byte, parity_error), format});
}

bool LineSampler::Level(double at_ns) const {
  for (const Sent& sent : sent_)
    if (at_ns >= sent.begin_ns && at_ns < sent.end_ns())
      return sent.Bit(static_cast<std::int64_t>((at_ns - sent.begin_ns) / sent.bit_ns));
  return true;  // idle
}

std::optional<LineSampler::Edge> LineSampler::FallingEdge() const {
  for (const Sent& sent : sent_)
    for (std::int64_t i = 0; i <= sent.format.content_bits(); ++i) {
      const double at_ns = sent.begin_ns + static_cast<double>(i) * sent.bit_ns;
      const bool falls = !sent.Bit(i) && (i == 0 || sent.Bit(i - 1));
      if (falls && at_ns >= looks_from_ns_) return Edge{at_ns, sent.bit_ns};
    }
  return std::nullopt;
}

std::vector<LineSampler::Received> LineSampler::Take(TimeNs known_until_ns, double receiver_bit_ns,
                                                     double tolerance, const link::CharacterFormat& format) {
  const std::int64_t content = format.content_bits(), stop = content + 1;
  std::vector<Received> received;
  while (const auto edge = FallingEdge()) {
    const auto bits = static_cast<double>(stop);
    const double place = edge->bit_ns > receiver_bit_ns ? bits * tolerance : 1 - (bits + 1) * tolerance;
    const auto sample_ns = [&](std::int64_t i) {
      return edge->at_ns + (static_cast<double>(i) + place) * receiver_bit_ns;
    };
    if (sample_ns(stop) > static_cast<double>(known_until_ns)) break;
    if (Level(sample_ns(0))) {
      looks_from_ns_ = sample_ns(0);  // too short for a start bit
      continue;
    }
    std::uint16_t word = 0;
    for (std::int64_t i = 1; i <= content; ++i)
      if (Level(sample_ns(i))) word = static_cast<std::uint16_t>(word | 1U << (i - 1));
    looks_from_ns_ = sample_ns(stop);
    const bool parity_error =
        format.has_parity() && word != format.WordOf(format.Carried(static_cast<std::uint8_t>(word)));
    received.push_back({static_cast<TimeNs>(edge->at_ns), static_cast<TimeNs>(looks_from_ns_), word,
                        !Level(looks_from_ns_), parity_error});
  }
  while (!sent_.empty() && sent_.front().end_ns() <= looks_from_ns_) sent_.pop_front();
  return received;
}

}  // namespace tiltproof::harness
