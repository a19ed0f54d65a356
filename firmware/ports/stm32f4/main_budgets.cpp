// What the flight costs, in executed instructions: lines `name value` on the console, then `done`.
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
#include "firmware/lag_estimator.h"
#include "firmware/messages.h"
#include "firmware/ports/stm32f4/board.h"
#include "firmware/ports/stm32f4/fault_record.h"
#include "firmware/ports/stm32f4/stm32f4.h"
#include "firmware/ports/stm32f4/stm32f4_port.h"
#include "firmware/ports/stm32f4/symbols.h"
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

template <class Work>
std::uint32_t Count(const Work& work) {
  const InterruptLock lock;
  asm volatile("" ::: "memory");
  const std::uint32_t begin = Tim2().CNT;
  work();
  asm volatile("" ::: "memory");
  return Tim2().CNT - begin;
}

template <class Work>
void Measure(const char* name, const Work& work) {
  const std::uint32_t empty = Count([] {});
  ConsoleLine().Text(name).Text(" ").Number(Count(work) - empty).Send();
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

// Bytes as the interrupt brings them, each drained at once.
void Arrive(firmware::FlightApplication& application, firmware::Uart uart, ByteRing<kReceiveRingBytes>& ring,
            std::span<const std::uint8_t> bytes) {
  for (const std::uint8_t byte : bytes) {
    ring.Put(byte);
    Drain(ring, [&](auto part) { application.Receive(uart, part); });
  }
}

// One period: the request, a reference, the reply and the command that answers it.
void MeasureCycle(const char* name, const char* build, const Payload& reply) {
  Wire reply_wire;
  Wire reference_wire;
  const auto reply_frame = link::EncodeFrame(reply, reply_wire).bytes;
  const auto reference_frame =
      link::EncodeFrame(std::span(reply).first(link::kReferenceMessageBytes), reference_wire).bytes;
  static std::optional<firmware::FlightApplication> storage;  // larger than the stack
  firmware::FlightApplication& application =
      storage.emplace(*firmware::FindBuild(build), link::Dialect::kPaper, port);
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
  MeasureModelStep();
  MeasureLagHypotheses();
  ConsoleLine().Text("done").Send();
  for (;;) WaitForInterrupt();
}
