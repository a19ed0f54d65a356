// The build `lqr` as a whole: the paper's periodic cycle (section 2.1, Figure 4), in any protocol that carries the states
// of the law (firmware/lqr/lqr_sensors.h).
//
//   LqrApplication application(setup, port);
//   TimeNs wake = application.Start(now);            // power-on
//   for (;;) {                                       // until `wake` or until bytes arrive
//     application.Receive(Uart::kMain, bytes);
//     wake = application.Tick(now);
//   }
//
// It sends `start`, then the protocol's requests in each period. When the replies with all states have come, it answers at
// once with all actuator messages. A message that is damaged, not finite, implausible or stale is none, and a period that
// lacks one has no actuators. Until the first valid message of the server each period begins with `start` again, because
// the server may not have received it. Where the server sends by itself, there are no requests: the last of the states'
// messages in the file, of those that come most often, is answered, once in each control period. A protocol without
// `start` begins with the first answer.
//
// A law may take a time to compute. Its command leaves when it is ready, and states that come before are not answered.
//
// This build has no image, so it may use the harness's protocols, which need a heap.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware/lqr/lqr_law.h"
#include "firmware/lqr/lqr_sensors.h"
#include "firmware/port.h"
#include "firmware/signals.h"
#include "link/protocol.h"

namespace tiltproof::firmware {

// One vehicle and its protocol.
struct LqrSetup {
  LqrTable table;
  std::shared_ptr<const link::Protocol> protocol;
  std::vector<std::string> states, inputs;  // names, in the order of the table
  RatesAxes rates = RatesAxes::kWorld;
};

// One control period, as its law sees it.
struct ControlPeriod {
  TimeNs requested;  // when the states were asked for; without requests, when they came
  TimeNs now;
  TimeNs deadline;  // the next period begins
};

// States that a law computes for so long from `now` on, and that this should end by the deadline. Returns when it ends.
using Compute = std::function<TimeNs(TimeNs now, TimeNs length, TimeNs deadline)>;

// A law in place of the build's own.
class CycleLaw {
 public:
  virtual ~CycleLaw() = default;
  // Sets `command`, and returns when it leaves: period.now or later. It is not called before that. `sensed` is as for
  // LqrLaw::Step.
  virtual TimeNs Step(const ControlPeriod& period, std::span<const float> sensed, const Reference& reference,
                      std::span<float> command) = 0;
};

class LqrApplication {
 public:
  // `setup` and `port` must outlive the application. The protocol must carry all states and inputs.
  LqrApplication(const LqrSetup& setup, Port& port) : LqrApplication(setup, nullptr, port) {}
  // `law` must outlive it, too.
  LqrApplication(const LqrSetup& setup, CycleLaw& law, Port& port) : LqrApplication(setup, &law, port) {}

  // Power-on, once. Returns when to call Tick at the latest.
  TimeNs Start(TimeNs now);
  // Bytes from a receiver, in order, in any pieces. Decodes only; Tick acts on what has arrived.
  void Receive(Uart uart, std::span<const std::uint8_t> bytes);
  // Does all that is due at `now`, which does not decrease. Returns when to call again at the latest.
  TimeNs Tick(TimeNs now);

 private:
  LqrApplication(const LqrSetup& setup, CycleLaw* law, Port& port);
  // Returns when the message's last bit has left. `inputs`: of the vehicle, for the fields that carry them.
  TimeNs Send(TimeNs now, const link::MessageType& type, std::span<const float> inputs);
  double InputField(const link::MessageField& field, std::span<const float> inputs) const;
  TimeNs SendStart(TimeNs now);
  void BeginPeriod(TimeNs now);
  bool IsNew(const link::Message& message);
  void Accept(const link::Message& message);
  // Takes the place of the first reply for all that no reference has said.
  void HoldPlace(std::span<const float> sensed);
  void Answer(TimeNs now);
  void SendCommand(TimeNs now);
  std::size_t PlaceOf(const link::MessageType& type) const {
    return static_cast<std::size_t>(&type - protocol_.messages.data());
  }

  const LqrSetup& setup_;
  const LqrTable& table_;
  const link::Protocol& protocol_;
  const TimeNs period_ns_;
  Port& port_;
  LqrLaw own_law_;
  CycleLaw* const law_ = nullptr;  // null: its own
  LqrSensors sensors_;
  std::unique_ptr<link::FrameReader> reader_, reference_reader_;
  std::vector<std::uint32_t> sent_counts_;         // by message type
  std::vector<std::vector<double>> last_numbers_;  // values of the last message of each type
  const link::MessageType* pace_ =
      nullptr;  // the message of the server's own that is answered; null: replies are
  std::int64_t paces_per_period_ = 1, pace_count_ = 0;
  std::vector<bool> awaited_;  // by message type: the replies that this period lacks
  // The last one received. NaN: not received, and no place held.
  Reference reference_ = {.x_m = NAN, .y_m = NAN, .z_m = NAN, .yaw_rad = NAN};
  bool has_states_ = false;  // all of this period, not answered
  std::array<float, kLqrInputsMax> command_{};
  std::optional<TimeNs> ready_ns_;  // of `command_`, which is being computed
  bool waiting_ = false;            // for the replies to the last requests
  bool start_is_fresh_ = true;      // `start` has been sent and no request since
  bool heard_server_ = false;       // a valid message has arrived
  TimeNs next_period_ns_ = 0;
  TimeNs requested_ns_ = 0;
};

}  // namespace tiltproof::firmware
