#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "faults/device_command.h"
#include "faults/schedule.h"
#include "harness/client/client.h"
#include "harness/client/emulator_limits.h"
#include "harness/client/firmware_files.h"
#include "harness/emulator/elf_symbols.h"
#include "harness/node/emulated_board.h"
#include "harness/node/roles.h"
#include "harness/run/client_channel.h"
#include "harness/run/line.h"
#include "harness/run/realtime/client_parts.h"
#include "harness/run/realtime/log_messages.h"
#include "link/overloaded.h"

namespace tiltproof::harness {
namespace {

constexpr int kStatusWords = 2;

// An image for a board as the firmware, in stock QEMU: its USARTs are the link node's sockets, and the faults on the
// device are carried out here.
class EmulatorRole final : public Role {
 public:
  EmulatorRole(NodeServices& services, const NodeOptions& options)
      : services_(services),
        image_(std::get<EmulatedImage>(*options.client)),
        client_id_(options.id),
        timer_(services.loop()),
        states_(services.bus(), services.members(), InLoop(services.loop(), alive_, [this] { OnStates(); })) {
  }

  Ports Prepare(const LoadedScenario& loaded, const ClientKinds& /*clients*/) override {
    scenario_ = loaded.scenario;
    place_ = ClientPlace(scenario_, client_id_);
    spec_ = BoardOf(image_, scenario_.firmware_of(place_), *scenario_.link.protocol, place_,
                    LinesOf(scenario_, place_));
    const ElfSymbols symbols(spec_.image);
    if (const auto region = symbols.FindRegion(kStatusSymbol)) status_address_ = region->address;
    if (const auto region = symbols.FindRegion(kRoleSymbol); region && scenario_.has_several_clients())
      role_ = region;
    NeedRole(scenario_, place_, role_.has_value());
    counts_.emplace(ClientFaults(scenario_, place_));
    for (faults::DeviceCommand& command : ClientCommands(scenario_, place_)) {
      std::vector<MemoryBit> bits;
      if (const auto* flips = std::get_if<faults::FlipBits>(&command.action))
        bits = DrawBits(*flips, symbols);
      commands_.push_back({std::move(command), std::move(bits)});
    }
    return {};
  }

  void Arm(const Ports& ports) override {
    BoardWiring wiring{.main_port = FindPort(ports, PartName(scenario_, "client", place_)),
                       .reference_port = FindPort(ports, PartName(scenario_, "client_reference", place_))};
    for (const std::string& line : LinesOf(scenario_, place_))
      wiring.line_ports.push_back(FindPort(ports, LinePortName(line, scenario_.client_id(place_))));
    for (const auto& planned : commands_) wiring.debugger |= !planned.bits.empty();
    board_.emplace(services_, scenario_, spec_, wiring,
                   EmulatedBoard::Callbacks{.reset = [this](bool by_firmware) { OnReset(by_firmware); },
                                            .lost =
                                                [this](EndReason reason, const std::string& text) {
                                                  if (!stopped_) services_.Fail(reason, text);
                                                },
                                            .time_text = [this](BootTime at) { return TimeText(at); }});
  }

  void Start() override {
    power_on_ns_ = services_.clock().Now();
    board_->PowerOn();
  }

  void Flush() override {
    if (!board_) return;
    board_->Watch(origin_.known());
    role_ ? AskRole() : AskStatus();
    if (!origin_.known()) return;
    WriteLines(false);
    WriteActivations();
  }

  void Stop() override {
    stopped_ = true;
    timer_.cancel();
    agenda_.clear();
    if (board_) board_->NoteLostTicks();
    const std::string state = board_ ? board_->State(origin_.known()) : "";
    if (!state.empty()) Note(kBoardStateEvent, state);
    // Without t = 0 the times are those since power-on.
    if (!origin_.known()) origin_ = Origin(power_on_ns_);
    if (board_) {
      record::ClientEnd totals;
      for (auto& [at, block] : board_->Unmodelled()) {
        const TimeNs time_ns = origin_.SimulationTime(at);
        const std::string text = "the firmware uses " + block.text;
        services_.Note(time_ns, kUnmodelledEvent, text, Whose(scenario_, place_));
        services_.log().Write({time_ns, place_, record::FirmwareText{text}});
        totals.unmodelled_blocks.push_back(std::move(block.name));
      }
      WriteLines(true);
      WriteActivations();
      services_.log().Write({0, place_, record::ActivationCounts{counts_->ActivationCounts()}});
      if (status_) totals.failsafe_entered_count = status_->failsafe_count;
      services_.log().Write({0, place_, std::move(totals)});
    }
    board_.reset();
  }

 private:
  struct PlannedCommand {
    faults::DeviceCommand command;
    std::vector<MemoryBit> bits;
  };

  static std::vector<MemoryBit> DrawBits(const faults::FlipBits& flips, const ElfSymbols& symbols) {
    const MemoryRegion region = symbols.Region(flips.region);
    std::vector<MemoryBit> bits;
    for (const faults::BitFlip& flip : faults::DrawBitFlips(flips, region.size_bytes))
      bits.push_back({region.address + flip.byte_offset, flip.bit});
    return bits;
  }

  TimeNs SimNow() { return origin_.SimulationTime(services_.clock().Now()); }

  std::string TimeText(BootTime at) const {
    return origin_.known() ? fmt::format("t = {:.3f} s", ToSeconds(origin_.SimulationTime(at)))
                           : fmt::format("{:.3f} s after power-on", ToSeconds(at - power_on_ns_));
  }

  void Note(std::string kind, std::string text) {
    const TimeNs time_ns = origin_.known() ? SimNow() : 0;
    services_.Note(time_ns, std::move(kind), std::move(text), Whose(scenario_, place_));
  }

  void WriteActivations() {
    for (faults::Activation& activation : counts_->TakeActivations()) {
      const TimeNs time_ns = activation.time_ns;
      services_.log().Write({time_ns, place_, std::move(activation)});
    }
  }

  // The status comes next: the board answers one question at a time.
  void AskRole() {
    board_->ReadWords(role_->address, 1, [this](const std::vector<std::uint32_t>& words) {
      const std::size_t bytes_count = std::min<std::size_t>(role_->size_bytes, sizeof(std::uint32_t));
      const auto role = static_cast<std::uint32_t>(words[0] & ((std::uint64_t{1} << (8 * bytes_count)) - 1));
      if (origin_.known()) services_.log().Write({SimNow(), place_, record::Role{role}});
      services_.TellRole(role);
      AskStatus();
    });
  }

  void AskStatus() {
    if (!status_address_ || !origin_.known()) return;
    board_->ReadWords(*status_address_, kStatusWords, [this](const std::vector<std::uint32_t>& words) {
      status_ = ClientStatus{.supervisor_state = words[0], .failsafe_count = words[1]};
      services_.log().Write({SimNow(), place_, record::State{words[0]}});
    });
  }

  void WriteLines(bool last) {
    for (auto& line : board_->TakeLines(last))
      services_.log().Write(
          {origin_.SimulationTime(line.time_ns), place_, record::FirmwareText{std::move(line.text)}});
  }

  void OnReset(bool by_firmware) {
    const auto time_text = [this](TimeNs at) { return TimeText(BootTime(at)); };
    if (stopped_ || !limits_.Broken(time_text).empty()) return;
    const std::string how = by_firmware ? "reset by the firmware itself" : "reset by pin";
    Note(kResetEvent, how);
    if (!by_firmware) return;
    limits_.OnReset(services_.clock().Now().ns(), how);
    if (const std::string broken = limits_.Broken(time_text); !broken.empty())
      services_.Fail(EndReason::kFirmwareCrashed, broken);
  }

  // t = 0 is known: the faults on the board get their times.
  void OnStates() {
    for (const auto& state : states_.Take()) {
      // Only the plant's state has it; perhaps only the last state has arrived.
      if (state.run_id != services_.run_id() || origin_.known() || state.origin_ns == 0) continue;
      origin_ = services_.lateness().origin = Origin(BootTime(state.origin_ns));
      // A node that was started again in flight has missed what was before.
      for (const PlannedCommand& planned : commands_)
        if (origin_.ToBootTime(planned.command.at_ns) >= power_on_ns_) Plan(planned);
      Wake();
    }
  }

  void Plan(const PlannedCommand& planned) {
    const faults::DeviceCommand& command = planned.command;
    const auto at = [&](TimeNs time_ns, std::function<void()> act) {
      if (time_ns != kNever) agenda_.emplace(origin_.ToBootTime(time_ns), std::move(act));
    };
    // Refused before the flight (harness/scenario/fault_support.h).
    const auto refuse = [&] {
      services_.Fail(EndReason::kNodeLost,
                     fmt::format("fault '{}': {} cannot be had in real time",
                                 scenario_.faults[command.fault].id, scenario_.faults[command.fault].type));
    };
    std::visit(
        Overloaded{[&](const faults::ResetProcessor&) {
                     at(command.at_ns, [this, &command] {
                       board_->BeginReset();
                       counts_->Count(command.fault, SimNow(), "reset by pin");
                     });
                     at(command.until_ns, [this] { board_->EndReset(); });
                   },
                   [&](const faults::StallProcessor&) {
                     at(command.at_ns, [this, &command] {
                       board_->BeginStall();
                       const std::string what = "the processor executes nothing";
                       counts_->Count(command.fault, SimNow(), what);
                       Note("device_stopped", what);
                     });
                     at(command.until_ns, [this] {
                       board_->EndStall();
                       Note("device_runs", "the processor runs again");
                     });
                   },
                   [&](const faults::FlipBits&) { at(command.at_ns, [this, &planned] { Flip(planned); }); },
                   [&](const faults::ResetByWatchdog&) { refuse(); },
                   [&](const faults::HangProcessor&) { refuse(); },
                   [&](const faults::DelayTask&) { refuse(); },
                   [&](const faults::SlowProcessor&) { refuse(); },
                   [&](const faults::DriftClock&) { refuse(); }, [&](const faults::JumpClock&) { refuse(); }},
        command.action);
  }

  void Flip(const PlannedCommand& planned) {
    board_->Flip(
        planned.bits, [this, &planned](const std::string& error, const std::vector<FlippedByte>& flipped) {
          if (stopped_) return;
          for (const FlippedByte& byte : flipped) {
            const std::string what =
                fmt::format("0x{:08x}: 0x{:02x} -> 0x{:02x}", byte.address, byte.before, byte.after);
            counts_->Count(planned.command.fault, SimNow(), what);
            Note("bit_flipped", what);
          }
          if (!error.empty())
            services_.Fail(EndReason::kNodeLost,
                           fmt::format("fault '{}': {}", scenario_.faults[planned.command.fault].id, error));
        });
  }

  // Does what is due, and comes back for the rest.
  void Wake() {
    const BootTime now = services_.clock().Now();
    while (!agenda_.empty() && agenda_.begin()->first <= now) {
      const auto due = agenda_.extract(agenda_.begin());
      due.mapped()();
    }
    if (agenda_.empty()) return;
    timer_.expires_at(services_.clock().ToSteady(agenda_.begin()->first));
    timer_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
      if (!error && !alive.expired() && !stopped_) Wake();
    });
  }

  NodeServices& services_;
  EmulatedImage image_;
  std::string client_id_;
  std::size_t place_ = 0;  // in the scenario
  Scenario scenario_;
  EmulatorSpec spec_;
  std::optional<std::uint32_t> status_address_;
  std::optional<MemoryRegion> role_;  // the variable with the board's role among several
  std::optional<ClientStatus> status_;
  std::vector<PlannedCommand> commands_;
  std::optional<faults::FaultSchedule> counts_;
  std::multimap<BootTime, std::function<void()>> agenda_;  // by the node's clock
  boost::asio::steady_timer timer_;
  std::optional<EmulatedBoard> board_;
  BootTime power_on_ns_;
  Origin origin_;  // in the plant's clock: that of this machine
  EmulatorLimits limits_;
  bool stopped_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  dds::Subscriber<dds::RunState> states_;
};

}  // namespace

std::unique_ptr<Role> MakeEmulatorRole(NodeServices& services, const NodeOptions& options) {
  return std::make_unique<EmulatorRole>(services, options);
}

}  // namespace tiltproof::harness
