#include "harness/run/flight.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <string>
#include <utility>

#include "harness/client/firmware_guard.h"
#include "harness/reference/trajectory.h"
#include "harness/run/client_history.h"
#include "harness/run/framed.h"
#include "harness/run/merge_logs.h"
#include "harness/run/reference_talk.h"
#include "link/messages.h"

namespace tiltproof::harness {
namespace {

using link::Direction;

// A client may say that it transmits later within its call, but not by more than this.
constexpr TimeNs kTransmitAheadMax = kNsPerS;
// A client with a processor of its own comes back at least so often.
constexpr TimeNs kRunOnMax = kControlPeriodNs;
// A client that asks to be woken more often than this within a control period lets no time pass: that is every 0.6 us.
constexpr int kWakesPerPeriodMax = 20'000;

constexpr std::array kDirections = {Direction::kToPlant, Direction::kToClient, Direction::kReference};

// Times inside are boot time (nanoseconds since the client's power-on); what goes to the log is turned into
// simulation time.
class Conductor {
 public:
  Conductor(const Scenario& scenario, Line& line, PlantServer& server, const FlightOptions& options);
  RunLog Run();

 private:
  void MakeClient();
  void Conduct();
  void ServePlantEnd(TimeNs now);
  bool DeliverToClient(TimeNs until);
  void CommandDevice();
  void OnDeviceEvent(const DeviceEvent& event);
  void SendReference(TimeNs now);
  void Finish();

  bool started() const { return server_.state().started(); }
  bool over() const { return server_.state().over; }
  TimeNs SimTime(TimeNs boot_time) const { return boot_time - server_.state().origin_ns; }

  const Scenario& scenario_;
  const FlightOptions& options_;
  Line& line_;
  PlantServer& server_;
  Trajectory trajectory_;
  std::unique_ptr<Client> client_;
  RunLog log_;

  // Faults at the client's receiver, and what was carried out of those on its board.
  faults::FaultSchedule client_faults_;
  std::vector<faults::ReceiveMark> marks_;
  std::vector<DeviceEvent> device_events_;  // in boot time
  std::int64_t receive_overruns_count_ = 0;

  TimeNs wake_ns_ = 0;  // until when the client waits
  TimeNs next_reference_ns_ = kNever;
  TimeNs now_ns_ = 0;                                           // of the turn under way
  std::vector<std::pair<TimeNs, std::string>> firmware_lines_;  // what the firmware logged, in boot time
  std::size_t firmware_log_bytes_ = 0;
  ReferenceTalk reference_talk_;
};

Conductor::Conductor(const Scenario& scenario, Line& line, PlantServer& server, const FlightOptions& options)
    : scenario_(scenario),
      options_(options),
      line_(line),
      server_(server),
      trajectory_(scenario.reference),
      client_faults_(scenario.faults, scenario.seed,
                     {.baud = MainBaud(scenario.link), .reference_baud = ReferenceBaud(scenario.link)}),
      reference_talk_(scenario.link.dialect) {
  log_.trace = Trace(FlightColumns(scenario));
}

void Conductor::MakeClient() {
  client_ = options_.make_client(
      {.transmit = [this](Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) -> TimeNs {
         // The reference line has no way back: what the client sends there ends at its pin.
         if (uart != Uart::kMain) {
           reference_talk_.Hear(bytes);
           return now;
         }
         return line_.Transmit(Direction::kToPlant, std::clamp(now, now_ns_, now_ns_ + kTransmitAheadMax),
                               bytes);
       },
       .log =
           [this](TimeNs now, std::string_view text) {
             if (firmware_log_bytes_ > kFirmwareLogBytesMax) return;
             firmware_log_bytes_ += text.size();
             firmware_lines_.emplace_back(now, text);
           },
       .event = [this](const DeviceEvent& event) { OnDeviceEvent(event); }});
}

RunLog Conductor::Run() {
  const auto began = std::chrono::steady_clock::now();
  try {
    MakeClient();
    Conduct();
  } catch (const FirmwareTrouble& trouble) {
    log_.end_reason = trouble.hung ? EndReason::kFirmwareHung : EndReason::kFirmwareCrashed;
    log_.end_text = trouble.what();
  } catch (const std::exception& error) {
    if (client_ == nullptr) throw;
    log_.end_reason = EndReason::kHarnessError;
    log_.end_text = error.what();
  }
  log_.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  Finish();
  if (options_.retire) options_.retire(std::move(client_));
  return std::move(log_);
}

void Conductor::Conduct() {
  TimeNs last = kPowerOn, period_begin = 0;
  int wakes = 0;
  wake_ns_ = client_->Start(0);
  const bool runs_on = client_->RunsOn();
  for (;;) {
    const TimeNs end = (started() ? server_.state().origin_ns : 0) + scenario_.duration_ns;
    TimeNs now = std::min(wake_ns_, next_reference_ns_);
    for (const Direction direction : kDirections) now = std::min(now, line_.NextArrival(direction));
    now = std::max(now, last);
    if (now > end) {
      if (started()) {
        server_.Advance(end, line_.counts());
        // The last row is at duration_s, on the grid or not.
        if (!over()) server_.Finish(end, line_.counts());
      } else {
        log_.end_reason = EndReason::kNeverStarted;
        log_.end_text = NeverStartedText(scenario_);
      }
      return;
    }
    last = now_ns_ = now;
    if (now - period_begin >= kControlPeriodNs) {
      period_begin = now;
      wakes = 0;
    }
    if (now >= wake_ns_ && ++wakes > kWakesPerPeriodMax)
      throw FirmwareTrouble(
          true,
          fmt::format("the firmware lets no time pass: it wants to be woken again and again, {} times from "
                      "{:.9f} s to {:.9f} s after power-on",
                      wakes, ToSeconds(period_begin), ToSeconds(now)));
    if (options_.interrupted != nullptr && options_.interrupted->load(std::memory_order_relaxed)) {
      log_.end_reason = EndReason::kInterrupted;
      log_.end_text = "interrupted";
      return;
    }

    if (const auto& overfull = line_.overfull()) {
      // Without faults it is the firmware that sends, or asks for, more than the line carries.
      if (!overfull->by_faults) throw FirmwareTrouble(true, overfull->text);
      log_.end_reason = EndReason::kLineOverfull;
      log_.end_text = overfull->text;
      return;
    }

    // First of all, so that rows of the past show nothing of what happens now.
    server_.Advance(now, line_.counts());
    if (over()) return;
    if (now == next_reference_ns_) SendReference(now);
    const bool was_started = started();
    ServePlantEnd(now);
    const bool starts_now = started() && !was_started;
    if (starts_now) CommandDevice();
    // Nothing that is not on its way yet can reach the client before that.
    const TimeNs horizon = std::min({next_reference_ns_, line_.NextArrival(Direction::kToPlant),
                                     now + kRunOnMax, std::max(end, now) + 1});
    const bool delivered = DeliverToClient(runs_on ? horizon : now);
    if (runs_on || delivered || starts_now || now >= wake_ns_) wake_ns_ = client_->Grant(now, horizon);
  }
}

void Conductor::ServePlantEnd(TimeNs now) {
  if (line_.NextArrival(Direction::kToPlant) > now) return;
  while (const auto piece = line_.TakePiece(Direction::kToPlant, now)) {
    const bool was_started = started();
    const TimeNs arrival = piece->arrival_ns;
    server_.Receive(arrival, piece->bytes, [this, arrival](std::span<const std::uint8_t> frame) {
      line_.Transmit(Direction::kToClient, arrival, frame);
    });
    if (started() && !was_started) SendReference(arrival);
  }
}

// The client gets every byte that has arrived, whole frame or not: it may flush what it holds at any tick.
bool Conductor::DeliverToClient(TimeNs until) {
  bool delivered = false;
  // References first: r(t_k) is there before the sensor reply of the same period.
  for (const Direction direction : {Direction::kReference, Direction::kToClient}) {
    const Uart uart = direction == Direction::kReference ? Uart::kReference : Uart::kMain;
    while (const auto piece = line_.TakePiece(direction, until)) {
      delivered = true;
      client_faults_.MarkReceived(direction, piece->arrival_ns, piece->bytes, marks_);
      client_->Receive(uart, piece->arrival_ns, piece->bytes, marks_);
    }
  }
  return delivered;
}

void Conductor::CommandDevice() {
  const TimeNs origin = server_.state().origin_ns;
  client_faults_.SetOrigin(origin);
  client_->Command(faults::DeviceCommands(scenario_.faults, scenario_.seed), origin);
}

void Conductor::OnDeviceEvent(const DeviceEvent& event) {
  device_events_.push_back(event);
  receive_overruns_count_ += event.overruns_count;
  if (event.fault && *event.fault < scenario_.faults.size())
    client_faults_.Count(*event.fault, SimTime(event.time_ns), event.text);
}

// The base station follows the simulation's clock (paper, section 2.2, Figure 6).
void Conductor::SendReference(TimeNs now) {
  const Framed frame(link::EncodeReference(ToFloat(trajectory_.At(SimTime(now)), kReferenceFields)));
  line_.Transmit(Direction::kReference, now, frame.bytes());
  next_reference_ns_ = now + kControlPeriodNs;
  if (options_.progress_ns != nullptr) options_.progress_ns->store(SimTime(now), std::memory_order_relaxed);
}

void Conductor::Finish() {
  const PlantServer::State& state = server_.state();
  if (state.over && log_.end_reason == EndReason::kCompleted) {
    log_.end_reason = state.end_reason;
    log_.end_text = state.end_text;
  }
  // Without t = 0 there is no simulation time: boot time is shown as if power-on were the origin.
  const TimeNs origin = state.started() ? state.origin_ns : 0;
  if (state.started())
    log_.end_ns = log_.end_reason == EndReason::kCompleted ? scenario_.duration_ns : state.reached_ns;
  // After trouble the client may be in the middle of a call.
  const bool trouble = log_.end_reason == EndReason::kFirmwareHung ||
                       log_.end_reason == EndReason::kFirmwareCrashed ||
                       log_.end_reason == EndReason::kHarnessError;
  if (!trouble) {
    try {
      if (const auto status = client_->Status()) log_.failsafe_entered_count = status->failsafe_count;
    } catch (const FirmwareTrouble& late) {
      log_.end_reason = late.hung ? EndReason::kFirmwareHung : EndReason::kFirmwareCrashed;
      log_.end_text = late.what();
    }
  }
  for (const auto& [time_ns, text] : firmware_lines_)
    log_.firmware_log += fmt::format("{:.6f} {}\n", ToSeconds(time_ns - origin), text);
  if (client_ != nullptr && client_->RunsOn()) log_.receive_overruns_count = receive_overruns_count_;
  for (DeviceEvent& event : device_events_)
    log_.events.push_back({event.time_ns - origin, std::move(event.kind), std::move(event.text)});
  if (const std::string talk = reference_talk_.Trouble(); !talk.empty() && !state.started())
    log_.events.push_back({0, kLineTroubleEvent, talk});
  Append(log_, client_faults_, origin);
  // A part in another process may be gone, and its records with it; the others' are kept.
  const auto keep_going = [&](const auto& append) {
    try {
      append();
    } catch (const std::exception& error) {
      if (log_.end_reason == EndReason::kHarnessError) return;
      log_.end_reason = EndReason::kHarnessError;
      log_.end_text = error.what();
    }
  };
  keep_going([&] { Append(log_, server_.TakeLog()); });
  keep_going([&] { Append(log_, line_.TakeLog(origin + log_.end_ns), origin); });
  SortByTime(log_);
  AddClientHistory(log_, scenario_.link.dialect, BootSign::kReset);
  ExplainNeverStarted(log_);
}

}  // namespace

ClientSettings SettingsOf(const Scenario& scenario) {
  return {.firmware = scenario.firmware,
          .dialect = scenario.link.dialect,
          .lines = {.main_baud = MainBaud(scenario.link), .reference_baud = ReferenceBaud(scenario.link)},
          .start_within_ns = scenario.start_within_ns};
}

std::string NeverStartedText(const Scenario& scenario) {
  return "the server accepted no `start` message within " + std::to_string(ToSeconds(scenario.duration_ns)) +
         " s of power-on";
}

RunLog Conduct(const Scenario& scenario, Line& line, PlantServer& server, const FlightOptions& options) {
  return Conductor(scenario, line, server, options).Run();
}

RunLog Fly(const Scenario& scenario, const plant::VehicleModel& model, const FlightOptions& options) {
  LocalLine line(scenario);
  LocalPlantServer server(scenario, model);
  return Conduct(scenario, line, server, options);
}

}  // namespace tiltproof::harness
