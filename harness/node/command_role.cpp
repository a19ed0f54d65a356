#include <fmt/format.h>

#include <array>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "harness/client/serial_program.h"
#include "harness/node/client_ports.h"
#include "harness/node/cpu_wait_watch.h"
#include "harness/node/firmware_process.h"
#include "harness/node/firmware_use_watch.h"
#include "harness/node/roles.h"
#include "harness/process/orphans.h"
#include "harness/run/client_parameters.h"
#include "harness/run/realtime/client_parts.h"
#include "harness/scenario/protocol_file.h"

namespace tiltproof::harness {
namespace {

// Ends of a shell that could not start a command (POSIX 2.8.2), each with its reason.
constexpr std::array<std::pair<std::string_view, std::string_view>, 2> kNotStarted = {
    {{"exited with code 127", "was not found"}, {"exited with code 126", "may not be executed"}}};

// A user's program as the firmware, its serial lines on pseudo-terminals. This node starts it, keeps what it
// prints, and says how it ended.
class CommandRole final : public Role {
 public:
  CommandRole(NodeServices& services, const NodeOptions& options)
      : services_(services),
        command_(std::get<Program>(*options.client).command),
        client_id_(options.id),
        cable_(options.cable),
        origin_watch_(services, cable_.has_value(),
                      [this](Origin origin) { services_.lateness().origin = origin; }) {}

  Ports Prepare(const LoadedScenario& loaded, const ClientKinds& /*clients*/) override {
    scenario_ = loaded.scenario;
    place_ = ClientPlace(scenario_, client_id_);
    NeedRole(scenario_, place_, false);
    parameters_ = ClientParameters(loaded.scenario, *loaded.model, place_);
    return {};
  }

  void Arm(const Ports& ports) override { ports_ = ClientPortsOf(ports, cable_, scenario_, place_); }

  void Start() override {
    log_origin_ = Origin(services_.clock().Now());
    const SerialProgram program = {.command = command_,
                                   .port = ports_.main,
                                   .reference_port = ports_.reference,
                                   .baud = scenario_.link.port_baud(),
                                   .reference_baud = scenario_.link.reference_port_baud(),
                                   .firmware = scenario_.firmware_of(place_),
                                   .dialect = DialectOf(*scenario_.link.protocol),
                                   .parameters = parameters_,
                                   .line_ports = LinePorts()};
    ChildSpec spec;
    spec.command = {"/bin/sh", "-c", CommandOf(program)};
    spec.environment = EnvironmentOf(program);
    spec.guard_group = true;
    AdoptOrphans();
    process_.emplace(services_, spec, [this](const std::string& how) {
      Flush();
      // No firmware has flown: the command is wrong. In flight these codes are the firmware's own.
      for (const auto& [code, what] : kNotStarted)
        if (how == code && !services_.lateness().origin.known())
          return services_.Fail(
              EndReason::kNodeLost,
              fmt::format("the command of --client process: {} (the shell {}): {}; give the "
                          "program's path, and look at firmware.log",
                          what, how, command_));
      services_.Fail(EndReason::kFirmwareLost,
                     fmt::format("the firmware's process {} (command: {})", how, command_));
    });
    watch_.emplace(services_, scenario_, process_->child().pid(), CpuWait::Of::kFamily);
    use_.emplace(services_);
  }

  void Flush() override {
    if (!process_) return;
    for (auto& line : process_->TakeLines())
      services_.log().Write(
          {log_origin_.SimulationTime(line.time_ns), place_, record::FirmwareText{std::move(line.text)}});
  }

  void Stop() override {
    if (process_) process_->ReadAll();
    Flush();
    if (use_)
      services_.log().Write({0, place_, record::FirmwareTime{use_->Take(), services_.lateness().zero()}});
    use_.reset();
    watch_.reset();
    process_.reset();
    EndOrphans();
  }

 private:
  std::vector<std::pair<std::string, std::string>> LinePorts() const {
    std::vector<std::pair<std::string, std::string>> ports;
    for (const std::string& line : LinesOf(scenario_, place_))
      ports.emplace_back(line, ports_.lines.at(ports.size()));
    return ports;
  }

  NodeServices& services_;
  std::string command_, client_id_;
  std::optional<SerialBoard> cable_;
  std::size_t place_ = 0;  // in the scenario
  Scenario scenario_;
  std::string parameters_;  // TiltproofHost::parameters of firmware/tiltproof_client.h
  ClientPorts ports_;
  std::optional<FirmwareProcess> process_;
  std::optional<CpuWaitWatch> watch_;
  std::optional<FirmwareUseWatch> use_;
  Origin log_origin_;  // the firmware's lines have the time since power-on
  OriginWatch origin_watch_;
};

}  // namespace

std::unique_ptr<Role> MakeCommandRole(NodeServices& services, const NodeOptions& options) {
  return std::make_unique<CommandRole>(services, options);
}

}  // namespace tiltproof::harness
