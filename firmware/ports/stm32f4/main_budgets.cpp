// Prints the flight's cost, in executed instructions: lines `name value` on the console, then `done`.
//
// Measured with timer 2, which counts at 84 MHz on the board: two core cycles. In the emulator an instruction takes exactly
// a nanosecond with `-icount shift=0`, and with the right crystal timer 2 counts nanoseconds (tests/emulator/budgets_test.py).

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "firmware/builds.h"
#include "firmware/control_law.h"
#include "firmware/flight_application.h"
#include "firmware/frame_sender.h"
#include "firmware/messages.h"
#include "firmware/ports/stm32f4/board.h"
#include "firmware/ports/stm32f4/budget_flight.h"
#include "firmware/ports/stm32f4/fault_record.h"
#include "firmware/ports/stm32f4/instruction_count.h"
#include "firmware/ports/stm32f4/stm32f4.h"
#include "firmware/ports/stm32f4/stm32f4_port.h"
#include "firmware/ports/stm32f4/symbols.h"
#include "firmware/tolerant/lag_estimator.h"
#include "link/frame.h"

using namespace tiltproof;           // NOLINT: the application itself
using namespace tiltproof::stm32f4;  // NOLINT

TiltproofClientStatus tiltproof_status;

namespace {

constexpr std::size_t kPayloadBytes = link::kSensorMessageBytes;
using Payload = std::array<std::uint8_t, kPayloadBytes>;

// Bytes that need no escape, and do not repeat; bytes that all do.
Payload PlainPayload() {
  Payload payload;
  for (std::size_t i = 0; i < payload.size(); ++i) payload[i] = static_cast<std::uint8_t>(i + 1);
  return payload;
}
Payload EscapedPayload() {
  Payload payload;
  payload.fill(link::kFlag);
  return payload;
}

using Wire = std::array<std::uint8_t, link::FrameBytesMax(kPayloadBytes)>;

// The compiler must neither know the inputs, nor remove unused results.
template <class T>
void Opaque(T& value) {
  asm volatile("" : : "r"(&value) : "memory");
}

void Report(const char* name, std::uint32_t instructions) {
  // The flights' own lines may have filled it.
  while (console_transmit_ring.Count() != 0) asm volatile("");
  ConsoleLine().Text(name).Text(" ").Number(instructions).Send();
}

template <class Work>
void Measure(const char* name, const Work& work) {
  Report(name, Counted(work));
}

void MeasureControlLaw() {
  const firmware::Build& build = *firmware::FindBuild("paper");
  firmware::ControlLaw law(*build.gain, build.feed_forward);
  Sensors sensors{.x_m = 2, .z_m = 0.5F, .roll_rad = 0.1F, .vx_m_s = 1.5F};
  Reference reference{.x_m = 2.1F, .z_m = 0.6F};
  Actuators actuators;
  Opaque(sensors);
  Opaque(reference);
  Measure("control_step", [&] { actuators = law.Step(sensors, reference); });
  Opaque(actuators);
}

void MeasureCodec(const char* encode_name, const char* decode_name, Payload payload) {
  Wire wire;
  link::EncodedFrame frame;
  Opaque(payload);
  Measure(encode_name, [&] { frame = link::EncodeFrame(payload, wire); });
  link::FrameDecoder decoder;
  std::optional<link::FrameEvent> event;
  std::span<const std::uint8_t> received = frame.bytes;
  Opaque(received);
  Measure(decode_name, [&] { event = decoder.Next(received); });
  if (!event || event->status != link::FrameStatus::kOk || !std::ranges::equal(event->payload, payload)) {
    Fail(TILTPROOF_CAUSE_ASSERT);
  }
}

// One step of 4 ms of the vehicle's model.
void MeasureModelStep() {
  firmware::MotionState state =
      firmware::ToMotion({.z_m = 1, .roll_rad = 0.1F, .vx_m_s = 1.5F, .wx_rad_s = 0.3F});
  Actuators inputs{.f_r_n = 10, .f_l_n = 10.5F, .tau_r_nm = 0.01F, .tau_l_nm = 0.02F};
  Opaque(state);
  Opaque(inputs);
  Measure("model_step", [&] { firmware::StepMotion(firmware::kTiltrotorConstants, inputs, state); });
  Opaque(state);
}

// A sample that does not fit, 12 ms after the one before: all lags are examined.
void MeasureLagHypotheses() {
  static firmware::MotionTimeline timeline;
  firmware::LagEstimator estimator;
  firmware::MotionState sample = firmware::ToMotion({.z_m = 1});
  timeline.Begin(0, sample, {.f_r_n = 10, .f_l_n = 10, .tau_r_nm = 0, .tau_l_nm = 0});
  sample.p_WC_m.x += 1;
  sample.v_WC_m_s.y += 1;
  Opaque(sample);
  Measure("lag_hypotheses", [&] { estimator.Update(timeline, 3, sample); });
}

Stm32f4Port port;

// One period: the request, a reference, the reply and the command that answers it.
void MeasureCycle(const char* name, const char* build, const Payload& reply,
                  link::Dialect dialect = link::Dialect::kPaper) {
  using LongestWire =
      std::array<std::uint8_t, link::FrameBytesMax(link::kMessageBytesMax, link::FrameCheck::kCrc32)>;
  LongestWire reply_wire;
  LongestWire reference_wire;
  Sensors sensors;
  link::ParseSensors(reply, sensors);
  link::MessageBytes reference = link::EncodeReference({}, dialect);
  std::copy_n(reply.begin(), link::kReferenceMessageBytes,
              reference.bytes.begin() + (reference.size - link::kReferenceMessageBytes));
  const link::FrameCheck check = firmware::CheckOf(dialect);
  const auto reply_frame =
      link::EncodeFrame(link::EncodeSensors(sensors, dialect).span(), reply_wire, check).bytes;
  const auto reference_frame = link::EncodeFrame(reference.span(), reference_wire, check).bytes;
  static std::optional<firmware::FlightApplication> storage;  // larger than the stack
  firmware::FlightApplication& application = storage.emplace(*firmware::FindBuild(build), dialect, port);
  TimeNs wake = application.Start(0);
  const std::uint32_t count_before = application.control_count();
  Measure(name, [&] {
    application.Tick(wake);
    Arrive(application, firmware::Uart::kReference, reference_receive_ring, reference_frame);
    Arrive(application, firmware::Uart::kMain, main_receive_ring, reply_frame);
    wake = application.Tick(wake + kNsPerMs);
  });
  if (application.control_count() != count_before + 1) Fail(TILTPROOF_CAUSE_ASSERT);
}

// `tolerant` in flight. Each is the dearest of several periods of its kind.

using Reply = BudgetFlight::Reply;

void Expect(bool holds) {
  if (!holds) Fail(TILTPROOF_CAUSE_ASSERT);
}

BudgetFlight& NewFlight(link::Dialect dialect = link::Dialect::kPaper, const char* build = "tolerant") {
  static std::optional<BudgetFlight> storage;  // larger than the stack
  return storage.emplace(build, dialect);
}

// Until the vehicle has settled and the line is believed to be good.
constexpr int kSettledPeriods = 60;

std::uint32_t Dearest(BudgetFlight& flight, Reply reply, int periods) {
  std::uint32_t dearest = 0;
  for (int i = 0; i < periods; ++i) dearest = std::max(dearest, flight.Fly(reply));
  return dearest;
}

// Every fifth period is such a one, and counts.
std::uint32_t DearestOfFifth(BudgetFlight& flight, Reply reply, int commands) {
  std::uint32_t dearest = 0;
  for (int i = 0; i < 10; ++i) {
    Dearest(flight, Reply::kInTime, 4);
    const int before = flight.command_count();
    dearest = std::max(dearest, flight.Fly(reply));
    Expect(flight.command_count() - before == commands);
  }
  return dearest;
}

void MeasureTolerantLine() {
  BudgetFlight& flight = NewFlight();
  Dearest(flight, Reply::kInTime, kSettledPeriods);
  const int before = flight.command_count();
  Report("tolerant_good", Dearest(flight, Reply::kInTime, 20));
  Expect(flight.command_count() - before == 20);
  Report("tolerant_missed", DearestOfFifth(flight, Reply::kNone, 3));
  Report("tolerant_late", DearestOfFifth(flight, Reply::kLate, 4));
}

void MeasureTolerantHardened() {
  BudgetFlight& flight = NewFlight(link::Dialect::kHardened);
  Dearest(flight, Reply::kInTime, kSettledPeriods);
  const int before = flight.command_count();
  Report("tolerant_hardened", Dearest(flight, Reply::kInTime, 20));
  Expect(flight.command_count() - before == 20);
}

// The standby of another board, whose integrals it takes in each period.
void MeasureFailover() {
  BudgetFlight& flight = NewFlight(link::Dialect::kPaper, "failover");
  flight.HearClaim({});
  Dearest(flight, Reply::kInTime, kSettledPeriods);
  const int before = flight.command_count();
  Report("failover_good", Dearest(flight, Reply::kInTime, 20));
  Expect(flight.command_count() - before == 20);
}

// A rotor weakens: within three samples the belief about it changes, and the steps since are predicted again.
void MeasureTolerantBelief() {
  BudgetFlight& flight = NewFlight();
  Dearest(flight, Reply::kInTime, kSettledPeriods);
  const float before_n = flight.command().f_r_n;
  flight.faults().right_rotor = 0.7F;
  Report("tolerant_belief", Dearest(flight, Reply::kInTime, 20));
  Expect(flight.command().f_r_n > 1.2F * before_n);
}

// Several replies come in one period, while a sensor's lie is replaced, a rotor has just weakened and commands act late.
// All lags are examined for each of them, the steps between are predicted again, and commands are sent without replies,
// too.
std::uint32_t DearestBurst(int held) {
  std::uint32_t dearest = 0;
  for (int late_steps = 0; late_steps < 4; ++late_steps) {
    BudgetFlight& flight = NewFlight();
    Dearest(flight, Reply::kInTime, kSettledPeriods);
    const float before_n = flight.command().f_l_n;
    flight.faults().z_m = 0.5F;
    Dearest(flight, Reply::kInTime, 10);
    Expect(flight.command().f_l_n > 0.9F * before_n);  // the lie was not flown
    flight.faults().right_rotor = 0.7F;
    flight.faults().late_steps = late_steps;
    for (int i = 0; i < 4; ++i) {
      dearest = std::max(dearest, Dearest(flight, Reply::kHeld, held));
      dearest = std::max(dearest, flight.Fly(Reply::kBurst));
    }
  }
  return dearest;
}

}  // namespace

void stm32f4::OnReceived(firmware::Uart /*uart*/) {}

int main() {
  StartBoard();
  StartUsarts();
  ReportRestart(ResetReason::kPowerOn);  // a check above that failed
  Set(Rcc().APB1ENR, kRccApb1Tim2);
  Tim2().ARR = 0xFFFF'FFFF;
  Tim2().CR1 = 1;

  MeasureControlLaw();
  MeasureCodec("encode_plain", "decode_plain", PlainPayload());
  MeasureCodec("encode_escaped", "decode_escaped", EscapedPayload());
  MeasureCycle("cycle_plain", "paper", PlainPayload());
  MeasureCycle("cycle_escaped", "paper", EscapedPayload());
  MeasureCycle("cycle_hardened", "paper", PlainPayload(), link::Dialect::kHardened);
  MeasureCycle("cycle_hardened_escaped", "paper", EscapedPayload(), link::Dialect::kHardened);
  MeasureModelStep();
  MeasureLagHypotheses();
  MeasureTolerantLine();
  MeasureTolerantHardened();
  MeasureFailover();
  MeasureTolerantBelief();
  Report("tolerant_worst", DearestBurst(3));
  Report("tolerant_burst", DearestBurst(10));
  ConsoleLine().Text("done").Send();
  for (;;) WaitForInterrupt();
}
