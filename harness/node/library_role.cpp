#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <utility>

#include "harness/client/firmware_files.h"
#include "harness/client/firmware_guard.h"
#include "harness/client/library_client.h"
#include "harness/node/roles.h"
#include "link/chunk.h"
#include "link/serial_port.h"

namespace tiltproof::harness {
namespace {

constexpr TimeNs kWakePauseMin = 20 * kNsPerUs;

// As good as never, and far from where times overflow: what a firmware may ask for is any number.
constexpr TimeNs kNeverInFlight = kNever / 4;

// A firmware library as a board: its clock is this node's, its UARTs are two serial ports.
class LibraryRole final : public Role {
 public:
  LibraryRole(NodeServices& services, const NodeOptions& options)
      : services_(services),
        firmware_(*options.client),
        timer_(services.loop()),
        states_(services.bus(), services.members(), InLoop(services.loop(), alive_, [this] { OnStates(); })) {
  }

  Ports Prepare(const LoadedScenario& loaded, const Ports& /*given*/) override {
    scenario_ = loaded.scenario;
    baud_ = scenario_.link.ideal ? 0 : scenario_.link.baud;
    const ClientHost host = {.transmit =
                                 [this](Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) {
                                   return Transmit(uart, Plausible(now), bytes);
                                 },
                             .log = [this](TimeNs now, std::string_view text) { Log(Plausible(now), text); }};
    try {
      client_ = LoadLibraryClient(FirmwareFile(firmware_, scenario_.firmware, scenario_.link.protocol->name),
                                  scenario_.firmware, scenario_.link.protocol->name, host,
                                  std::make_unique<CapturedOutput>());
    } catch (const FirmwareTrouble& trouble) {
      // The firmware's doing, not this node's: told like a crash in flight, once that has begun.
      trouble_ = trouble;
    }
    return {};
  }

  void Arm(const Ports& ports) override {
    Open(Uart::kMain, FindPort(ports, "client"), scenario_.link.port_baud());
    Open(Uart::kReference, FindPort(ports, "client_reference"), LinkSpec::kReferenceBaud);
  }

  void Start() override {
    power_on_ns_ = services_.clock().Now();
    if (trouble_) return Tell(*trouble_);
    Run([this] { return client_->Start(0); });
  }

  void Flush() override {
    if (origin_ns_ == kNever) return;
    for (auto& [time_ns, text] : std::exchange(lines_, {}))
      services_.log().Write(RunEvent{power_on_ns_ + time_ns - origin_ns_, "firmware_log", text});
  }

  NodeTotals Stop() override {
    timer_.cancel();
    stopped_ = true;
    ports_ = {};
    // Without t = 0 the times are those since power-on.
    if (origin_ns_ == kNever) origin_ns_ = power_on_ns_;
    Flush();
    NodeTotals totals;
    if (client_ == nullptr || lost_) return totals;
    try {
      totals.client = client_->Status();
    } catch (const FirmwareTrouble& trouble) {
      Tell(trouble);
    }
    return totals;
  }

 private:
  void Open(Uart uart, const std::string& path, std::int64_t baud) {
    auto& port = ports_[static_cast<std::size_t>(uart)];
    port = std::make_unique<link::SerialPort>(services_.loop(), path, baud);
    port->Start(
        [this, uart](std::span<const std::uint8_t> bytes) {
          if (stopped_ || power_on_ns_ == kNever) return;
          const TimeNs now = Now();
          Run([&] {
            client_->Receive(uart, now, bytes, {});
            return client_->Grant(now, kNever);
          });
        },
        [this](const std::string& reason) {
          if (!stopped_) services_.Fail(EndReason::kNodeLost, "the client's port is gone: " + reason);
        });
  }

  // The client's clock never goes back, not even when a fault sets it.
  TimeNs Now() { return now_ns_ = std::max(now_ns_, services_.clock().Now() - power_on_ns_); }
  // What the firmware says of the time, within reason.
  TimeNs Plausible(TimeNs now) {
    return power_on_ns_ == kNever ? 0 : std::clamp<TimeNs>(now, 0, std::max<TimeNs>(Now(), 0) + kNsPerS);
  }

  void Log(TimeNs now, std::string_view text) {
    if (logged_bytes_ > kFirmwareLogBytesMax) return;
    logged_bytes_ += text.size() + 1;
    lines_.emplace_back(now, text);
  }

  void Tell(const FirmwareTrouble& trouble) {
    stopped_ = lost_ = true;
    services_.Fail(trouble.hung ? EndReason::kFirmwareHung : EndReason::kFirmwareCrashed, trouble.what());
  }

  // The bytes leave at once, and the line takes their time; the firmware is told when its UART would be done.
  TimeNs Transmit(Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) {
    const auto& port = ports_[static_cast<std::size_t>(uart)];
    if (uart != Uart::kMain || stopped_ || !port) return now;
    port->Write(bytes);
    transmitter_free_ns_ =
        std::max(transmitter_free_ns_, now) + link::BytesTime(baud_, static_cast<std::int64_t>(bytes.size()));
    return transmitter_free_ns_;
  }

  // Lets the firmware run, and comes back when it wants to be woken.
  void Run(const std::function<TimeNs()>& call) {
    if (stopped_) return;
    try {
      TimeNs wake = call();
      timer_.cancel();
      if (wake > kNeverInFlight) return;
      // A firmware that always wants to be woken now must not keep this thread, which has real-time priority.
      wake = std::max(wake, Now() + kWakePauseMin);
      timer_.expires_at(services_.clock().ToSteady(power_on_ns_ + wake));
      timer_.async_wait([this, wake, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
        if (error || alive.expired() || stopped_) return;
        const TimeNs now = Now();
        // This machine's lateness, not the firmware's.
        services_.lateness().Note(power_on_ns_ + wake, power_on_ns_ + now);
        Run([&] { return client_->Grant(now, kNever); });
      });
    } catch (const FirmwareTrouble& trouble) {
      Tell(trouble);
    }
  }

  void OnStates() {
    for (const auto& state : states_.Take())
      // The plant's alone has it; the last one alone may have come.
      if (state.run_id == services_.run_id() && state.origin_ns != 0)
        origin_ns_ = services_.lateness().origin_ns = state.origin_ns;
  }

  NodeServices& services_;
  ClientSpec firmware_;
  Scenario scenario_;
  std::int64_t baud_ = 0;
  std::unique_ptr<Client> client_;
  std::array<std::unique_ptr<link::SerialPort>, 2> ports_;
  boost::asio::steady_timer timer_;
  TimeNs power_on_ns_ = kNever;
  TimeNs now_ns_ = 0;  // the latest told
  TimeNs transmitter_free_ns_ = 0;
  TimeNs origin_ns_ = kNever;  // of t = 0, in the plant's clock: that of this machine
  std::vector<std::pair<TimeNs, std::string>> lines_;
  std::size_t logged_bytes_ = 0;
  std::optional<FirmwareTrouble> trouble_;  // while it was loaded
  bool stopped_ = false, lost_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  dds::Subscriber<dds::RunState> states_;
};

}  // namespace

std::unique_ptr<Role> MakeLibraryRole(NodeServices& services, const NodeOptions& options) {
  FirmwareGuard::Install();
  return std::make_unique<LibraryRole>(services, options);
}

}  // namespace tiltproof::harness
