#include "firmware/lqr/lqr_application.h"

#include <bit>

namespace tiltproof::firmware {
namespace {

constexpr std::size_t kFloatBytes = 4;
constexpr std::size_t kSentBytesMax = kFloatBytes * (1 + kLqrInputsMax);

float LoadFloat(std::span<const std::uint8_t> bytes) {
  return std::bit_cast<float>(
      static_cast<std::uint32_t>(bytes[0]) | static_cast<std::uint32_t>(bytes[1]) << 8 |
      static_cast<std::uint32_t>(bytes[2]) << 16 | static_cast<std::uint32_t>(bytes[3]) << 24);
}

// The largest plausible magnitude of a sensed number, by its place.
float PlausibleMax(std::size_t place, std::size_t coordinates) {
  if (place < 3) return link::kPositionMax_m;
  if (place < coordinates) return link::kAngleMax_rad;
  if (place < coordinates + 3) return link::kVelocityMax_m_s;
  return link::kAngularRateMax_rad_s;
}

}  // namespace

LqrApplication::LqrApplication(const LqrTable& table, link::Dialect dialect, Port& port)
    : table_(table),
      services_(dialect == link::Dialect::kPaper ? Services{1.0F, 2.0F, 3.0F, false}
                                                 : Services{3.0F, 1.0F, 0.0F, true}),
      // NOLINTNEXTLINE(bugprone-incorrect-roundings): a period is positive.
      period_ns_(static_cast<TimeNs>(table.period_s * 1e6F + 0.5F) * kNsPerUs),
      port_(port),
      law_(table),
      reference_receiver_(dialect, ValueChecks::kFiniteAndRange) {}

TimeNs LqrApplication::Start(TimeNs now) {
  port_.Log(now, "lqr");
  next_request_ns_ = SendStart(now);
  return Tick(now);
}

void LqrApplication::Receive(Uart uart, std::span<const std::uint8_t> bytes) {
  if (uart == Uart::kReference) return reference_receiver_.Receive(bytes);
  while (const auto event = decoder_.Next(bytes))
    if (event->status == link::FrameStatus::kOk) AcceptReply(event->payload);
}

TimeNs LqrApplication::Tick(TimeNs now) {
  if (const auto reference = reference_receiver_.TakeReference()) reference_ = *reference;
  if (has_reply_) Answer(now);
  // Twice at one instant when a `start` leaves without taking time.
  while (now >= next_request_ns_) BeginPeriod(now);
  return next_request_ns_;
}

TimeNs LqrApplication::Send(TimeNs now, float id, std::span<const float> values) {
  std::array<std::uint8_t, kSentBytesMax> payload;
  std::size_t size = 0;
  const auto append = [&](float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    for (unsigned shift = 0; shift < 32; shift += 8)
      payload[size++] = static_cast<std::uint8_t>(bits >> shift & 0xFFU);
  };
  append(id);
  for (const float value : values) append(value);
  std::array<std::uint8_t, link::FrameBytesMax(kSentBytesMax)> wire;
  const std::span<const std::uint8_t> sent(payload.data(), size);
  return port_.Transmit(Uart::kMain, now, link::EncodeFrame(sent, wire).bytes);
}

TimeNs LqrApplication::SendStart(TimeNs now) {
  start_is_fresh_ = true;
  const std::span<const float> hover(table_.hover_input.data(), table_.input_count);
  return Send(now, services_.start, services_.start_has_inputs ? hover : std::span<const float>());
}

void LqrApplication::BeginPeriod(TimeNs now) {
  if (!heard_server_ && !start_is_fresh_) {
    next_request_ns_ = SendStart(now);
    return;
  }
  start_is_fresh_ = false;
  decoder_.Finish();  // A reply that is not whole by now answers the request before.
  waiting_ = true;
  Send(now, services_.read, {});
  do {
    next_request_ns_ += period_ns_;
  } while (next_request_ns_ <= now);
}

void LqrApplication::AcceptReply(std::span<const std::uint8_t> payload) {
  const std::size_t count = table_.sensed_count();
  if (!waiting_ || payload.size() != kFloatBytes * count) return;
  std::array<float, kLqrSensedMax> values;
  for (std::size_t i = 0; i < count; ++i) {
    values[i] = LoadFloat(payload.subspan(kFloatBytes * i, kFloatBytes));
    const float max = PlausibleMax(i, count / 2);
    if (!(values[i] >= -max && values[i] <= max)) return;  // NaN fails, too
  }
  sensed_ = values;
  waiting_ = false;
  has_reply_ = heard_server_ = true;
}

void LqrApplication::Answer(TimeNs now) {
  has_reply_ = false;
  const std::span<const float> sensed(sensed_.data(), table_.sensed_count());
  if (!reference_)
    reference_ = Reference{.x_m = sensed[0], .y_m = sensed[1], .z_m = sensed[2], .yaw_rad = sensed[5]};
  std::array<float, kLqrInputsMax> command;
  const std::span<float> inputs(command.data(), table_.input_count);
  law_.Step(sensed, *reference_, inputs);
  Send(now, services_.actuators, inputs);
}

}  // namespace tiltproof::firmware
