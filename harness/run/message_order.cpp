#include "harness/run/message_order.h"

#include <algorithm>
#include <cmath>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

using link::FieldContent;
using link::MessageField;
using link::NumberType;

// Number of values on the line; of a floating-point number, of the integers that it holds without a gap from 0 on.
double CountOf(NumberType type) {
  if (type == NumberType::kF32) return std::ldexp(1.0, 24);
  if (type == NumberType::kF64) return std::ldexp(1.0, 53);
  return std::ldexp(1.0, static_cast<int>(8 * link::NumberBytes(type)));
}

// The number on the line for a count: of a signed type, its upper half is negative.
double Wrapped(NumberType type, double count) {
  const double number = std::fmod(count, CountOf(type));
  return number > link::LargestNumber(type) ? number - CountOf(type) : number;
}

bool IsNewer(const MessageField& field, double value, double before) {
  const double range = CountOf(field.type);
  double ahead = std::fmod(std::round(value / field.scale) - std::round(before / field.scale), range);
  if (ahead < 0) ahead += range;
  return ahead > 0 && ahead < range / 2;
}

std::size_t PlaceOf(const link::Protocol& protocol, const link::MessageType& type) {
  const auto place = static_cast<std::size_t>(&type - protocol.messages.data());
  CheckIndex(place, protocol.messages.size(), "a message is of its protocol");
  return place;
}

}  // namespace

void MessageStamps::Write(const link::MessageType& type, BootTime now, std::span<double> values) {
  Check(values.size() == type.fields.size(), "a message has a value for each of its fields");
  const std::uint64_t count = counts_[PlaceOf(*protocol_, type)]++;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const MessageField& field = type.fields[i];
    if (field.content == FieldContent::kSequence)
      values[i] = field.scale * Wrapped(field.type, static_cast<double>(count));
    if (field.content == FieldContent::kTimeUs) {
      const TimeNs now_us = now.ns() / kNsPerUs;
      values[i] = field.scale * Wrapped(field.type, std::floor(static_cast<double>(now_us) / field.scale));
    }
  }
}

MessageOrder::MessageOrder(const link::Protocol& protocol)
    : protocol_(&protocol),
      is_used_(std::ranges::any_of(protocol.messages,
                                   [](const link::MessageType& type) {
                                     return std::ranges::any_of(type.fields, [](const MessageField& field) {
                                       return field.content != FieldContent::kSignal;
                                     });
                                   })),
      last_(protocol.messages.size()) {}

bool MessageOrder::Judge(const link::Message& message) {
  if (message.type->starts && protocol_->repeated_start_is_boot) last_.assign(last_.size(), {});
  std::vector<double>& last = last_[PlaceOf(*protocol_, *message.type)];
  for (std::size_t i = 0; i < last.size(); ++i) {
    const MessageField& field = message.type->fields[i];
    if (field.content != FieldContent::kSignal && !IsNewer(field, message.values[i], last[i])) return false;
  }
  last = message.values;
  return true;
}

}  // namespace tiltproof::harness
