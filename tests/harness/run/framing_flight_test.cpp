// The shipped firmware over framings that it does not speak, with an interpreter in between. The messages are the
// same, so on a line without byte time the flights are the same.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "harness/client/library_client.h"
#include "harness/run/flight.h"
#include "tests/harness/run/by_hand.h"
#include "tests/support/tiny_framings.h"

namespace tiltproof::harness {
namespace {

using link::CobsFraming;
using link::LengthFraming;
using link::PaperOver;

// The frames in some bytes of a stream, in another framing.
class Interpreter {
 public:
  Interpreter(const link::Framing& from, const link::Framing& to) : reader_(from.MakeReader()), to_(&to) {}
  std::vector<std::uint8_t> Interpret(std::span<const std::uint8_t> bytes) {
    std::vector<std::uint8_t> all;
    while (const auto read = reader_->Next(bytes)) {
      if (!read->ok) continue;
      const std::vector<std::uint8_t> frame = to_->Encode(read->payload);
      all.insert(all.end(), frame.begin(), frame.end());
    }
    return all;
  }

 private:
  std::unique_ptr<link::FrameReader> reader_;
  const link::Framing* to_;
};

class InterpretedClient : public Client {
 public:
  InterpretedClient(const link::Framing& line, ClientHost host)
      : to_client_{Interpreter(line, *link::HdlcFraming()), Interpreter(line, *link::HdlcFraming())},
        to_line_(*link::HdlcFraming(), line) {
    const auto transmit = host.transmit;
    host.transmit = [this, transmit](Uart uart, BootTime now, std::span<const std::uint8_t> bytes) {
      return transmit(uart, now, to_line_.Interpret(bytes));
    };
    client_ = LoadLibraryClient(TILTPROOF_FIRMWARE_LIBRARY, "paper", "paper", std::move(host));
  }
  BootTime Start(BootTime now) override { return client_->Start(now); }
  void Receive(Uart uart, BootTime arrival, std::span<const std::uint8_t> bytes,
               std::span<const faults::ReceiveMark> /*marks*/) override {
    const auto frames = to_client_[static_cast<std::size_t>(uart)].Interpret(bytes);
    if (!frames.empty()) client_->Receive(uart, arrival, frames, {});
  }
  BootTime Grant(BootTime now, BootTime horizon) override { return client_->Grant(now, horizon); }
  void Command(const std::vector<faults::DeviceCommand>& commands, Origin origin) override {
    client_->Command(commands, origin);
  }
  BootTime Add(const std::vector<faults::DeviceCommand>& commands) override { return client_->Add(commands); }
  std::optional<ClientStatus> Status() override { return client_->Status(); }
  ClientSample Sample() override { return client_->Sample(); }

 private:
  std::array<Interpreter, 2> to_client_;
  Interpreter to_line_;
  std::unique_ptr<Client> client_;
};

RunLog FlyOver(const std::shared_ptr<const link::Framing>& framing,
               const std::vector<faults::FaultSpec>& faults, bool ideal) {
  Scenario scenario;
  scenario.name = "framings";
  scenario.duration_ns = 3 * kNsPerS;
  scenario.reference.path = HoverReference{{0, 0, 5}, 0};
  scenario.initial_position_m = {0.2, 0, 5};
  scenario.link.protocol = PaperOver(framing);
  scenario.link.ideal = ideal;
  scenario.faults = faults;
  return Fly(scenario, Model(), {.make_client = [&](std::size_t /*client*/, ClientHost host) {
               return std::make_unique<InterpretedClient>(*framing, std::move(host));
             }});
}

TEST(FramingFlight, TheSameMessagesFlyTheSameFlight) {
  std::vector<std::string> hashes;
  for (const std::vector<faults::FaultSpec>& faults :
       {std::vector<faults::FaultSpec>{},
        {OnFrames("frame.drop", {{"probability", 0.2}})},
        {OnFrames("frame.duplicate", {{"probability", 0.2}})},
        {OnFrames("frame.wrong_id", {{"id", 9.0}, {"probability", 0.2}})},
        {OnFrames("frame.replay_stale", {{"probability", 0.2}, {"age_count", 2.0}})}}) {
    const RunLog expected = FlyOver(link::HdlcFraming(), faults, true);
    EXPECT_GT(expected.clients[0].counts[0].frames_accepted, 200);
    hashes.push_back(TraceHash(expected.trace));
    for (const std::shared_ptr<const link::Framing>& framing :
         {std::shared_ptr<const link::Framing>(std::make_shared<CobsFraming>()),
          std::shared_ptr<const link::Framing>(std::make_shared<LengthFraming>())}) {
      const RunLog found = FlyOver(framing, faults, true);
      EXPECT_EQ(found.end_reason, expected.end_reason);
      EXPECT_EQ(TraceHash(found.trace), hashes.back()) << framing->name();
    }
  }
  std::sort(hashes.begin(), hashes.end());
  EXPECT_EQ(std::unique(hashes.begin(), hashes.end()), hashes.end()) << "each fault shows";
}

TEST(FramingFlight, NothingIsRejectedOnALineWithByteTime) {
  for (const std::shared_ptr<const link::Framing>& framing :
       {std::shared_ptr<const link::Framing>(std::make_shared<CobsFraming>()),
        std::shared_ptr<const link::Framing>(std::make_shared<LengthFraming>())}) {
    const RunLog log = FlyOver(framing, {}, false);
    EXPECT_EQ(log.end_reason, EndReason::kCompleted);
    for (const DirectionCounts& counts : log.clients[0].counts) {
      EXPECT_EQ(counts.frames_rejected, 0);
      EXPECT_GT(counts.frames_accepted, 240);
    }
  }
}

}  // namespace
}  // namespace tiltproof::harness
