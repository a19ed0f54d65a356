// The bound on what waits on a line: beyond it, the flight ends, those to blame are named, and memory use stays small.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "faults/recorder.h"
#include "firmware/messages.h"
#include "harness/run/flight.h"
#include "link/frame.h"
#include "tests/support/control_period.h"

namespace tiltproof::harness {
namespace {

using faults::Target;
using ::testing::HasSubstr;
using ::testing::Not;

const plant::VehicleModel& Model() {
  static const plant::VehicleModel model = [] {
    std::vector<std::string> warnings;
    return plant::LoadVehicle(std::string(TILTPROOF_SOURCE_DIR) + "/plant/models/tiltrotor.sdf", {},
                              warnings);
  }();
  return model;
}

std::vector<std::uint8_t> InFrame(const link::MessageBytes& message) {
  std::array<std::uint8_t, link::FrameBytesMax(link::kMessageBytesMax)> wire;
  const auto frame = link::EncodeFrame(message.span(), wire).bytes;
  return {frame.begin(), frame.end()};
}

// Sends `start`, then `requests_count` requests every period, and hears nothing.
struct AskingClient : Client {
  AskingClient(ClientHost host_in, int requests_count_in)
      : host(std::move(host_in)), requests_count(requests_count_in) {}
  BootTime Start(BootTime now) override {
    return host.transmit(Uart::kMain, now, InFrame(link::EncodeStart(link::Dialect::kPaper, {10, 10, 0, 0})));
  }
  void Receive(Uart /*uart*/, BootTime /*arrival*/, std::span<const std::uint8_t> /*bytes*/,
               std::span<const faults::ReceiveMark> /*marks*/) override {}
  BootTime Grant(BootTime now, BootTime /*horizon*/) override {
    if (now < next_request) return next_request;
    for (int i = 0; i < requests_count; ++i)
      host.transmit(Uart::kMain, now, InFrame(link::EncodeReadSensors(link::Dialect::kPaper)));
    return next_request = now + kControlPeriodNs;
  }
  void Command(const std::vector<faults::DeviceCommand>& /*commands*/, Origin /*origin*/) override {}
  BootTime Add(const std::vector<faults::DeviceCommand>& /*commands*/) override { return BootTime::Never(); }
  std::optional<ClientStatus> Status() override { return std::nullopt; }
  ClientSample Sample() override { return {}; }

  ClientHost host;
  int requests_count;
  BootTime next_request;
};

RunLog FlyAsking(std::vector<faults::FaultSpec> faults, bool ideal = false, int requests_count = 1,
                 double duration_s = 3.0) {
  Scenario scenario;
  scenario.name = "test";
  scenario.duration_ns = FromSeconds(duration_s);
  scenario.reference.path = HoverReference{{0, 0, 5}, 0};
  scenario.initial_position_m = {0, 0, 5};
  scenario.link.ideal = ideal;
  scenario.faults = std::move(faults);
  FlightOptions options;
  options.make_client = [&](std::size_t /*client*/, ClientHost host) {
    return std::make_unique<AskingClient>(std::move(host), requests_count);
  };
  return Fly(scenario, Model(), options);
}

faults::FaultSpec Fault(const std::string& id, const std::string& type, Target target,
                        std::map<std::string, faults::ParameterValue> parameters) {
  faults::FaultSpec fault;
  fault.id = id;
  fault.type = type;
  fault.target = target;
  fault.parameters = std::move(parameters);
  return fault;
}

std::vector<faults::FaultSpec> Stack(int count, const std::string& type, Target target, double probability) {
  std::vector<faults::FaultSpec> faults;
  for (int i = 0; i < count; ++i)
    faults.push_back(
        Fault(std::string("f").append(std::to_string(i)), type, target, {{"probability", probability}}));
  return faults;
}

// The most memory that this process had since the last ForgetPeak().
std::size_t PeakBytes() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    if (word != "VmHWM:") continue;
    std::size_t kib = 0;
    status >> kib;
    return kib << 10;
  }
  return 0;
}
void ForgetPeak() { std::ofstream("/proc/self/clear_refs") << "5"; }

// A sanitizer's own memory is not the flight's.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr std::size_t kMemoryMax = std::size_t{8} << 30;
#else
constexpr std::size_t kMemoryMax = std::size_t{256} << 20;
#endif

class OverfullTest : public ::testing::Test {
 protected:
  void SetUp() override {
    Model();
    ForgetPeak();
    before_ = PeakBytes();
  }
  void TearDown() override {
    ASSERT_GT(before_, 0U);
    EXPECT_LT(PeakBytes() - before_, kMemoryMax);
  }
  std::size_t before_ = 0;
};

TEST_F(OverfullTest, StackedDuplicatesAreAnErrorThatNamesThem) {
  for (const std::string type : {"wire.byte_duplicate", "wire.byte_insert", "frame.duplicate"})
    for (const Target target : {Target::kToClient, Target::kToPlant, Target::kReference})
      for (const bool ideal : {false, target == Target::kToClient}) {
        auto faults = Stack(30, type, target, 0.99);
        faults.push_back(Fault("innocent", "wire.bit_error", target, {{"ber", 1e-6}}));
        const RunLog log = FlyAsking(std::move(faults), ideal);
        EXPECT_EQ(log.end_reason, EndReason::kLineOverfull) << type << " " << Name(target);
        EXPECT_THAT(log.end_text, HasSubstr("8 MiB"));
        EXPECT_THAT(log.end_text, HasSubstr("multiplied by 'f0', 'f1', 'f2'"));
        EXPECT_THAT(log.end_text, Not(HasSubstr("innocent")));
      }
}

TEST_F(OverfullTest, AFewDuplicatesFillALineInTime) {
  // 2^12 requests a period are some thirty times what the line carries.
  auto faults = Stack(12, "wire.byte_duplicate", Target::kToPlant, 1.0);
  for (auto& fault : faults) fault.message = "request";
  const RunLog log = FlyAsking(std::move(faults), false, 1, 30.0);
  EXPECT_EQ(log.end_reason, EndReason::kLineOverfull);
  EXPECT_GT(log.end_ns, kNsPerS);
}

TEST_F(OverfullTest, ShortPiecesCountForWhatTheyTake) {
  auto faults = Stack(1, "frame.truncate", Target::kToClient, 1.0);
  for (auto& fault : Stack(30, "frame.duplicate", Target::kToClient, 1.0)) {
    fault.id += "twice";
    faults.push_back(fault);
  }
  const RunLog log = FlyAsking(std::move(faults));
  EXPECT_EQ(log.end_reason, EndReason::kLineOverfull);
}

TEST_F(OverfullTest, FaultsThatHoldFramesBackAreNamed) {
  std::vector<faults::FaultSpec> faults;
  for (int i = 0; i < 8; ++i)
    faults.push_back(Fault(std::string("late").append(std::to_string(i)), "frame.delay", Target::kToClient,
                           {{"mean_ms", 10'000.0}}));
  const RunLog log = FlyAsking(std::move(faults), true, 500);
  EXPECT_EQ(log.end_reason, EndReason::kLineOverfull);
  EXPECT_THAT(log.end_text, HasSubstr("held back by 'late0', 'late1'"));

  faults.clear();
  for (int i = 0; i < 300; ++i)
    faults.push_back(Fault(std::string("old").append(std::to_string(i)), "frame.replay_stale",
                           Target::kToClient, {{"probability", 0.1}, {"age_count", 10'000.0}}));
  const RunLog stale = FlyAsking(std::move(faults), true, 50);
  EXPECT_EQ(stale.end_reason, EndReason::kLineOverfull);
  EXPECT_THAT(stale.end_text, HasSubstr("held back by 'old0'"));
}

TEST_F(OverfullTest, WhatIsSentFasterThanTheLineCarriesIsTheFirmwaresDoing) {
  for (const bool ideal : {false, true}) {
    const RunLog log = FlyAsking({}, ideal, 200'000);
    EXPECT_EQ(log.end_reason, EndReason::kFirmwareHung) << ideal;
    EXPECT_THAT(log.end_text, HasSubstr("more is sent than it carries"));
  }
}

// The replies of a minute, asked for within two seconds, are all on their way at its end.
TEST_F(OverfullTest, AMinuteOfDelayFits) {
  std::vector<faults::FaultSpec> faults;
  for (int i = 0; i < 6; ++i)
    faults.push_back(Fault(std::string("late").append(std::to_string(i)), "frame.delay", Target::kToClient,
                           {{"mean_ms", 10'000.0}}));
  EXPECT_EQ(FlyAsking(std::move(faults), true, 30, 2.0).end_reason, EndReason::kCompleted);
}

TEST_F(OverfullTest, LargeActivationsAreCountedButNotKept) {
  // A reply becomes 70 kB, of which the log keeps only those of the first ten faults.
  const RunLog log = FlyAsking(Stack(12, "wire.byte_duplicate", Target::kToClient, 1.0), false, 1, 0.1);
  std::size_t kept_bytes = 0;
  for (const auto& activation : log.activations)
    for (const auto* chunks : {&activation.before, &activation.after})
      for (const auto& chunk : *chunks) {
        EXPECT_LE(chunk.bytes.size(), faults::kActivationBytesMax);
        kept_bytes += chunk.bytes.size();
      }
  EXPECT_LE(kept_bytes, faults::kActivationsBytesMax);
  EXPECT_GT(log.fault_activation_counts.at(11), 0);
}

}  // namespace
}  // namespace tiltproof::harness
