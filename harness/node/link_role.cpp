#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "harness/node/pty_canary.h"
#include "harness/node/roles.h"
#include "harness/run/framed.h"
#include "link/messages.h"
#include "link/pty.h"
#include "link/serial_port.h"

namespace tiltproof::harness {
namespace {

using link::Direction;

constexpr std::array kDirections = {Direction::kToPlant, Direction::kToClient, Direction::kReference};
// A client whose answers take longer than this at the median sits behind a buffering adapter, most likely: it
// eats the vehicle's delay margin of 9 ms.
constexpr TimeNs kSlowRoundTripNs = 4 * kNsPerMs;
constexpr std::size_t kRoundTripSampleCount = 50;

class LinkRole final : public Role {
 public:
  LinkRole(NodeServices& services, const NodeOptions& options)
      : services_(services),
        client_device_(options.client_port),
        reference_device_(options.client_reference_port),
        timer_(services.loop()),
        references_(services.bus(), InLoop(services.loop(), alive_, [this] { OnReferences(); })) {}

  Ports Prepare(const LoadedScenario& loaded, const Ports& given) override {
    client_is_library_ = FindPort(given, "client_kind") == "library";
    // At a real port the hardware takes the bytes' time, and its adapter its own.
    scenario_ = loaded.scenario;
    if (!client_device_.empty()) scenario_.link.adapter_latency_ms = 0;
    line_.emplace(scenario_, client_device_.empty());
    plant_ = std::make_unique<link::Pty>(services_.loop());
    base_station_ = std::make_unique<link::Pty>(services_.loop());
    Ports ports = {{"plant", plant_->slave_path()}, {"base_station", base_station_->slave_path()}};
    Open(client_device_, scenario_.link.port_baud(), client_pty_, client_serial_, "client", ports);
    if (client_device_.empty() || !reference_device_.empty())
      Open(reference_device_, LinkSpec::kReferenceBaud, reference_pty_, reference_serial_, "client_reference",
           ports);
    return ports;
  }

  void Arm(const Ports& /*ports*/) override {
    plant_->master().Start(
        [this](std::span<const std::uint8_t> bytes) {
          // The server answers at once: what it takes longer is this machine's doing.
          if (asked_plant_ns_ != kNever) services_.lateness().Note(asked_plant_ns_, services_.clock().Now());
          asked_plant_ns_ = kNever;
          Transmit(Direction::kToClient, bytes);
        },
        Lost("plant's port"));
    canary_ = std::make_unique<PtyCanary>(services_);
    Read(base_station_->master(), Direction::kReference, "base station");
    Read(*ClientPort(), Direction::kToPlant, "client");
    // The client sends nothing there, but its going is seen.
    if (link::SerialPort* port = ReferencePort(); port != nullptr && reference_serial_)
      port->Start([](std::span<const std::uint8_t>) {}, Lost("client's reference port"));
    armed_ = true;
  }

  void Start() override {}

  void Flush() override {
    if (line_->origin() == kNever) return;
    services_.lateness().origin_ns = line_->origin();
    LineLog log = line_->TakeLog(services_.clock().Now());
    JudgeRoundTrip(log.client_round_trip_ns);
    SampleCounts(services_.clock().Now());
    services_.log().Write(log, line_->origin(), std::exchange(samples_, {}));
  }

  NodeTotals Stop() override {
    armed_ = false;
    timer_.cancel();
    canary_.reset();
    const TimeNs now = services_.clock().Now();
    const TimeNs origin = line_->origin() == kNever ? now : line_->origin();
    SampleCounts(now);
    LineLog log = line_->TakeLog(std::min(now, origin + scenario_.duration_ns));
    services_.log().Write(log, origin, std::exchange(samples_, {}));
    NodeTotals totals;
    totals.line = std::move(log);
    return totals;
  }

 private:
  void Open(const std::string& device, std::int64_t baud, std::unique_ptr<link::Pty>& pty,
            std::unique_ptr<link::SerialPort>& serial, const char* name, Ports& ports) {
    if (device.empty()) {
      pty = std::make_unique<link::Pty>(services_.loop());
      ports.push_back({name, pty->slave_path()});
      return;
    }
    serial = std::make_unique<link::SerialPort>(services_.loop(), device, baud);
    ports.push_back({name, device});
    const auto latency = serial->SetLowLatency();
    if (!latency.advice.empty())
      services_.log().Write(RunEvent{0, "adapter", fmt::format("{}: {}", device, latency.advice)});
  }

  link::SerialPort* ClientPort() { return client_serial_ ? client_serial_.get() : &client_pty_->master(); }
  link::SerialPort* ReferencePort() {
    if (reference_serial_) return reference_serial_.get();
    return reference_pty_ ? &reference_pty_->master() : nullptr;
  }

  link::SerialPort::Closed Lost(std::string name) {
    return [this, name = std::move(name)](const std::string& reason) {
      const std::string text = fmt::format("the {} is gone: {}", name, reason);
      const TimeNs origin = line_->origin();
      services_.log().Write(
          RunEvent{origin == kNever ? 0 : services_.clock().Now() - origin, "port_lost", text});
      services_.Fail(EndReason::kNodeLost, text);
    };
  }

  void Read(link::SerialPort& port, Direction direction, const char* name) {
    port.Start([this, direction](std::span<const std::uint8_t> bytes) { Transmit(direction, bytes); },
               Lost(std::string(name) + "'s port"));
  }

  void OnReferences() {
    for (const auto& reference : references_.Take()) {
      if (!armed_ || reference.run_id != services_.run_id()) continue;
      ReferenceTruth truth;
      for (std::size_t i = 0; i < kReferenceCount; ++i)
        truth.*kReferenceFields[i].in_double = reference.values[i];
      Transmit(Direction::kReference,
               Framed(link::EncodeReference(ToFloat(truth, kReferenceFields))).bytes());
    }
  }

  void Transmit(Direction direction, std::span<const std::uint8_t> bytes) {
    if (!armed_) return;
    const TimeNs now = services_.clock().Now();
    // A firmware library answers within microseconds: what it takes longer is this machine's doing.
    if (direction == Direction::kToPlant && client_is_library_ &&
        bytes.size() >= link::kActuatorMessageBytes && line_->unanswered_reply() != kNever)
      services_.lateness().Note(line_->unanswered_reply(), now);
    line_->Transmit(direction, now, bytes);
    Pump();
  }

  // Hands over what has arrived, and comes back for the rest.
  void Pump() {
    const TimeNs now = services_.clock().Now();
    SampleCounts(now);
    TimeNs next = kNever;
    for (const Direction direction : kDirections) {
      link::SerialPort* port = direction == Direction::kToPlant    ? &plant_->master()
                               : direction == Direction::kToClient ? ClientPort()
                                                                   : ReferencePort();
      while (const auto piece = line_->TakePiece(direction, now)) {
        services_.lateness().Note(piece->arrival_ns, now);
        if (port != nullptr) port->Write(piece->bytes);
        if (direction == Direction::kToPlant) asked_plant_ns_ = now;
      }
      next = std::min(next, line_->NextArrival(direction));
    }
    timer_.cancel();
    if (next == kNever) return;
    timer_.expires_at(services_.clock().ToSteady(next));
    timer_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
      if (!error && !alive.expired() && armed_) Pump();
    });
  }

  // The counters as they stood on the 12 ms grid, for the trace.
  void SampleCounts(TimeNs now) {
    if (line_->origin() == kNever) return;
    for (; line_->origin() + next_sample_ns_ <= now && next_sample_ns_ <= scenario_.duration_ns;
         next_sample_ns_ += kControlPeriodNs)
      samples_.push_back({next_sample_ns_, line_->counts()});
  }

  void JudgeRoundTrip(const std::vector<TimeNs>& round_trips) {
    if (judged_) return;
    first_round_trips_.insert(first_round_trips_.end(), round_trips.begin(), round_trips.end());
    if (first_round_trips_.size() < kRoundTripSampleCount) return;
    judged_ = true;
    const auto middle = first_round_trips_.begin() + kRoundTripSampleCount / 2;
    std::nth_element(first_round_trips_.begin(), middle, first_round_trips_.end());
    const TimeNs now = services_.clock().Now() - line_->origin();
    const double median_ms = ToSeconds(*middle) * 1e3;
    services_.log().Write(RunEvent{now, "client_round_trip",
                                   fmt::format("a reply is answered after {:.2f} ms (median of the first {})",
                                               median_ms, kRoundTripSampleCount)});
    if (*middle <= kSlowRoundTripNs || client_device_.empty()) return;
    services_.log().Write(RunEvent{
        now, "slow_adapter",
        fmt::format("{:.1f} ms between reply and actuators: a USB-serial adapter that buffers, most likely. "
                    "It eats the vehicle's delay margin of 9 ms; see `tiltproof doctor --client serial:{}`",
                    median_ms, client_device_)});
  }

  NodeServices& services_;
  std::string client_device_, reference_device_;
  Scenario scenario_;
  std::optional<LocalLine> line_;
  std::unique_ptr<link::Pty> plant_, base_station_, client_pty_, reference_pty_;
  std::unique_ptr<link::SerialPort> client_serial_, reference_serial_;
  boost::asio::steady_timer timer_;
  std::unique_ptr<PtyCanary> canary_;
  bool armed_ = false;
  TimeNs asked_plant_ns_ = kNever;  // when the plant got the last bytes that it has not answered yet
  TimeNs next_sample_ns_ = 0;
  std::vector<CountsSample> samples_;
  bool client_is_library_ = false;
  std::vector<TimeNs> first_round_trips_;
  bool judged_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  dds::Subscriber<dds::Reference> references_;
};

}  // namespace

std::unique_ptr<Role> MakeLinkRole(NodeServices& services, const NodeOptions& options) {
  return std::make_unique<LinkRole>(services, options);
}

}  // namespace tiltproof::harness
