// Bytes on a line and their times: the input of targets that fuzz one end of it as a whole. A mutator that knows
// frames builds valid ones. Then it breaks them (harness/campaign/hostile_frames.h), and their order and timing.
//
//   const FrameScript script = ReadScript({data, size});        // any bytes are a script
//   for (const FrameScript::Step& step : script.steps) {
//     now += step.Wait_ns();
//     line.Transmit(link::Direction::kToPlant, now, step.bytes);
//   }
//
//   extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
//                                                  unsigned seed) {
//     return MutateScript(data, size, max_size, seed, PayloadOfClient);
//   }
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "faults/random.h"
#include "link/time.h"

namespace tiltproof::testing {

using Bytes = std::vector<std::uint8_t>;

// The file: the choice, then for each step its wait, its line, the number of its bytes, and the bytes.
struct FrameScript {
  struct Step {
    std::uint8_t wait = 0;
    std::uint8_t line = 0;  // what it means is the target's matter
    Bytes bytes;            // at most 255
    // Below 192 steps of 1/8 ms: two control periods; from there on 16 ms each, up to a second.
    TimeNs Wait_ns() const { return wait < 192 ? wait * kNsPerMs / 8 : (wait - 191) * 16 * kNsPerMs; }
  };
  std::uint8_t choice = 0;  // of what is driven
  std::vector<Step> steps;
};
FrameScript ReadScript(std::span<const std::uint8_t> data);
Bytes WriteScript(const FrameScript& script);

class Draw : public faults::Random {
 public:
  explicit Draw(unsigned seed) : Random(faults::KeyOf(seed, 0)) {}
  // In [-1, 1].
  float Unit() { return static_cast<float>(Below(2001)) * 1e-3F - 1.F; }
};

// A valid message, as the end that is not fuzzed says it on that line.
using PayloadOf = std::function<Bytes(const FrameScript& script, std::uint8_t line, Draw& draw)>;

// One mutation, in place; the new size. For LLVMFuzzerCustomMutator.
std::size_t MutateScript(std::uint8_t* data, std::size_t size, std::size_t max_size, unsigned seed,
                         const PayloadOf& payload_of);

}  // namespace tiltproof::testing
