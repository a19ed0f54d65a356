#include "firmware/lqr/lqr_application.h"

#include <algorithm>
#include <cmath>

namespace tiltproof::firmware {
namespace {

using link::FieldContent;
using link::MessageKind;
using link::MessageStatus;
using link::MessageType;

// The message whose coming is answered; null when the client asks for all states.
const MessageType* PaceOf(const link::Protocol& protocol, const LqrSensors& sensors) {
  const MessageType* pace = nullptr;
  for (const MessageType& type : protocol.messages)
    if (type.period_ns > 0 && sensors.Needs(type) && (pace == nullptr || type.period_ns <= pace->period_ns))
      pace = &type;
  return protocol.streams() ? pace : nullptr;
}

// Numbers of a type wrap.
double Wrapped(const link::MessageField& field, double number) {
  return field.scale * std::fmod(number, link::LargestNumber(field.type) + 1);
}

}  // namespace

LqrApplication::LqrApplication(const LqrSetup& setup, CycleLaw* law, Port& port)
    : setup_(setup),
      table_(setup.table),
      protocol_(*setup.protocol),
      // NOLINTNEXTLINE(bugprone-incorrect-roundings): a period is positive.
      period_ns_(static_cast<TimeNs>(table_.period_s * 1e6F + 0.5F) * kNsPerUs),
      port_(port),
      own_law_(table_),
      law_(law),
      sensors_(protocol_, setup.states, setup.rates),
      reader_(protocol_.framing->MakeReader()),
      reference_reader_(protocol_.framing->MakeReader()),
      sent_counts_(protocol_.messages.size()),
      last_numbers_(protocol_.messages.size()),
      pace_(PaceOf(protocol_, sensors_)),
      awaited_(protocol_.messages.size()) {
  if (pace_ != nullptr)
    paces_per_period_ = std::max<std::int64_t>((period_ns_ + pace_->period_ns / 2) / pace_->period_ns, 1);
}

TimeNs LqrApplication::Start(TimeNs now) {
  port_.Log(now, "lqr");
  next_period_ns_ = SendStart(now);
  return Tick(now);
}

void LqrApplication::Receive(Uart uart, std::span<const std::uint8_t> bytes) {
  if (uart > Uart::kReference) return;  // from another board
  const bool is_main = uart == Uart::kMain;
  link::FrameReader& reader = is_main ? *reader_ : *reference_reader_;
  link::Message message;
  while (const auto frame = reader.Next(bytes)) {
    if (!frame->ok) continue;
    const auto direction = is_main ? link::Direction::kToClient : link::Direction::kReference;
    if (protocol_.Decode(direction, frame->payload, message) != MessageStatus::kOk || !IsNew(message))
      continue;
    if (is_main) {
      Accept(message);
    } else {
      ReadReference(protocol_, message, reference_);
    }
  }
}

TimeNs LqrApplication::Tick(TimeNs now) {
  if (ready_ns_ && now >= *ready_ns_) SendCommand(now);
  if (has_states_) Answer(now);
  // Twice at one instant when a `start` leaves without taking time.
  while (now >= next_period_ns_) BeginPeriod(now);
  return ready_ns_ ? std::min(*ready_ns_, next_period_ns_) : next_period_ns_;
}

// A number or a time that is not ahead of the last one, by less than half of its range, is of an old message.
bool LqrApplication::IsNew(const link::Message& message) {
  std::vector<double>& last = last_numbers_[PlaceOf(*message.type)];
  for (std::size_t i = 0; i < last.size(); ++i) {
    const link::MessageField& field = message.type->fields[i];
    if (field.content == FieldContent::kSignal) continue;
    const double range = field.scale * (link::LargestNumber(field.type) + 1);
    const double ahead = message.values[i] - last[i] + (message.values[i] < last[i] ? range : 0);
    if (!(ahead > 0) || ahead >= range / 2) return false;
  }
  last = message.values;
  return true;
}

double LqrApplication::InputField(const link::MessageField& field, std::span<const float> inputs) const {
  const auto found = std::find(setup_.inputs.begin(), setup_.inputs.end(), field.signal);
  if (found == setup_.inputs.end()) return 0;
  const auto input = static_cast<std::size_t>(found - setup_.inputs.begin());
  const double value = inputs[input];
  if (field.as == link::ThrustUnit::kNewton) return value;
  const double share = value / table_.input_max[input];
  return field.as == link::ThrustUnit::kShare ? share : std::copysign(std::sqrt(std::abs(share)), share);
}

TimeNs LqrApplication::Send(TimeNs now, const MessageType& type, std::span<const float> inputs) {
  const std::uint32_t count = sent_counts_[PlaceOf(type)]++;
  const TimeNs now_us = now / kNsPerUs;
  std::vector<double> values;
  for (const link::MessageField& field : type.fields) {
    switch (field.content) {
      case FieldContent::kSequence:
        values.push_back(Wrapped(field, count));
        break;
      case FieldContent::kTimeUs:
        values.push_back(Wrapped(field, std::floor(static_cast<double>(now_us) / field.scale)));
        break;
      case FieldContent::kSignal:
        values.push_back(InputField(field, inputs));
        break;
    }
  }
  const std::vector<std::uint8_t> frame = protocol_.framing->Encode(protocol_.Encode(type, values).span());
  return port_.Transmit(Uart::kMain, now, frame);
}

TimeNs LqrApplication::SendStart(TimeNs now) {
  start_is_fresh_ = true;
  const MessageType* start = protocol_.Find(MessageKind::kStart);
  if (start == nullptr) return now;
  return Send(now, *start, std::span(table_.hover_input.data(), table_.input_count));
}

void LqrApplication::BeginPeriod(TimeNs now) {
  if (!heard_server_ && !start_is_fresh_) {
    next_period_ns_ = SendStart(now);
    return;
  }
  start_is_fresh_ = false;
  if (pace_ != nullptr && (heard_server_ || protocol_.Find(MessageKind::kStart) == nullptr)) {
    next_period_ns_ = kNever;
    return;
  }
  if (pace_ == nullptr) reader_->Finish();  // A reply that is not whole by now answers the request before.
  waiting_ = true;
  requested_ns_ = now;
  for (const MessageType& type : protocol_.messages) {
    if (type.direction != link::Direction::kToPlant || type.reply.empty()) continue;
    const MessageType* reply = protocol_.Find(type.reply);
    awaited_[PlaceOf(*reply)] = sensors_.Needs(*reply);
    Send(now, type, {});
  }
  do {
    next_period_ns_ += period_ns_;
  } while (next_period_ns_ <= now);
}

void LqrApplication::Accept(const link::Message& message) {
  const bool is_own = message.type->period_ns > 0;
  if (!sensors_.Needs(*message.type) || (!is_own && !waiting_)) return;
  heard_server_ = true;
  sensors_.Accept(message);
  if (!is_own) awaited_[PlaceOf(*message.type)] = false;
  if (!sensors_.complete()) return;
  if (pace_ != nullptr) {
    if (message.type != pace_ || pace_count_++ % paces_per_period_ != 0) return;
  } else {
    if (!waiting_ || std::find(awaited_.begin(), awaited_.end(), true) != awaited_.end()) return;
    waiting_ = false;
  }
  has_states_ = true;
}

void LqrApplication::HoldPlace(std::span<const float> sensed) {
  const auto hold = [](float& reference, float place) {
    if (std::isnan(reference)) reference = place;
  };
  hold(reference_.x_m, sensed[0]);
  hold(reference_.y_m, sensed[1]);
  hold(reference_.z_m, sensed[2]);
  hold(reference_.yaw_rad, sensed[5]);
}

void LqrApplication::Answer(TimeNs now) {
  has_states_ = false;
  if (ready_ns_) return;
  const std::array<float, kLqrSensedMax> states = sensors_.States();
  const std::span<const float> sensed(states.data(), table_.sensed_count());
  HoldPlace(sensed);
  const std::span<float> inputs(command_.data(), table_.input_count);
  ready_ns_ = now;
  if (law_ == nullptr) {
    own_law_.Step(sensed, reference_, inputs);
  } else {
    const bool asks = pace_ == nullptr;
    const ControlPeriod period = {.requested = asks ? requested_ns_ : now,
                                  .now = now,
                                  .deadline = asks ? next_period_ns_ : now + period_ns_};
    ready_ns_ = law_->Step(period, sensed, reference_, inputs);
  }
  if (*ready_ns_ <= now) SendCommand(now);
}

void LqrApplication::SendCommand(TimeNs now) {
  ready_ns_.reset();
  const std::span<const float> inputs(command_.data(), table_.input_count);
  for (const MessageType& type : protocol_.messages)
    if (type.kind == MessageKind::kActuators) Send(now, type, inputs);
}

}  // namespace tiltproof::firmware
