// The frames of a flight's lines: each as sent, beside what the faults made of it.
//
//   const LinkLog log(content_of_link_bin);
//   for (const LineFrame& frame : FramesOf(log))
//     if (frame.fate == FrameFate::kDamaged) Show(frame.sent, frame.delivered);
//
// A log does not say which bytes came from which frame, so that is found by their times and contents: bytes that went on
// at the frame's own time, or the same bytes later, or else what went on before the next frame.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "harness/run/link_log.h"
#include "link/time.h"

namespace tiltproof::harness {

enum class FrameFate : std::uint8_t {
  kIntact,   // went on as sent, when it was sent
  kLate,     // as sent, but later or in pieces
  kDamaged,  // something else went on instead
  kLost,     // nothing went on
  kExtra,    // went on, and was not sent
};
std::string_view Name(FrameFate fate);
constexpr FrameFate LastOf(FrameFate) { return FrameFate::kExtra; }

// A line holds its frames back for at most this long to be recognised.
inline constexpr TimeNs kLateMax_ns = 2 * kNsPerS;

struct LineFrame {
  WireId wire;
  TimeNs begin_ns = 0;                 // of what was sent; of what went on, if that is extra
  std::span<const std::uint8_t> sent;  // in the log; empty: extra
  FrameFate fate = FrameFate::kIntact;
  std::vector<LinkRecord> delivered = {};  // none for intact frames
};

// In order of time. `log` must outlive them.
std::vector<LineFrame> FramesOf(const LinkLog& log);

}  // namespace tiltproof::harness
