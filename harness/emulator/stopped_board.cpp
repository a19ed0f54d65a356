#include "harness/emulator/stopped_board.h"

#include <algorithm>

namespace tiltproof::harness {

bool StoppedInLockstep::Step() {
  // QEMU runs with -icount shift=3.
  constexpr std::int64_t kInstructionNs = 8;
  const lockstep::Stopped stopped =
      board_.Run({now_ns_ + kInstructionNs, 0, 0}, [](const EmulatorMessage&) {});
  now_ns_ = std::max(stopped.at_ns, now_ns_ + kInstructionNs);
  return !stopped.locked_up;
}

}  // namespace tiltproof::harness
