// Framings on the emulated board, in lockstep: an image flies as the same code does as a library of this machine.
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "harness/client/make_client.h"
#include "harness/run/flight.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/cobs_framing.h"
#include "link/length_framing.h"
#include "tests/harness/run/by_hand.h"
#include "tests/support/tiny_framings.h"

namespace tiltproof::harness {
namespace {

RunLog FlyIn(const std::shared_ptr<const link::Protocol>& protocol, const std::string& firmware,
             const ClientSpec& client, const std::vector<faults::FaultSpec>& faults) {
  Scenario scenario;
  scenario.name = "framing";
  scenario.duration_ns = 3 * kNsPerS;
  scenario.reference.path = HoverReference{{0, 0, 5.2}, 0};
  scenario.initial_position_m = {0, 0, 5};
  scenario.link.protocol = protocol;
  scenario.faults = faults;
  ClientSettings settings;
  settings.firmware = firmware;
  settings.protocol = protocol;
  settings.lines.faulty = !faults.empty();
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
  const EmulatedImage image{.file = std::string(IMAGES) + "/framed/framed_" + name + ".elf"};
  const HostLibrary library{.file = std::string(FRAMED_LIBRARIES) + "/framed_" + name + ".so"};
  for (const double drop : {0.0, 0.2}) {
    SCOPED_TRACE(drop);
    std::vector<faults::FaultSpec> faults;
    if (drop > 0) faults.push_back(OnFrames("frame.drop", {{"probability", drop}}));
    const RunLog emulated = FlyIn(link::PaperOver(framing), "paper", image, faults),
                 host = FlyIn(link::PaperOver(framing), "paper", library, faults);
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

// The shipped firmware. The server refuses repeated and old commands.
TEST(FramingBoard, TheShippedFirmwareFliesHardened) {
  const auto protocol = FindProtocol("hardened");
  for (const std::string build : {"paper", "tolerant"}) {
    const EmulatedImage image{.file = std::string(IMAGES) + "/executive-" + build + "-hardened.elf"};
    for (const auto& [type, parameters] :
         {std::pair<const char*, std::map<std::string, faults::ParameterValue>>{"", {}},
          {"frame.drop", {{"probability", 0.2}}},
          {"frame.duplicate", {{"probability", 0.3}}},
          {"frame.replay_stale", {{"probability", 0.2}, {"age_count", 5.0}}}}) {
      SCOPED_TRACE(build + " " + type);
      const std::string kind = type;
      std::vector<faults::FaultSpec> faults;
      if (!kind.empty()) faults.push_back(OnFrames(type, parameters));
      const RunLog emulated = FlyIn(protocol, build, image, faults),
                   host = FlyIn(protocol, build, HostLibrary{}, faults);
      EXPECT_EQ(emulated.end_reason, EndReason::kCompleted);
      EXPECT_EQ(Difference(emulated.trace, host.trace), "");
      const bool repeats = kind == "frame.duplicate" || kind == "frame.replay_stale";
      EXPECT_EQ(emulated.clients[0].counts[0].frames_rejected > 30, repeats);
      if (!repeats) {
        EXPECT_EQ(emulated.clients[0].counts[0].frames_rejected, 0);
      }
    }
  }
}

}  // namespace
}  // namespace tiltproof::harness
