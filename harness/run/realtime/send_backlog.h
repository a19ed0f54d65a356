// The backlog of a line whose bytes a late process hands over all at once. Messages that the server sends by itself
// come one in each period; a process that stood still hands over those of many periods, and the line needs a while to
// send them. Until then the machine is late, not the client that answers each of them.
//
//   SendBacklog backlog(rate, 3 * kNsPerMs);
//   if (const auto sent_ns = backlog.Take(now, bytes.size())) lateness.NoteBacklog(now, *sent_ns);
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "link/character.h"
#include "link/time.h"

namespace tiltproof::harness {

class SendBacklog {
 public:
  // `usual_ns`: the line needs no longer for what waits, unless something is late. With half a period and the time of the
  // messages of one period, messages after a shorter backlog come at least half a period apart.
  SendBacklog(const link::LineRate& rate, TimeNs usual_ns) : rate_(rate), usual_ns_(usual_ns) {}

  // Bytes that are handed over at `now`, which does not descend. Returns when all are sent, if that takes longer than
  // usual. Faults on the line do not count.
  std::optional<BootTime> Take(BootTime now, std::size_t bytes_count) {
    sent_ns_ = std::max(sent_ns_, now) + rate_.BytesTime(static_cast<std::int64_t>(bytes_count));
    return sent_ns_ - now > usual_ns_ ? std::optional(sent_ns_) : std::nullopt;
  }

 private:
  link::LineRate rate_;
  TimeNs usual_ns_;
  BootTime sent_ns_ = BootTime(0);
};

}  // namespace tiltproof::harness
