// A flight whose parts are in processes of their own is the same flight, to the bit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <functional>
#include <memory>

#include "harness/client/library_client.h"
#include "harness/report/trace_csv.h"
#include "harness/run/client_parameters.h"
#include "harness/run/flight.h"
#include "harness/run/remote/remote_parts.h"
#include "harness/run/remote/serve.h"
#include "harness/scenario/reader.h"
#include "harness/scenario/shipped_protocols.h"
#include "tests/harness/run/kept_records.h"

namespace tiltproof::harness {
namespace {

using ::testing::HasSubstr;

const std::string kRoot = TILTPROOF_SOURCE_DIR;

LoadedScenario Load(const std::string& yaml) {
  ReadOptions options;
  options.models_folder = kRoot + "/plant/models";
  LoadedScenario loaded;
  loaded.scenario = ParseScenario(yaml, "setup", options);
  std::vector<std::string> warnings;
  loaded.model = std::make_shared<const plant::VehicleModel>(
      plant::LoadVehicle(loaded.scenario.model_file, {}, warnings));
  return loaded;
}

// A child that serves one part; killed and reaped at the end.
class Served {
 public:
  explicit Served(const std::function<void(Channel&)>& serve) {
    std::array<int, 2> sockets{};
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets.data()) != 0)
      throw std::runtime_error("socketpair");
    pid_ = fork();
    if (pid_ == 0) {
      close(sockets[0]);
      serve(*MakeUnixChannel(sockets[1]));
      _exit(0);
    }
    close(sockets[1]);
    channel_ = MakeUnixChannel(sockets[0], pid_);
  }
  ~Served() {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  Served(const Served&) = delete;
  Served& operator=(const Served&) = delete;
  Channel& channel() { return *channel_; }
  pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
  std::unique_ptr<Channel> channel_;
};

struct Parts {
  Served line{[](Channel& channel) { ServeLine(channel, Load); }};
  Served plant{[](Channel& channel) { ServePlant(channel, Load); }};
  Served client{[](Channel& channel) { ServeClient(channel, Load); }};
};

RunLog FlyApart(Parts& parts, const std::string& yaml, const std::function<void(BootTime)>& at = {}) {
  const Setup setup{yaml, std::string("library:") + TILTPROOF_FIRMWARE_LIBRARY};
  const LoadedScenario loaded = Load(yaml);
  const VehicleSignals signals = loaded.model->signals();
  LogBuilder log(loaded.scenario, signals);
  RemoteLine line(parts.line.channel(), setup, *loaded.scenario.link.protocol, log);
  RemotePlantServer plant(parts.plant.channel(), setup, log);
  FlightOptions options;
  options.make_client = [&](std::size_t /*client*/, ClientHost host) {
    if (at) {
      host.transmit = [&at, transmit = host.transmit](Uart uart, BootTime now,
                                                      std::span<const std::uint8_t> bytes) {
        at(now);
        return transmit(uart, now, bytes);
      };
    }
    return MakeRemoteClient(parts.client.channel(), setup, std::move(host));
  };
  Line* lines[] = {&line};
  return Conduct(loaded.scenario, lines, plant, log, options);
}

RunLog FlyTogether(const std::string& yaml) {
  const LoadedScenario loaded = Load(yaml);
  FlightOptions options;
  options.make_client = [&](std::size_t /*client*/, ClientHost host) {
    return LoadLibraryClient(TILTPROOF_FIRMWARE_LIBRARY, loaded.scenario.firmware,
                             loaded.scenario.link.protocol->name, std::move(host), nullptr, false,
                             [&] { return ClientParameters(loaded.scenario, *loaded.model); });
  };
  return Fly(loaded.scenario, *loaded.model, options);
}

const char* const kFaulty = R"yaml(
name: remote
model: tiltrotor
firmware: tolerant
seed: 11
duration_s: 6
reference: {type: spiral}
faults:
  - {id: bits, type: wire.bit_error, target: both, start_s: 1, end_s: 4, parameters: {ber: 0.0002}}
  - {id: late, type: frame.delay, target: to_plant, start_s: 2, parameters: {mean_ms: 1, jitter_ms: 0.5, distribution: normal}}
  - {id: skewed, type: sensor.bias, start_s: 3, parameters: {signal: x_m, offset: 0.05}}
  - {id: weak, type: actuator.loss_of_effectiveness, start_s: 4, parameters: {actuator: f_r, factor: 0.98}}
criteria:
  - {name: near, stl: "always(position_error_m <= 5.0)"}
)yaml";

TEST(Remote, FlightInFourProcessesEqualsFlightInOne) {
  const RunLog together = FlyTogether(kFaulty);
  Parts parts;
  const RunLog apart = FlyApart(parts, kFaulty);
  ASSERT_EQ(apart.end_reason, EndReason::kCompleted) << apart.end_text;
  EXPECT_EQ(TraceHash(apart.trace), TraceHash(together.trace));
  EXPECT_EQ(apart.link.content(), together.link.content());
  EXPECT_EQ(apart.clients[0].firmware_log, together.clients[0].firmware_log);
  EXPECT_EQ(apart.fault_activation_counts, together.fault_activation_counts);
  EXPECT_EQ(apart.clients[0].reply_latency_ns, together.clients[0].reply_latency_ns);
  EXPECT_EQ(apart.events.size(), together.events.size());
  EXPECT_EQ(apart.activations.size(), together.activations.size());
  EXPECT_EQ(apart.clients[0].failsafe_entered_count, together.clients[0].failsafe_entered_count);
  EXPECT_GT(apart.fault_activation_counts.at(0), 0);
}

const char* const kStreamProtocol = R"yaml(
protocol: stream
control_period_ms: 4
framing: {type: cobs, check: crc16_ibm_3740}
exchange: stream
start: {first: actuators}
messages:
  - name: state
    id: 1
    from: server
    period_ms: 4
    fields:
      - {signal: sequence, type: u8}
      - {signal: x_m, type: i16, scale: 0.001}
      - {signal: y_m, type: i16, scale: 0.001}
      - {signal: z_m, type: i16, scale: 0.001}
      - {signal: quaternion_w, type: i16, scale: 0.00004}
      - {signal: quaternion_x, type: i16, scale: 0.00004}
      - {signal: quaternion_y, type: i16, scale: 0.00004}
      - {signal: quaternion_z, type: i16, scale: 0.00004}
      - {signal: vx_m_s, type: i16, scale: 0.001}
      - {signal: vy_m_s, type: i16, scale: 0.001}
      - {signal: vz_m_s, type: i16, scale: 0.001}
      - {signal: wx_rad_s, type: i16, scale: 0.001}
      - {signal: wy_rad_s, type: i16, scale: 0.001}
      - {signal: wz_rad_s, type: i16, scale: 0.001}
  - name: actuators
    id: 2
    from: client
    fields:
      - {signal: time_us, type: u32}
      - {signal: f_front_left_n, type: u16, scale: 0.00002, as: share_of_speed}
      - {signal: f_front_right_n, type: u16, scale: 0.00002, as: share_of_speed}
      - {signal: f_back_right_n, type: u16, scale: 0.00002, as: share_of_speed}
      - {signal: f_back_left_n, type: u16, scale: 0.00002, as: share_of_speed}
  - name: reference
    from: server
    line: reference
    fields: [{signal: x_m, type: f32}, {signal: y_m, type: f32}, {signal: z_m, type: f32}, {signal: yaw_rad, type: f32}]
frames: {world: ned, body: frd}
)yaml";

TEST(Remote, AStreamInOtherAxesIsTheSameOverProcesses) {
  const std::string file = ::testing::TempDir() + "remote_stream.yaml";
  std::ofstream(file) << kStreamProtocol;
  const std::string scenario =
      "name: stream\nmodel: quadrotor\nfirmware: lqr\nduration_s: 3\nstep_s: 0.002\nlink: {protocol: " +
      file +
      "}\ninitial: {position_m: [0.3, 0.2, 5]}\nreference: {type: hover, at_m: [0, 0, 5]}\nfaults:\n"
      "  - {id: bits, type: wire.bit_error, target: both, start_s: 1, end_s: 2, parameters: {ber: 0.0002}}\n"
      "  - {id: bias, type: sensor.bias, start_s: 1, parameters: {signal: x_m, offset: 0.01}}\n";
  const RunLog together = FlyTogether(scenario);
  ASSERT_EQ(together.end_reason, EndReason::kCompleted) << together.end_text;
  EXPECT_GT(together.clients[0].actuator_times_ns.size(), 700U);
  Parts parts;
  const RunLog apart = FlyApart(parts, scenario);
  ASSERT_EQ(apart.end_reason, EndReason::kCompleted) << apart.end_text;
  EXPECT_EQ(TraceHash(apart.trace), TraceHash(together.trace));
  EXPECT_EQ(apart.link.content(), together.link.content());
  EXPECT_EQ(apart.events.size(), together.events.size());
}

// Kills the process `pid` once the flight has reached two seconds.
std::function<void(BootTime)> KillAtTwoSeconds(pid_t pid) {
  return [pid](BootTime now) {
    if (now >= BootTime(2 * kNsPerS)) kill(pid, SIGKILL);
  };
}

TEST(Remote, FirmwareProcessKilledIsTheFirmwaresFailure) {
  Parts parts;
  const RunLog log = FlyApart(parts, kFaulty, KillAtTwoSeconds(parts.client.pid()));
  EXPECT_EQ(log.end_reason, EndReason::kFirmwareCrashed);
  EXPECT_THAT(log.end_text, HasSubstr("firmware"));
  EXPECT_GE(log.trace.row_count(), 160U);  // what was flown is kept
}

TEST(Remote, PlantOrLineProcessKilledIsAnErrorThatNamesIt) {
  {
    Parts parts;
    const RunLog log = FlyApart(parts, kFaulty, KillAtTwoSeconds(parts.plant.pid()));
    EXPECT_EQ(log.end_reason, EndReason::kHarnessError);
    EXPECT_THAT(log.end_text, HasSubstr("plant"));
    EXPECT_GE(log.trace.row_count(), 100U);
  }
  Parts parts;
  const RunLog log = FlyApart(parts, kFaulty, KillAtTwoSeconds(parts.line.pid()));
  EXPECT_EQ(log.end_reason, EndReason::kHarnessError);
  EXPECT_THAT(log.end_text, HasSubstr("link"));
  EXPECT_GE(log.trace.row_count(), 160U);
  // The records up to a batch before its death are kept.
  EXPECT_GE(log.clients[0].reply_latency_ns.size(), 100U);
}

TEST(Remote, ScenarioThatTheOtherProcessCannotReadIsSaid) {
  Parts parts;
  const harness::Setup setup{"name: [", ""};
  try {
    KeptRecords records;
    RemoteLine line(parts.line.channel(), setup, *FindProtocol("paper"), records);
    FAIL() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("the link process: setup:1"));
  }
}

}  // namespace
}  // namespace tiltproof::harness
