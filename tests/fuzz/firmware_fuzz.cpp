// The whole firmware, as the harness flies it (firmware/tiltproof_client.h), in virtual time: every build in both
// dialects hears whatever a line can bring. It lets time pass, all that it sends is whole frames with messages of
// its dialect or for another board, and `tolerant`, which takes no value on trust, sends only finite values.
//
// Input: a script (frame_script.h). Its choice is the build and the dialect; the line of a step is the UART, a
// reset, or a call with nothing received.
#include "firmware/tiltproof_client.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

#include "firmware/builds.h"
#include "firmware/failover/cross_line.h"
#include "firmware/messages.h"
#include "link/frame.h"
#include "tests/fuzz/frame_script.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using tiltproof::TimeNs;
using tiltproof::testing::Bytes;
using tiltproof::testing::Draw;
using tiltproof::testing::FrameScript;
using tiltproof::testing::Require;
namespace link = tiltproof::link;

constexpr TimeNs kFlightMax_ns = 20 * tiltproof::kNsPerS;
constexpr TimeNs kByteTime_ns = 10'850;  // 921,600 baud, 10 bits
constexpr int kWakesMax_count = 20'000;  // within 12 ms, by the interface

const tiltproof::firmware::Build& BuildOf(const FrameScript& script) {
  const auto builds = tiltproof::firmware::Builds();
  return builds[script.choice / 2 % builds.size()];
}

link::Dialect DialectOf(const FrameScript& script) {
  return script.choice % 2 == 0 ? link::Dialect::kPaper : link::Dialect::kProvant;
}

// The other ends of the firmware's lines.
struct World {
  link::Dialect dialect;
  bool values_matter = false;
  link::FrameDecoder decoder;
  TimeNs now = 0, sent_until = 0;
  bool redundant = false;  // one of several boards, which talk to each other
  std::array<link::FrameDecoder, 2> cross = {link::FrameDecoder(link::FrameCheck::kCrc32),
                                             link::FrameDecoder(link::FrameCheck::kCrc32)};

  static std::int64_t Transmit(void* context, int uart, std::int64_t at, const std::uint8_t* bytes,
                               std::size_t count) {
    World& world = *static_cast<World*>(context);
    Require(at >= world.now, "it sends nothing in the past");
    if (world.redundant && (uart == 2 || uart == 3)) {
      std::span<const std::uint8_t> rest(bytes, count);
      while (const auto event = world.cross[static_cast<std::size_t>(uart - 2)].Next(rest))
        Require(event->status == link::FrameStatus::kOk && tiltproof::firmware::DecodeCross(event->payload),
                "it sends whole messages to other boards");
      return at + static_cast<TimeNs>(count) * kByteTime_ns;
    }
    Require(uart == TILTPROOF_UART_MAIN, "it sends on its main line, or to other boards");
    world.sent_until =
        (at > world.sent_until ? at : world.sent_until) + static_cast<TimeNs>(count) * kByteTime_ns;
    std::span<const std::uint8_t> rest(bytes, count);
    while (const auto event = world.decoder.Next(rest)) {
      Require(event->status == link::FrameStatus::kOk, "it sends whole frames");
      link::ClientMessage message;
      const auto status = link::DecodeClientMessage(world.dialect, event->payload, message);
      if (world.values_matter) Require(status != link::MessageStatus::kNotFinite, "it sends numbers");
      // The law makes absurd commands of absurd values.
      Require(status != link::MessageStatus::kBadLength && status != link::MessageStatus::kUnknownId,
              "it sends messages of its dialect");
    }
    return world.sent_until;
  }
};

Bytes PayloadToFirmware(const FrameScript&, std::uint8_t line, Draw& draw) {
  if (line % 4 == TILTPROOF_UART_REFERENCE) {
    tiltproof::Reference reference;
    for (const auto& field : tiltproof::kReferenceFields) reference.*field.in_float = 2 * draw.Unit();
    const auto message = link::EncodeReference(reference);
    return {message.span().begin(), message.span().end()};
  }
  tiltproof::Sensors sensors;
  for (const auto& field : tiltproof::kSensorFields) sensors.*field.in_float = draw.Unit();
  const auto message = link::EncodeSensors(sensors);
  return {message.span().begin(), message.span().end()};
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return tiltproof::testing::MutateScript(data, size, max_size, seed, PayloadToFirmware);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const FrameScript script = tiltproof::testing::ReadScript({data, size});
  World world{.dialect = DialectOf(script), .decoder = link::FrameDecoder()};
  const auto& build = BuildOf(script);
  world.redundant = build.redundancy != tiltproof::firmware::Redundancy::kNone;
  world.values_matter = std::string_view(build.name) == "tolerant";
  const TiltproofHost host = {
      TILTPROOF_CLIENT_ABI_VERSION,
      build.name,
      Name(world.dialect).data(),
      &world,
      World::Transmit,
      [](void*, std::int64_t, const char* text) { Require(*text != 0, "a log has text"); },
      nullptr,
      nullptr};
  const std::unique_ptr<TiltproofClient, void (*)(TiltproofClient*)> client(tiltproof_client_create(&host),
                                                                            tiltproof_client_destroy);
  Require(client != nullptr, "every build speaks both dialects");

  TimeNs wake = tiltproof_client_start(client.get(), 0);
  int wakes_count = 0;
  TimeNs period_begin = 0;
  const auto grant = [&](TimeNs at) {
    if (at - period_begin >= 12 * tiltproof::kNsPerMs) {
      period_begin = at;
      wakes_count = 0;
    }
    Require(++wakes_count <= kWakesMax_count, "it lets time pass");
    world.now = at;
    wake = tiltproof_client_grant(client.get(), at);
  };
  TiltproofClientStatus before{}, status{};
  for (const FrameScript::Step& step : script.steps) {
    const TimeNs at = world.now + step.Wait_ns();
    if (at > kFlightMax_ns) break;
    while (wake <= at) grant(wake > world.now ? wake : world.now);
    world.now = at;
    switch (step.line % 4) {
      case 2:
        world.decoder = link::FrameDecoder();
        wake = tiltproof_client_reset(client.get(), at);
        break;
      case 3:
        grant(at);
        break;
      default:
        tiltproof_client_receive(client.get(), step.line % 4, at, step.bytes.data(), step.bytes.size());
        grant(at);
    }
    tiltproof_client_status(client.get(), &status);
    if (step.line % 4 != 2)
      Require(status.failsafe_count >= before.failsafe_count, "what happened stays counted");
    before = status;
  }
  return 0;
}
