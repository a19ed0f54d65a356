#include <array>
#include <utility>

#include "harness/scenario/protocol_file.h"

namespace tiltproof::harness {
namespace {

using link::ByteOrder;
using link::CheckKind;
using link::NumberType;

constexpr auto kRequired = Presence::kRequired;
constexpr double kPeriodMax_ms = 10'000;
constexpr double kIdMax = 4'294'967'295.0;
constexpr double kValueMax = 1e308;
constexpr std::size_t kSyncBytesMax = link::LengthHeader::kSyncBytesMax;

// A generated header has these names, too.
constexpr TextRule kIdentifier = {"[A-Za-z][A-Za-z0-9_]*", "letters, digits and '_', beginning with a letter",
                                  64};

constexpr std::array kOrders = {ByteOrder::kLittle, ByteOrder::kBig};

// A byte order that may be left out.
void DescribeOrder(KeyVisitor& v, std::string_view doc, std::optional<ByteOrder>& order) {
  const std::array<std::string_view, kOrders.size()> words = {Name(kOrders[0]), Name(kOrders[1])};
  std::optional<std::size_t> index;
  if (order) index = *order == kOrders[0] ? 0 : 1;
  v.Choice({"byte_order", doc, Presence::kDerived}, words, index);
  if (index) order = kOrders[*index];
}

void DescribeCheck(KeyVisitor& v, ProtocolSpec& p) {
  Enumeration(v,
              {"check",
               "The check behind the payload, over the payload with its id, by its name in the RevEng "
               "catalogue",
               kRequired},
              std::array{CheckKind::kFletcher16, CheckKind::kCrc16Ibm3740, CheckKind::kCrc16IbmSdlc,
                         CheckKind::kCrc32IsoHdlc, CheckKind::kSum8, CheckKind::kNone},
              p.check);
}

constexpr std::array<Alternative, 3> kFramings = {
    {{"hdlc", "Flags 7E between frames, escapes 7D (RFC 1662)"},
     {"cobs", "Consistent Overhead Byte Stuffing: a 00 ends each frame"},
     {"length_prefixed", "Fixed bytes that mark the start, and the length of the payload"}}};

void DescribeFraming(KeyVisitor& v, ProtocolSpec& p) {
  v.Alternatives(
      {"type", "How a frame begins and ends", kRequired}, kFramings, static_cast<std::size_t>(p.framing),
      [&](KeyVisitor& w, std::size_t index) {
        p.framing = static_cast<FramingType>(index);
        DescribeCheck(w, p);
        if (p.framing != FramingType::kLengthPrefixed) return;
        w.Bytes({"sync", "The bytes that mark the start of a frame", kRequired}, p.sync, kSyncBytesMax);
        Enumeration(w,
                    {"length",
                     "Type of the length, which counts the payload with its id; u16 is "
                     "sent with the low byte first"},
                    std::array{NumberType::kU8, NumberType::kU16}, p.length);
      });
}

void DescribeStart(KeyVisitor& v, ProtocolSpec& p) {
  v.Text({"message", "The client's message whose first arrival makes t = 0, and that has no other use"},
         p.start_message, kIdentifier);
  v.Text({"first", "A client's message of another use whose first arrival makes t = 0, such as actuators"},
         p.first_message, kIdentifier);
  v.ExactlyOne("start", std::array{KeyGroup{"message"}, KeyGroup{"first"}});
  Enumeration(
      v,
      {"repeated", "What the message means when it comes again: a boot of the client, or nothing of its own"},
      std::array{RepeatedStart::kIgnored, RepeatedStart::kBoot}, p.repeated_start);
  v.Bool(
      {"answers_before_start", "The server answers requests before t = 0, while the vehicle does not move"},
      p.answers_before_start);
}

void DescribeField(KeyVisitor& v, FieldSpec& field) {
  v.Text({"signal",
          "A signal of the vehicle or of the reference; `sequence` counts the messages of this name, "
          "`time_us` is the "
          "sender's time in microseconds",
          kRequired},
         field.signal, kIdentifier);
  Enumeration(v, {"type", "Type of the number on the line", kRequired},
              std::array{NumberType::kU8, NumberType::kI8, NumberType::kU16, NumberType::kI16,
                         NumberType::kU32, NumberType::kI32, NumberType::kF32, NumberType::kF64},
              field.type);
  v.Number({"scale", "The value is this times the number on the line"}, field.scale, {1e-300, 1e300});
  v.MaybeNumber({"min", "Least plausible value; beyond it the message counts as damaged"}, field.min,
                {-kValueMax, kValueMax});
  v.MaybeNumber({"max", "Largest plausible value"}, field.max, {-kValueMax, kValueMax});
  Enumeration(
      v,
      {"as", "Unit of a rotor's thrust: newton, share of the largest thrust, or share of the largest speed"},
      std::array{link::ThrustUnit::kNewton, link::ThrustUnit::kShare, link::ThrustUnit::kShareOfSpeed},
      field.as);
  DescribeOrder(v, "Byte order of this field; absent: the file's", field.order);
}

void DescribeMessage(KeyVisitor& v, MessageSpec& message) {
  v.Text({"name", "Unique in the protocol", kRequired}, message.name, kIdentifier);
  v.MaybeNumber({"id", "First number of the payload; absent: the message is the only one of its direction"},
                message.id, {-kIdMax, kIdMax});
  Enumeration(v, {"from", "Who sends the message", kRequired}, std::array{LineEnd::kClient, LineEnd::kServer},
              message.from);
  Enumeration(v, {"line", "The line that carries the message"},
              std::array{LineName::kMain, LineName::kReference}, message.line);
  v.Text({"reply", "The server's message that answers this one"}, message.reply, kIdentifier);
  v.MaybeNumber({"period_ms", "The server sends the message by itself, this often"}, message.period_ms,
                {0.001, kPeriodMax_ms});
  ListOf(v, {"fields", "The numbers of the message, in their order"}, message.fields, DescribeField);
}

}  // namespace

void DescribeProtocol(KeyVisitor& v, ProtocolSpec& p) {
  v.Text({"protocol", "Name of the protocol", kRequired}, p.name, kIdentifier);
  v.Number({"control_period_ms", "Period of the client's requests, or of its actuator messages", kRequired},
           p.control_period_ms, {0.01, kPeriodMax_ms});
  v.Section({"framing", "How payloads become bytes", kRequired},
            [&](KeyVisitor& w) { DescribeFraming(w, p); });
  Enumeration(v,
              {"exchange",
               "request_reply: the client leads, and the server answers; stream: the server sends each "
               "message by itself"},
              std::array{ExchangeType::kRequestReply, ExchangeType::kStream}, p.exchange);
  Enumeration(v, {"byte_order", "Order of the bytes of ids and fields"}, kOrders, p.order);
  v.Section({"id", "How ids are written"}, [&](KeyVisitor& w) {
    Enumeration(w, {"type", "Type of the ids"},
                std::array{NumberType::kU8, NumberType::kU16, NumberType::kF32}, p.id_type);
    DescribeOrder(w, "Byte order of the ids; absent: the file's", p.id_order);
  });
  v.Section({"start", "What makes t = 0", kRequired}, [&](KeyVisitor& w) { DescribeStart(w, p); });
  v.Section({"frames", "Axes of the signals on the line"}, [&](KeyVisitor& w) {
    Enumeration(w, {"world", "enu: x east, y north, z up; ned: x north, y east, z down"},
                std::array{link::WorldAxes::kEnu, link::WorldAxes::kNed}, p.world);
    Enumeration(w, {"body", "flu: x forward, y left, z up; frd: x forward, y right, z down"},
                std::array{link::BodyAxes::kFlu, link::BodyAxes::kFrd}, p.body);
  });
  ListOf(v, {"messages", "The messages of both directions", kRequired}, p.messages, DescribeMessage);
}

}  // namespace tiltproof::harness
