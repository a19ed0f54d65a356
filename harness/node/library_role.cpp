#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <utility>

#include "harness/client/firmware_files.h"
#include "harness/client/firmware_guard.h"
#include "harness/client/library_client.h"
#include "harness/client/make_client.h"
#include "harness/node/client_ports.h"
#include "harness/node/roles.h"
#include "harness/run/client_parameters.h"
#include "harness/run/realtime/client_parts.h"
#include "harness/scenario/protocol_file.h"
#include "link/chunk.h"
#include "link/serial_port.h"

namespace tiltproof::harness {
namespace {

constexpr TimeNs kWakePauseMin = 20 * kNsPerUs;
// A firmware whose supervisor never rests must not fill the log.
constexpr std::size_t kToldChangesMax = 20'000;

// As good as never, and far from where times overflow: what a firmware may ask for is any number.
constexpr BootTime kNeverInFlight(kNever / 4);

// A firmware library as a board: its clock is this node's, its UARTs are two serial ports.
class LibraryRole final : public Role {
 public:
  LibraryRole(NodeServices& services, const NodeOptions& options)
      : services_(services),
        firmware_(*options.client),
        client_id_(options.id),
        cable_(options.cable),
        timer_(services.loop()),
        origin_watch_(services, cable_.has_value(),
                      [this](Origin origin) { origin_ = services_.lateness().origin = origin; }) {}

  Ports Prepare(const LoadedScenario& loaded, const ClientKinds& /*clients*/) override {
    scenario_ = loaded.scenario;
    place_ = ClientPlace(scenario_, client_id_);
    const std::string& build = scenario_.firmware_of(place_);
    rates_.assign(static_cast<std::size_t>(Uart::kFirstLine), scenario_.link.main_rate());
    for (const LineEndId& end : scenario_.line_ends_of(place_))
      rates_.push_back(scenario_.lines[end.line].rate());
    ports_.resize(rates_.size());
    transmitter_free_ns_.resize(rates_.size());
    const ClientHost host = {
        .transmit =
            [this](Uart uart, BootTime now, std::span<const std::uint8_t> bytes) {
              return Transmit(uart, Plausible(now), bytes);
            },
        .log = [this](BootTime now, std::string_view text) { Log(Plausible(now), text); },
        .models_computing = false};
    std::function<std::string()> parameters;
    if (TakesParameters(std::get<HostLibrary>(firmware_), build))
      parameters = [this, &loaded] { return ClientParameters(loaded.scenario, *loaded.model, place_); };
    const std::string dialect = DialectOf(*scenario_.link.protocol);
    const std::filesystem::path file = FirmwareFile(firmware_, build, dialect);
    NeedRole(scenario_, place_, TellsRole(file));
    try {
      client_ = LoadLibraryClient(file, build, dialect, host, std::make_unique<CapturedOutput>(), false,
                                  parameters);
    } catch (const FirmwareTrouble& trouble) {
      // The firmware's doing, not this node's: told like a crash in flight, once that has begun.
      trouble_ = trouble;
    }
    return {};
  }

  void Arm(const Ports& ports) override {
    const ClientPorts own = ClientPortsOf(ports, cable_, scenario_, place_);
    Open(Uart::kMain, own.main, scenario_.link.port_baud());
    if (!own.reference.empty()) Open(Uart::kReference, own.reference, scenario_.link.reference_port_baud());
    for (std::size_t line = 0; line < own.lines.size(); ++line)
      Open(LineUart(line), own.lines[line], rates_.at(static_cast<std::size_t>(LineUart(line))).baud);
  }

  void Start() override {
    power_on_ns_ = services_.clock().Now();
    if (trouble_) return Tell(*trouble_);
    Run([this] { return client_->Start(BootTime()); });
  }

  void Flush() override {
    if (!origin_.known()) return;
    for (auto& [time, text] : std::exchange(lines_, {}))
      services_.log().Write(
          {origin_.SimulationTime(OfNode(time)), place_, record::FirmwareText{std::move(text)}});
    for (const auto& [time, state] : std::exchange(state_.to_write, {}))
      services_.log().Write({origin_.SimulationTime(OfNode(time)), place_, record::State{state}});
    for (const auto& [time, role] : std::exchange(role_.to_write, {}))
      services_.log().Write({origin_.SimulationTime(OfNode(time)), place_, record::Role{role}});
  }

  void Stop() override {
    NoteOverdue();
    timer_.cancel();
    stopped_ = true;
    ports_.clear();
    // Without t = 0 the times are those since power-on.
    if (!origin_.known()) origin_ = Origin(power_on_ns_);
    Flush();
    record::ClientEnd totals;
    if (client_ != nullptr && !lost_) {
      try {
        if (const auto status = client_->Status()) totals.failsafe_entered_count = status->failsafe_count;
      } catch (const FirmwareTrouble& trouble) {
        Tell(trouble);
      }
    }
    if (scenario_.has_several_clients() && loss_) {
      loss_->time_ns = origin_.SimulationTime(OfNode(now_ns_));
      totals.loss = loss_;
    }
    if (loss_ && !MayLose(scenario_, place_)) totals.firmware_end = loss_->end;
    services_.log().Write({0, place_, std::move(totals)});
  }

 private:
  void Open(Uart uart, const std::string& path, std::int64_t baud) {
    auto& port = ports_[static_cast<std::size_t>(uart)];
    const link::CharacterFormat character =
        uart < Uart::kFirstLine ? scenario_.link.character : link::CharacterFormat{};
    port = std::make_unique<link::SerialPort>(services_.loop(), path, baud, character);
    port->Start(
        [this, uart](std::span<const std::uint8_t> bytes) {
          if (stopped_ || power_on_ns_ == BootTime::Never()) return;
          const BootTime now = Now();
          Run([&] {
            client_->Receive(uart, now, bytes, {});
            return client_->Grant(now, BootTime::Never());
          });
        },
        [this](const std::string& reason) {
          if (!stopped_) services_.Fail(EndReason::kNodeLost, "the client's port is gone: " + reason);
        });
  }

  // The client's clock counts from its power-on. It never goes back, not even when a fault sets this node's.
  BootTime Now() { return now_ns_ = std::max(now_ns_, BootTime(services_.clock().Now() - power_on_ns_)); }
  // By this node's clock.
  BootTime OfNode(BootTime of_client) const { return power_on_ns_ + of_client.ns(); }
  // The firmware's time, limited to 0 .. 1 s after the present; 0 before power-on.
  BootTime Plausible(BootTime now) {
    if (power_on_ns_ == BootTime::Never()) return BootTime();
    return std::clamp(now, BootTime(), std::max(Now(), BootTime()) + kNsPerS);
  }

  void Log(BootTime now, std::string_view text) {
    if (logged_bytes_ > kFirmwareLogBytesMax) return;
    logged_bytes_ += text.size() + 1;
    lines_.emplace_back(now, text);
  }

  void Tell(const FirmwareTrouble& trouble) {
    stopped_ = lost_ = true;
    if (!loss_) loss_ = {.hung = trouble.hung, .text = trouble.what(), .end = trouble.end};
    services_.Fail(trouble.hung ? EndReason::kFirmwareHung : EndReason::kFirmwareCrashed, trouble.what());
  }

  // The bytes leave at once, and the line takes their time; the firmware is told when its UART would be done.
  BootTime Transmit(Uart uart, BootTime now, std::span<const std::uint8_t> bytes) {
    const auto place = static_cast<std::size_t>(uart);
    if (uart == Uart::kReference || place >= ports_.size() || stopped_ || !ports_[place]) return now;
    ports_[place]->Write(bytes);
    BootTime& free_ns = transmitter_free_ns_[place];
    free_ns = std::max(free_ns, now) + rates_[place].BytesTime(static_cast<std::int64_t>(bytes.size()));
    return free_ns;
  }

  // Lets the firmware run, and comes back when it wants to be woken.
  void Run(const std::function<BootTime()>& call) {
    if (stopped_) return;
    NoteOverdue();
    try {
      BootTime wake = call();
      NoteState();
      timer_.cancel();
      if (wake > kNeverInFlight) return;
      // A firmware that always wants to be woken now must not keep this thread, which has real-time priority.
      wake = std::max(wake, Now() + kWakePauseMin);
      wake_ns_ = wake;
      timer_.expires_at(services_.clock().ToSteady(OfNode(wake)));
      timer_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
        if (!error && !alive.expired()) Run([&] { return client_->Grant(Now(), BootTime::Never()); });
      });
    } catch (const FirmwareTrouble& trouble) {
      Tell(trouble);
    }
  }

  // This machine's lateness, not the firmware's. Bytes, or the end of the flight, may come before a timer that is
  // overdue.
  void NoteOverdue() {
    const BootTime due = std::exchange(wake_ns_, BootTime::Never());
    if (due != BootTime::Never()) services_.lateness().Note(OfNode(due), OfNode(Now()));
  }

  // Keeps what it tells of itself, when that is something else than before.
  void NoteState() {
    const ClientSample sample = client_->Sample();
    const auto note = [this](const std::optional<std::uint32_t>& value, Told& told) {
      if (!value || value == told.last || told.changes_count == kToldChangesMax) return;
      ++told.changes_count;
      told.last = value;
      told.to_write.emplace_back(Now(), *value);
    };
    note(sample.supervisor_state, state_);
    note(sample.role, role_);
    if (sample.role) services_.TellRole(*sample.role);
  }

  // A number that the firmware tells of itself, from a time on; and the last one.
  struct Told {
    std::vector<std::pair<BootTime, std::uint32_t>> to_write;
    std::optional<std::uint32_t> last;
    std::size_t changes_count = 0;
  };

  NodeServices& services_;
  ClientSpec firmware_;
  std::string client_id_;
  std::optional<SerialBoard> cable_;
  std::size_t place_ = 0;  // in the scenario
  Scenario scenario_;
  std::unique_ptr<Client> client_;
  // By the number of the UART: main line, line for references, lines to other boards.
  std::vector<link::LineRate> rates_;
  std::vector<std::unique_ptr<link::SerialPort>> ports_;
  std::vector<BootTime> transmitter_free_ns_;
  boost::asio::steady_timer timer_;
  BootTime wake_ns_ = BootTime::Never();  // which it waits for, by the client's clock
  BootTime power_on_ns_ = BootTime::Never();
  BootTime now_ns_;  // the latest told
  Origin origin_;    // in this node's clock
  std::vector<std::pair<BootTime, std::string>> lines_;
  Told state_, role_;  // of the supervisor, and among several clients
  std::size_t logged_bytes_ = 0;
  std::optional<FirmwareTrouble> trouble_;  // while it was loaded
  std::optional<ClientLoss> loss_;
  bool stopped_ = false, lost_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  OriginWatch origin_watch_;
};

}  // namespace

std::unique_ptr<Role> MakeLibraryRole(NodeServices& services, const NodeOptions& options) {
  FirmwareGuard::Install();
  return std::make_unique<LibraryRole>(services, options);
}

}  // namespace tiltproof::harness
