// The C header of programs computes when bytes have left as the wire does, to the nanosecond.
#include "firmware/tiltproof_program.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <vector>

#include "harness/scenario/shipped_protocols.h"
#include "link/protocol.h"
#include "link/wire.h"

namespace tiltproof::harness {
namespace {

RC_GTEST_PROP(ProgramHeader, BytesLeaveAsOnTheWire, ()) {
  const link::CharacterFormat character{.data_bits = *rc::gen::element<std::int64_t>(7, 8),
                                        .parity = *rc::gen::elementOf(link::kParities),
                                        .stop_bits = *rc::gen::element<std::int64_t>(1, 2)};
  const std::int64_t baud = *rc::gen::element<std::int64_t>(0, 300, 9600, 115'200, 921'600, 999'983);
  const auto protocol = FindProtocol("paper");
  link::Wire wire({.baud = baud, .character = character}, link::Direction::kToPlant, *protocol, nullptr);

  TiltproofProgram program{};
  program.socket = -1;
  program.uart_count = 2;
  program.uarts[0].baud = baud;
  program.uarts[0].character_bits = character.bit_count();
  std::int64_t now_ns = 0;
  for (int turn = 0; turn < 40; ++turn) {
    now_ns += *rc::gen::element<std::int64_t>(0, 1, 12'000'000, 700'000'000, 3'000'000'000);
    program.now_ns = now_ns;
    for (int i = 0; i < 2; ++i) {
      const std::int64_t at_ns =
          now_ns + *rc::gen::element<std::int64_t>(-5, 0, 1'000, 999'999'999, 4'000'000'000);
      const std::vector<std::uint8_t> bytes(*rc::gen::element<std::size_t>(1, 8, 27, 400), 0x55);
      // As run/client_channel.cpp takes what a client says.
      const BootTime at(std::clamp(at_ns, now_ns, now_ns + 1'000'000'000));
      RC_ASSERT(tiltproof_program_transmit(&program, 0, at_ns, bytes.data(), bytes.size()) ==
                wire.Transmit(at, bytes).ns());
      // Nothing waits for long.
      while (wire.TakePiece(BootTime(now_ns))) {
      }
    }
    program.out.size = 0;
  }
  RC_ASSERT(tiltproof_program_transmit(&program, 1, now_ns + 5, program.out.bytes, 1) == now_ns + 5);
  RC_ASSERT(tiltproof_program_transmit(&program, 2, now_ns + 5, program.out.bytes, 1) == now_ns + 5);
  tiltproof_program_close(&program);
}

}  // namespace
}  // namespace tiltproof::harness
