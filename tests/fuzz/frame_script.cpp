#include "tests/fuzz/frame_script.h"

#include <algorithm>
#include <cstring>

#include "harness/campaign/hostile_frames.h"
#include "harness/scenario/shipped_protocols.h"

// The engine's own mutation of bytes that mean nothing to it.
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace tiltproof::testing {
namespace {

using Step = FrameScript::Step;
constexpr std::size_t kStepBytesMax = 255;

// Order, timing and cuts.
void ChangeOrder(std::vector<Step>& steps, std::size_t at, Draw& draw) {
  const auto place = steps.begin() + static_cast<std::ptrdiff_t>(at);
  switch (draw.Below(6)) {
    case 0:
      place->wait = static_cast<std::uint8_t>(draw.Below(256));
      break;
    case 1: {  // one transmission in two
      const auto cut = static_cast<std::ptrdiff_t>(draw.Below(place->bytes.size() + 1));
      Step rest{static_cast<std::uint8_t>(draw.Below(4)),
                place->line,
                {place->bytes.begin() + cut, place->bytes.end()}};
      place->bytes.resize(static_cast<std::size_t>(cut));
      steps.insert(place + 1, std::move(rest));
      break;
    }
    case 2:
      place->line = static_cast<std::uint8_t>(draw.Below(256));
      break;
    default:
      harness::Rearrange(steps, at, draw);
  }
}

}  // namespace

FrameScript ReadScript(std::span<const std::uint8_t> data) {
  FrameScript script;
  if (data.empty()) return script;
  script.choice = data[0];
  for (data = data.subspan(1); data.size() >= 3;) {
    const auto bytes = data.subspan(3, std::min<std::size_t>(data[2], data.size() - 3));
    script.steps.push_back({data[0], data[1], Bytes(bytes.begin(), bytes.end())});
    data = data.subspan(3 + bytes.size());
  }
  return script;
}

Bytes WriteScript(const FrameScript& script) {
  Bytes data = {script.choice};
  for (const Step& step : script.steps) {
    const std::size_t size = std::min(step.bytes.size(), kStepBytesMax);
    data.insert(data.end(), {step.wait, step.line, static_cast<std::uint8_t>(size)});
    data.insert(data.end(), step.bytes.begin(), step.bytes.begin() + static_cast<std::ptrdiff_t>(size));
  }
  return data;
}

std::size_t MutateScript(std::uint8_t* data, std::size_t size, std::size_t max_size, unsigned seed,
                         const PayloadOf& payload_of) {
  Draw draw(seed);
  if (draw.Below(16) == 0) return LLVMFuzzerMutate(data, size, max_size);
  FrameScript script = ReadScript({data, size});
  const link::Protocol& paper = *harness::FindProtocol("paper");
  const link::Framing& framing = *paper.framing;
  const auto change = [](Bytes& bytes, std::size_t more_bytes_max) {
    const std::size_t used = bytes.size();
    bytes.resize(used + more_bytes_max);
    bytes.resize(LLVMFuzzerMutate(bytes.data(), used, bytes.size()));
  };
  for (std::size_t changes = 1 + draw.Below(3); changes > 0; --changes) {
    const std::size_t at = draw.Below(script.steps.size() + 1);
    const std::size_t what = at == script.steps.size() ? 0 : draw.Below(8);
    if (what < 2) {
      Step step{static_cast<std::uint8_t>(draw.Below(128)), static_cast<std::uint8_t>(draw.Below(4)), {}};
      step.bytes = framing.Encode(payload_of(script, step.line, draw));
      script.steps.insert(script.steps.begin() + static_cast<std::ptrdiff_t>(at), std::move(step));
    } else if (what < 4) {
      harness::ChangeContent(paper, script.steps[at].bytes, draw, change);
    } else if (what < 6) {
      harness::BreakBytes(framing, script.steps[at].bytes, draw);
    } else {
      ChangeOrder(script.steps, at, draw);
    }
    if (draw.Below(32) == 0) script.choice = static_cast<std::uint8_t>(draw.Below(256));
  }
  const Bytes written = WriteScript(script);
  const std::size_t new_size = std::min(written.size(), max_size);
  std::memcpy(data, written.data(), new_size);
  return new_size;
}

}  // namespace tiltproof::testing
