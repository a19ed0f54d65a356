// Flights on the board itself, to count what a whole period costs: the vehicle's equations of motion, a line without
// errors but those that a test wants, and the application between them. Only the application is counted.
//
//   BudgetFlight flight("tolerant");
//   for (int i = 0; i < 50; ++i) flight.Fly(BudgetFlight::Reply::kInTime);
//   const std::uint32_t instructions = flight.Fly(BudgetFlight::Reply::kNone);   // no reply: commands at 2, 6, 10 ms
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "firmware/builds.h"
#include "firmware/failover/cross_line.h"
#include "firmware/flight_application.h"
#include "firmware/frame_sender.h"
#include "firmware/messages.h"
#include "firmware/ports/stm32f4/instruction_count.h"
#include "firmware/ports/stm32f4/stm32f4_port.h"
#include "firmware/ports/stm32f4/usart.h"
#include "firmware/tolerant/vehicle_dynamics.h"
#include "link/frame.h"

namespace tiltproof::stm32f4 {

// Bytes as the interrupt brings them, each drained at once.
inline void Arrive(firmware::FlightApplication& application, firmware::Uart uart,
                   ByteRing<kReceiveRingBytes>& ring, std::span<const std::uint8_t> bytes) {
  for (const std::uint8_t byte : bytes) {
    ring.Put(byte);
    Drain(ring, [&](auto part) { application.Receive(uart, part); });
  }
}

class BudgetFlight final : public firmware::Port {
 public:
  enum class Reply : std::uint8_t {
    kInTime,  // 1 ms after the request
    kLate,    // 5 ms after it
    kNone,
    kHeld,   // with the next burst
    kBurst,  // the held ones and this one, one per ms: nearly as fast as the line
  };

  // Defects of the vehicle.
  struct Faults {
    float right_rotor = 1;  // its share of the commanded thrust
    float z_m = 0;          // a lie of that sensor
    int late_steps = 0;     // of 4 ms, by which commands act late; up to 3
  };

  explicit BudgetFlight(const char* build, link::Dialect dialect = link::Dialect::kPaper)
      : dialect_(dialect), application_(*firmware::FindBuild(build), dialect, *this) {
    wake_ns_ = application_.Start(0);
    Settle(0);
    inputs_.fill(newest_);
  }

  // One period, with its request at the next tick that is due. Returns the executed instructions.
  std::uint32_t Fly(Reply reply) {
    std::uint32_t instructions = 0;
    const TimeNs begin = period_count_ == 0 ? wake_ns_ : begin_ns_ + firmware::kControlPeriodNs;
    begin_ns_ = begin;
    if (period_count_++ > 0) StepVehicle();
    const int reply_ms = reply == Reply::kLate ? 5 : 1;
    for (int ms = 0; ms < 12; ++ms) {
      const TimeNs now = begin + ms * kNsPerMs;
      if (ms == 4 || ms == 8) StepVehicle();
      if (ms == 0) instructions += ReceiveReference(now);
      if (ms == 0 && heartbeat_) instructions += ReceiveHeartbeat();
      const bool receives =
          ms >= reply_ms && held_count_ > 0 && reply != Reply::kHeld && reply != Reply::kNone;
      if (receives) instructions += ReceiveReply();
      if (receives || wake_ns_ <= now) instructions += Counted([&] { wake_ns_ = application_.Tick(now); });
      Settle(now);
      if (ms == 0) Sense(reply);
    }
    return instructions;
  }

  // From now on another board claims the vehicle in each period, with these integrals.
  void HearClaim(const firmware::Integrals& integrals) {
    heartbeat_ = {
        .heartbeat = {.heard = true, .role = firmware::Role::kActive, .link_good = true, .ready = true},
        .integrals = integrals};
  }

  Faults& faults() { return faults_; }
  const Actuators& command() const { return newest_; }
  int command_count() const { return command_count_; }  // in the last period, and before
  firmware::Status status() const { return application_.status(); }

  TimeNs Transmit(firmware::Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) override {
    if (uart != firmware::Uart::kMain) return now;
    board_port_.Transmit(uart, now, bytes);
    for (const std::uint8_t byte : bytes) {
      if (sent_count_ < sent_.size()) sent_[sent_count_++] = byte;
    }
    return now + static_cast<TimeNs>(bytes.size()) * kByteNs;
  }
  void Log(TimeNs now, const char* text) override { board_port_.Log(now, text); }

 private:
  static constexpr TimeNs kByteNs = 10'851;  // at 921600 baud
  static constexpr std::size_t kHeldMax = 11;
  static constexpr float kSpeed_m_s = 1;
  using Wire =
      std::array<std::uint8_t, link::FrameBytesMax(link::kMessageBytesMax, link::FrameCheck::kCrc32)>;

  // Queues the reply to that period's request.
  void Sense(Reply reply) {
    if (reply == Reply::kNone || held_count_ == kHeldMax) return;
    Sensors sensed = firmware::ToSensors(state_);
    sensed.z_m += faults_.z_m;
    held_bytes_[held_count_] = InFrame(link::EncodeSensors(sensed, dialect_), held_[held_count_]);
    ++held_count_;
  }

  // With the next number; the times are as good as any that grow.
  std::span<const std::uint8_t> InFrame(link::MessageBytes message, Wire& wire) {
    ++number_;
    link::SetStamp(dialect_, {.sequence = number_, .time_us = number_}, message);
    return link::EncodeFrame(message.span(), wire, firmware::CheckOf(dialect_)).bytes;
  }

  std::uint32_t ReceiveReply() {
    const auto bytes = held_bytes_[taken_count_];
    if (++taken_count_ == held_count_) taken_count_ = held_count_ = 0;
    return Counted([&] { Arrive(application_, firmware::Uart::kMain, main_receive_ring, bytes); });
  }

  std::uint32_t ReceiveReference(TimeNs now) {
    const link::MessageBytes message =
        link::EncodeReference({.x_m = kSpeed_m_s * static_cast<float>(ToSeconds(now)),
                               .y_m = 0,
                               .z_m = 2,
                               .yaw_rad = 0,
                               .vx_m_s = kSpeed_m_s,
                               .vy_m_s = 0,
                               .vz_m_s = 0},
                              dialect_);
    Wire wire;
    const auto bytes = InFrame(message, wire);
    return Counted([&] { Arrive(application_, firmware::Uart::kReference, reference_receive_ring, bytes); });
  }

  std::uint32_t ReceiveHeartbeat() {
    ++heartbeat_->heartbeat.sequence;
    Wire wire;
    const auto bytes =
        link::EncodeFrame(firmware::EncodeCross(*heartbeat_), wire, link::FrameCheck::kCrc32).bytes;
    return Counted([&] { Arrive(application_, firmware::Uart::kCross, reference_receive_ring, bytes); });
  }

  // The server's part: what the application has sent.
  void Settle(TimeNs) {
    {
      const InterruptLock lock;
      main_transmit_ring.Drop(main_transmit_ring.Count());
    }
    std::span<const std::uint8_t> bytes(sent_.data(), sent_count_);
    link::FrameDecoder decoder(firmware::CheckOf(dialect_));
    while (const auto event = decoder.Next(bytes)) {
      link::ClientMessage message;
      if (link::DecodeClientMessage(dialect_, event->payload, message) != link::MessageStatus::kOk) continue;
      if (!message.has_actuators) continue;
      newest_ = message.actuators;
      ++command_count_;
    }
    sent_count_ = 0;
  }

  // 4 ms, under the inputs that were there when they began.
  void StepVehicle() {
    Actuators input = inputs_[static_cast<std::size_t>(faults_.late_steps)];
    input.f_r_n *= faults_.right_rotor;
    firmware::StepMotion(firmware::kTiltrotorConstants, input, state_);
    std::copy_backward(inputs_.begin(), inputs_.end() - 1, inputs_.end());
    inputs_[0] = newest_;
  }

  link::Dialect dialect_;
  std::uint16_t number_ = 0;  // of the last message of the server
  Stm32f4Port board_port_;
  firmware::FlightApplication application_;
  firmware::MotionState state_ = firmware::ToMotion({.z_m = 2,
                                                     .pitch_rad = -0.0117F,
                                                     .alpha_r_rad = 0.0116F,
                                                     .alpha_l_rad = 0.0116F,
                                                     .vx_m_s = kSpeed_m_s});
  Faults faults_;
  std::optional<firmware::CrossMessage> heartbeat_;
  Actuators newest_{.f_r_n = 10.2751F, .f_l_n = 10.2799F, .tau_r_nm = 0, .tau_l_nm = 0};
  std::array<Actuators, 4> inputs_;  // in force now, and a step earlier, ...
  std::array<Wire, kHeldMax> held_;
  std::array<std::span<const std::uint8_t>, kHeldMax> held_bytes_;
  std::size_t held_count_ = 0;
  std::size_t taken_count_ = 0;
  std::array<std::uint8_t, 256> sent_;
  std::size_t sent_count_ = 0;
  TimeNs wake_ns_ = 0;
  TimeNs begin_ns_ = 0;
  int period_count_ = 0;
  int command_count_ = 0;
};

}  // namespace tiltproof::stm32f4
