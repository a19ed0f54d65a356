#include "tests/fuzz/frame_script.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <optional>

#include "link/frame.h"

// The engine's own mutation of bytes that mean nothing to it.
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace tiltproof::testing {
namespace {

using Step = FrameScript::Step;
constexpr std::size_t kStepBytesMax = 255;

Bytes Framed(const Bytes& payload) {
  std::array<std::uint8_t, link::FrameBytesMax(link::kPayloadBytesMax)> wire;
  const auto frame = link::EncodeFrame(payload, wire).bytes;
  return {frame.begin(), frame.end()};
}

auto At(Bytes& bytes, std::size_t at) { return bytes.begin() + static_cast<std::ptrdiff_t>(at); }

// A value of a message, which is a row of numbers, becomes one that no sender should send.
void BreakValue(Bytes& payload, Draw& draw) {
  using Limits = std::numeric_limits<float>;
  const std::array<float, 10> values = {Limits::quiet_NaN(),
                                        Limits::infinity(),
                                        -Limits::infinity(),
                                        -0.F,
                                        Limits::denorm_min(),
                                        Limits::max(),
                                        1e4F,
                                        -1e3F,
                                        100.5F,
                                        draw.Unit()};
  if (payload.size() < sizeof(float)) return;
  const float value = values[draw.Below(values.size())];
  std::memcpy(&payload[draw.Below(payload.size() / sizeof(float)) * sizeof(float)], &value, sizeof value);
}

// Another content in the first valid frame of a step, under a checksum that is right.
void ChangeContent(Step& step, Draw& draw) {
  link::FrameDecoder decoder;
  std::span<const std::uint8_t> rest(step.bytes);
  while (const auto event = decoder.Next(rest)) {
    if (event->status != link::FrameStatus::kOk) continue;
    Bytes payload(event->payload.begin(), event->payload.end());
    switch (draw.Below(4)) {
      case 0:
        payload.resize(draw.Below(2) == 0 ? payload.size() / 2 : payload.size() + 1 + draw.Below(8));
        break;
      case 1: {
        const std::size_t used = payload.size();
        payload.resize(used + 8);
        payload.resize(LLVMFuzzerMutate(payload.data(), used, payload.size()));
        break;
      }
      default:
        BreakValue(payload, draw);
    }
    const auto begin = static_cast<std::ptrdiff_t>(event->begin),
               end = static_cast<std::ptrdiff_t>(event->end);
    const Bytes frame = Framed(payload);
    const auto at = step.bytes.erase(step.bytes.begin() + begin, step.bytes.begin() + end);
    step.bytes.insert(at, frame.begin(), frame.end());
    return;
  }
}

void BreakBytes(Bytes& bytes, Draw& draw) {
  constexpr std::array<std::uint8_t, 6> kMeaning = {link::kFlag, link::kEscape, 0x5E, 0x5D, 0x00, 0xFF};
  if (bytes.empty()) return;
  const std::size_t at = draw.Below(bytes.size());
  const std::uint8_t meaning = kMeaning[draw.Below(kMeaning.size())];
  switch (draw.Below(6)) {
    case 0:
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ 1U << draw.Below(8));
      break;
    case 1:
      bytes[at] = meaning;
      break;
    case 2:
      bytes.insert(At(bytes, at), meaning);
      break;
    case 3:
      bytes.erase(At(bytes, at));
      break;
    case 4:
      bytes.resize(at);  // cut short
      break;
    default:  // a shared flag, or none at all
      bytes.erase(draw.Below(2) == 0 ? bytes.begin() : bytes.end() - 1);
  }
}

// Order, timing and cuts.
void Rearrange(std::vector<Step>& steps, std::size_t at, Draw& draw) {
  const auto place = steps.begin() + static_cast<std::ptrdiff_t>(at);
  switch (draw.Below(6)) {
    case 0:
      std::swap(*place, steps[draw.Below(steps.size())]);
      break;
    case 1:
      steps.erase(place);
      break;
    case 2:
      place->wait = static_cast<std::uint8_t>(draw.Below(256));
      break;
    case 3: {  // one transmission in two
      const std::size_t cut = draw.Below(place->bytes.size() + 1);
      Step rest{
          static_cast<std::uint8_t>(draw.Below(4)), place->line, {At(place->bytes, cut), place->bytes.end()}};
      place->bytes.resize(cut);
      steps.insert(place + 1, std::move(rest));
      break;
    }
    case 4:
      place->line = static_cast<std::uint8_t>(draw.Below(256));
      break;
    default: {  // the same again and again
      const std::size_t count = std::min(steps.size() - at, 1 + draw.Below(8));
      const std::vector<Step> again(place, place + static_cast<std::ptrdiff_t>(count));
      for (std::size_t times = 1 + draw.Below(8); times > 0; --times)
        steps.insert(steps.begin() + static_cast<std::ptrdiff_t>(at), again.begin(), again.end());
    }
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
  for (std::size_t changes = 1 + draw.Below(3); changes > 0; --changes) {
    const std::size_t at = draw.Below(script.steps.size() + 1);
    const std::size_t what = at == script.steps.size() ? 0 : draw.Below(8);
    if (what < 2) {
      Step step{static_cast<std::uint8_t>(draw.Below(128)), static_cast<std::uint8_t>(draw.Below(4)), {}};
      step.bytes = Framed(payload_of(script, step.line, draw));
      script.steps.insert(script.steps.begin() + static_cast<std::ptrdiff_t>(at), std::move(step));
    } else if (what < 4) {
      ChangeContent(script.steps[at], draw);
    } else if (what < 6) {
      BreakBytes(script.steps[at].bytes, draw);
    } else {
      Rearrange(script.steps, at, draw);
    }
    if (draw.Below(32) == 0) script.choice = static_cast<std::uint8_t>(draw.Below(256));
  }
  const Bytes written = WriteScript(script);
  const std::size_t new_size = std::min(written.size(), max_size);
  std::memcpy(data, written.data(), new_size);
  return new_size;
}

}  // namespace tiltproof::testing
