// Input that a line can bring and no sender should send: valid frames of a protocol, broken. Flags, escapes, codes, marks
// and lengths of its framing, order, checks that are wrong, and absurd values under checks that are computed again.
//
//   faults::Random random(1);
//   const HostileFrames hostile(*FindProtocol("paper"), link::Direction::kToClient);
//   LineBytes said = hostile.Make(random);  // one valid frame, or several, broken or not
//   BreakBytes(*FindProtocol("paper")->framing, said, random);  // and broken once more
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "faults/random.h"
#include "link/protocol.h"
#include "link/time.h"

namespace tiltproof::harness {

using LineBytes = std::vector<std::uint8_t>;

// Changes bytes that mean nothing to the caller; they grow by at most `more_bytes_max`.
using ChangeBytes = std::function<void(LineBytes& bytes, std::size_t more_bytes_max)>;

// Another content in the first valid frame, under a check that is right: another length, a value that no sender should
// send, or what `change` makes of it.
void ChangeContent(const link::Protocol& protocol, LineBytes& bytes, faults::Random& random,
                   const ChangeBytes& change);
// The same with random bytes.
void ChangeContent(const link::Protocol& protocol, LineBytes& bytes, faults::Random& random);
// One change in the bytes as they are on the line: a bit, a byte of meaning too many, one too few, a cut, a wrong length
// or code.
void BreakBytes(const link::Framing& framing, LineBytes& bytes, faults::Random& random);

// Gives each valid message in `bytes` about the number and the time of a message that is sent at that time of a flight
// (link::FieldContent). An old one stays as it is, if it is not older than a few periods. One that is far ahead would make
// every sound receiver deaf for all that follows, and is no defect of it.
void Restamp(const link::Protocol& protocol, link::Direction direction, LineBytes& bytes, TimeNs time_ns);

// One change in the order of a list that is not empty: two change places, one is missing, some come again and again.
template <class T>
void Rearrange(std::vector<T>& list, std::size_t at, faults::Random& random) {
  const auto place = list.begin() + static_cast<std::ptrdiff_t>(at);
  switch (random.Below(3)) {
    case 0:
      std::swap(*place, list[random.Below(list.size())]);
      break;
    case 1:
      list.erase(place);
      break;
    default: {
      const std::size_t count = std::min<std::size_t>(list.size() - at, 1 + random.Below(8));
      const std::vector<T> again(place, place + static_cast<std::ptrdiff_t>(count));
      for (std::size_t times = 1 + random.Below(8); times > 0; --times)
        list.insert(list.begin() + static_cast<std::ptrdiff_t>(at), again.begin(), again.end());
    }
  }
}

class HostileFrames {
 public:
  // Frames for a wire of that direction. The protocol must outlive it.
  HostileFrames(const link::Protocol& protocol, link::Direction direction);
  // True if the protocol has no message there: then there are no frames.
  bool empty() const { return types_.empty(); }

  // A valid message with values of a small aircraft.
  LineBytes Valid(faults::Random& random) const;
  // A new input: one or a few frames, most of them broken; never empty.
  LineBytes Make(faults::Random& random) const;
  // Another one that resembles it; never empty.
  LineBytes Change(LineBytes bytes, faults::Random& random) const;
  // Another byte in the first valid frame, under a check that is right; nothing else.
  LineBytes ChangeOneByte(LineBytes bytes, faults::Random& random) const;

 private:
  LineBytes Payload(faults::Random& random) const;
  LineBytes ShortFrames(faults::Random& random) const;

  std::vector<const link::MessageType*> types_;
  const link::Protocol& protocol_;
  const link::Framing& framing_;
};

// Longest input, so that inputs do not queue up on the line for ever.
inline constexpr std::size_t kHostileBytesMax = 640;

}  // namespace tiltproof::harness
