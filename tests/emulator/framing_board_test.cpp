// Framings on the emulated board, in lockstep: an image flies as the same code does as a library of this machine.
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "harness/client/make_client.h"
#include "harness/run/flight.h"
#include "link/cobs_framing.h"
#include "link/length_framing.h"
#include "tests/harness/run/by_hand.h"

namespace tiltproof::harness {
namespace {

std::shared_ptr<const link::Protocol> PaperIn(std::shared_ptr<const link::Framing> framing) {
  auto protocol = std::make_shared<link::Protocol>(*link::FindProtocol("paper"));
  protocol->framing = std::move(framing);
  return protocol;
}

RunLog FlyIn(const std::shared_ptr<const link::Framing>& framing, const ClientSpec& client, double drop) {
  Scenario scenario;
  scenario.name = "framing";
  scenario.duration_ns = 3 * kNsPerS;
  scenario.reference.path = HoverReference{{0, 0, 5.2}, 0};
  scenario.initial_position_m = {0, 0, 5};
  scenario.link.protocol = PaperIn(framing);
  if (drop > 0) {
    faults::FaultSpec fault;
    fault.id = "fault";
    fault.type = "frame.drop";
    fault.target = faults::Target::kBoth;
    fault.start_ns = kNsPerS;
    fault.parameters = {{"probability", drop}};
    scenario.faults = {fault};
  }
  ClientSettings settings;
  settings.firmware = "paper";
  settings.protocol = scenario.link.protocol;
  settings.lines.faulty = drop > 0;
  return Fly(scenario, Model(), {.make_client = [&](std::size_t /*client*/, ClientHost host) {
               return MakeClient(client, settings, std::move(host));
             }});
}

// The first place in which two traces differ, to the bit; empty: they do not. Columns that count frames depend on when in
// a period these are sent, and a library has no state before its first tick.
std::string Difference(const Trace& one, const Trace& other) {
  if (one.columns() != other.columns() || one.row_count() != other.row_count()) return "columns or rows";
  for (std::size_t row = 0; row < one.row_count(); ++row)
    for (std::size_t column = 0; column < one.columns().size(); ++column) {
      const std::string& name = one.columns()[column];
      if (name.ends_with("_count") || name == "supervisor_state") continue;
      if (std::bit_cast<std::uint64_t>(one.at(row, column)) !=
          std::bit_cast<std::uint64_t>(other.at(row, column)))
        return name + " in row " + std::to_string(row);
    }
  return {};
}

void CheckEqual(const std::shared_ptr<const link::Framing>& framing, const std::string& name) {
  const EmulatedImage image{.file = std::string(FRAMED_IMAGES) + "/framed_" + name + ".elf"};
  const HostLibrary library{.file = std::string(FRAMED_LIBRARIES) + "/framed_" + name + ".so"};
  for (const double drop : {0.0, 0.2}) {
    SCOPED_TRACE(drop);
    const RunLog emulated = FlyIn(framing, image, drop), host = FlyIn(framing, library, drop);
    EXPECT_EQ(emulated.end_reason, EndReason::kCompleted);
    const auto& counts = emulated.clients[0].counts;
    EXPECT_GT(counts[0].frames_accepted, drop > 0 ? 300 : 495);
    EXPECT_GT(counts[1].frames_accepted, drop > 0 ? 150 : 245);
    for (const DirectionCounts& one : counts) EXPECT_EQ(one.frames_rejected, 0);
    EXPECT_EQ(Difference(emulated.trace, host.trace), "");
    EXPECT_GT(emulated.trace.row_count(), 245U);
  }
}

TEST(FramingBoard, FliesWithCobs) {
  CheckEqual(link::MakeCobsFraming(link::CheckKind::kCrc16Ibm3740), "cobs");
}

TEST(FramingBoard, FliesWithALengthInFront) {
  CheckEqual(link::MakeLengthFraming({.sync = {0xAA, 0x55}}, link::CheckKind::kCrc16Ibm3740), "length");
}

}  // namespace
}  // namespace tiltproof::harness
