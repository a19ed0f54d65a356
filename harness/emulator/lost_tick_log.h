// Reads what the emulator's plug-in notes of lost ticks (lockstep::RealtimeBoard), as spans in which this machine took time from
// the board. Ticks lost one after the other are one span.
//
//   const lockstep::RealtimeBoard memory{};   // the plug-in has mapped it, too
//   LostTickLog lost(memory);
//   const std::vector<LostTickLog::Span> spans = lost.Take();   // now and then
#pragma once

#include <cstdint>
#include <vector>

#include "harness/emulator/lockstep_protocol.h"
#include "link/time.h"

namespace tiltproof::harness {

class LostTickLog {
 public:
  explicit LostTickLog(const lockstep::RealtimeBoard& board) : board_(board) {}

  struct Span {
    std::int64_t begin_ns, end_ns;  // by CLOCK_MONOTONIC
    friend bool operator==(const Span&, const Span&) = default;
  };
  // New spans, in order. Only the last ticks are kept: those before them lie between the last look and these.
  std::vector<Span> Take();

  // A fault of the scenario holds the emulator then: what it loses by that is no doing of this machine. `end_ns` is when it is
  // let go; it needs a while to come to itself.
  void Held(std::int64_t begin_ns, std::int64_t end_ns) {
    held_.push_back({begin_ns, end_ns + kComesToItselfNs});
  }
  static constexpr std::int64_t kComesToItselfNs = 5 * kNsPerMs;

 private:
  const lockstep::RealtimeBoard& board_;
  std::uint64_t taken_ = 0;
  std::int64_t last_end_ns_ = 0;
  std::vector<Span> held_;
};

}  // namespace tiltproof::harness
