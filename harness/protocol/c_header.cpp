#include "harness/protocol/c_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "harness/protocol/c_header_text.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

using link::ByteOrder;
using link::CheckKind;
using link::Direction;
using link::FieldContent;
using link::MessageField;
using link::MessageType;
using link::NumberType;
using link::Protocol;

using Replacement = std::pair<std::string_view, std::string>;

std::string Replaced(std::string_view text, const std::vector<Replacement>& replacements) {
  std::string result(text);
  for (const auto& [from, to] : replacements)
    for (std::size_t at = 0; (at = result.find(from, at)) != std::string::npos; at += to.size())
      result.replace(at, from.size(), to);
  return result;
}

std::string UpperCase(std::string text) {
  for (char& c : text)
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  return text;
}

bool IsLetter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// A C identifier; words of C and C++ get an underscore.
std::string Identifier(std::string_view name) {
  static constexpr std::array<std::string_view, 20> kWords = {
      "and", "auto", "bool", "char", "class", "const", "double", "float",    "for",  "if",
      "int", "long", "new",  "not",  "or",    "short", "signed", "unsigned", "void", "xor"};
  std::string result;
  for (const char c : name) result += IsLetter(c) || IsDigit(c) ? c : '_';
  if (result.empty() || IsDigit(result.front())) result.insert(result.begin(), '_');
  if (std::find(kWords.begin(), kWords.end(), result) != kWords.end()) result += '_';
  return result;
}

// The identifiers of these names. Constants have them in capitals, so they differ in more than that.
std::vector<std::string> Identifiers(const std::vector<std::string>& names) {
  std::vector<std::string> result, taken;
  for (const std::string& name : names) {
    std::string identifier = Identifier(name);
    while (std::find(taken.begin(), taken.end(), UpperCase(identifier)) != taken.end()) identifier += '_';
    taken.push_back(UpperCase(identifier));
    result.push_back(std::move(identifier));
  }
  return result;
}

// The shortest literal of the same double.
std::string Literal(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}
std::string FloatLiteral(float value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text + "f";
}

// The floats in a range of doubles are those from the first result to the second.
std::pair<float, float> FloatRange(double min, double max) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  auto least = static_cast<float>(min), largest = static_cast<float>(max);
  if (static_cast<double>(least) < min) least = std::nextafter(least, kInfinity);
  if (static_cast<double>(largest) > max) largest = std::nextafter(largest, -kInfinity);
  return {least, largest};
}

bool IsSigned(NumberType type) { return link::LeastNumber(type) < 0; }
bool IsScaled(const MessageField& field) { return field.scale != 1.0; }
bool IsCount(const MessageField& field) {
  return field.content != FieldContent::kSignal && IsInteger(field.type) && !IsSigned(field.type);
}
// The value of its struct is the number on the line, in binary32.
bool IsPlainFloat(const MessageField& field) { return field.type == NumberType::kF32 && !IsScaled(field); }
bool CanBeOutOfRange(const MessageField& field) {
  return field.scale * link::LeastNumber(field.type) < field.min ||
         field.scale * link::LargestNumber(field.type) > field.max;
}
int IsBig(ByteOrder order) { return order == ByteOrder::kBig ? 1 : 0; }

std::string_view LineName(Direction direction) {
  switch (direction) {
    case Direction::kToPlant:
      return "FROM_CLIENT";
    case Direction::kToClient:
      return "FROM_SERVER";
    case Direction::kReference:
      return "ON_REFERENCE_LINE";
  }
  ThrowBrokenInvariant("a direction of a line");
}

std::string_view UnitOf(const MessageField& field) {
  if (field.as == link::ThrustUnit::kShare) return "share of the largest thrust";
  if (field.as == link::ThrustUnit::kShareOfSpeed) return "share of the largest speed";
  if (field.content == FieldContent::kSequence) return "count of the sender's messages of this type, wraps";
  if (field.content == FieldContent::kTimeUs) return "us of the sender's clock, wraps";
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 12> kUnits = {
      {{"_rad_s", "rad/s"},
       {"_m_s2", "m/s^2"},
       {"_m_s", "m/s"},
       {"_rad", "rad"},
       {"_nm", "N m"},
       {"_pa", "Pa"},
       {"_ut", "uT"},
       {"_deg", "deg"},
       {"_m", "m"},
       {"_n", "N"},
       {"_s", "s"},
       {"_t", "T"}}};
  for (const auto& [suffix, unit] : kUnits)
    if (field.signal.ends_with(suffix)) return unit;
  return "no unit";
}

// One message, with all names of it in the header.
struct Named {
  const MessageType& type;
  std::string name;
  std::vector<std::string> fields;
};

// The bits of an id, or the number of it in a comment.
std::string IdText(const link::MessageId& id) {
  if (id.type != NumberType::kF32) return fmt::format("{}", id.bits);
  std::array<std::uint8_t, 4> bytes{};
  link::StoreBits(id.type, ByteOrder::kLittle, id.bits, bytes);
  return fmt::format("{}", link::LoadNumber(id.type, ByteOrder::kLittle, bytes));
}

std::string Constants(const Named& message) {
  const MessageType& type = message.type;
  std::string text = fmt::format("\n/* ---- Message '{}'{}, {} bytes", message.name,
                                 type.id ? fmt::format(", id {} ({})", IdText(*type.id), Name(type.id->type))
                                         : std::string(", without an id"),
                                 type.payload_bytes);
  if (!type.reply.empty()) text += fmt::format("; the server answers with '{}'", Identifier(type.reply));
  if (type.period_ns > 0)
    text += fmt::format("; the server sends it every {} ms by itself",
                        static_cast<double>(type.period_ns) / kNsPerMs);
  if (type.starts) text += "; the first one makes t = 0";
  text += ". */\n";
  const std::string capitals = UpperCase(message.name);
  text += fmt::format("#define @P@_PAYLOAD_BYTES_{} {}\n", capitals, type.payload_bytes);
  text += fmt::format("#define @P@_FRAME_BYTES_{} @P@_FRAME_ROOM({}) /* at most */\n", capitals,
                      type.payload_bytes);
  return text;
}

std::string Struct(const Named& message) {
  if (message.fields.empty()) return {};
  std::string text = fmt::format("\nstruct @p@_msg_{} {{\n", message.name);
  for (std::size_t i = 0; i < message.fields.size(); ++i) {
    const MessageField& field = message.type.fields[i];
    text += fmt::format("  {} {}; /* {}", CFieldType(field), message.fields[i], UnitOf(field));
    if (!IsCount(field)) text += fmt::format(", {} to {}", field.min, field.max);
    text += fmt::format("; {} at byte {}", Name(field.type), field.offset);
    if (NumberBytes(field.type) > 1 && field.order == ByteOrder::kBig) text += ", big endian";
    if (IsScaled(field)) text += fmt::format(", times {}", field.scale);
    text += " */\n";
  }
  return text + "};\n";
}

std::string StoreField(const MessageField& field, const std::string& name) {
  const std::string value = IsScaled(field)
                                ? fmt::format("(double)message->{} / {}", name, Literal(field.scale))
                                : "message->" + name;
  const int is_big = IsBig(field.order);
  if (field.type == NumberType::kF64)
    return fmt::format("  @p@_store_double(payload + {}, {}, {});\n", field.offset, is_big, value);
  std::string bits;
  if (field.type == NumberType::kF32) {
    bits = IsScaled(field) ? fmt::format("@p@_float_bits((float)({}))", value)
                           : fmt::format("@p@_float_bits({})", value);
  } else if (IsCount(field)) {
    bits = value;
  } else {
    bits = fmt::format("@p@_nearest({}{}, {}, {})", IsScaled(field) ? "" : "(double)", value,
                       Literal(link::LeastNumber(field.type)), Literal(link::LargestNumber(field.type)));
  }
  return fmt::format("  @p@_store(payload + {}, {}, {}, {});\n", field.offset, NumberBytes(field.type),
                     is_big, bits);
}

// Encoders: of the payload, and of the frame.
std::string Encoders(const Named& message) {
  const MessageType& type = message.type;
  const std::string capitals = UpperCase(message.name);
  const std::string parameter =
      message.fields.empty() ? "" : fmt::format("const struct @p@_msg_{}* message, ", message.name);
  std::string text = fmt::format(
      "\n/* Returns the length. Values are sent as they are, even those that the receiver refuses. */\n"
      "static inline size_t @p@_encode_{}(\n    {}uint8_t payload[@P@_PAYLOAD_BYTES_{}]) {{\n",
      message.name, parameter, capitals);
  if (type.id)
    text += fmt::format("  @p@_store(payload, {}, {}, 0x{:X}u);\n", NumberBytes(type.id->type),
                        IsBig(type.id->order), type.id->bits);
  for (std::size_t i = 0; i < message.fields.size(); ++i)
    text += StoreField(type.fields[i], message.fields[i]);
  text += fmt::format("  return @P@_PAYLOAD_BYTES_{};\n}}\n", capitals);
  text += fmt::format(
      "/* The same as a frame. Returns its length. */\n"
      "static inline size_t @p@_send_{0}(\n    {1}uint8_t frame[@P@_FRAME_BYTES_{2}]) {{\n"
      "  uint8_t payload[@P@_PAYLOAD_BYTES_{2}];\n"
      "  return @p@_frame(payload, @p@_encode_{0}({3}payload), frame);\n}}\n",
      message.name, parameter, capitals, message.fields.empty() ? "" : "message, ");
  return text;
}

// The declaration of what was received for a field, and the conditions under which it is no number, or out of range.
struct LoadedField {
  std::string declaration, not_finite, out_of_range;
};

LoadedField Load(const MessageField& field, std::size_t index) {
  const int is_big = IsBig(field.order);
  const std::string v = fmt::format("v{}", index);
  LoadedField loaded;
  std::string number;
  if (field.type == NumberType::kF64) {
    number = fmt::format("@p@_load_double(payload + {}, {})", field.offset, is_big);
  } else {
    number = fmt::format("@p@_load(payload + {}, {}, {})", field.offset, NumberBytes(field.type), is_big);
    if (field.type == NumberType::kF32) number = fmt::format("@p@_float({})", number);
    if (IsSigned(field.type) && IsInteger(field.type))
      number = fmt::format("@p@_signed({}, 0x{:X}u)", number,
                           std::uint64_t{1} << (8 * NumberBytes(field.type) - 1));
  }
  if (IsCount(field)) {
    const std::string_view type = CFieldType(field);
    loaded.declaration = fmt::format("  const {} {} = ({}){};\n", type, v, type, number);
    if (CanBeOutOfRange(field))
      loaded.out_of_range = fmt::format("{0} < {1} || {0} > {2}", v, Literal(field.min), Literal(field.max));
    return loaded;
  }
  if (IsPlainFloat(field)) {
    const auto [least, largest] = FloatRange(field.min, field.max);
    loaded.declaration = fmt::format("  const float {} = {};\n", v, number);
    loaded.not_finite = fmt::format("!({0} >= -3.4028235e+38f && {0} <= 3.4028235e+38f)", v);
    if (CanBeOutOfRange(field))
      loaded.out_of_range =
          fmt::format("{0} < {1} || {0} > {2}", v, FloatLiteral(least), FloatLiteral(largest));
    return loaded;
  }
  loaded.declaration =
      IsScaled(field) ? fmt::format("  const double {} = {} * (double){};\n", v, Literal(field.scale), number)
                      : fmt::format("  const double {} = (double){};\n", v, number);
  if (!IsInteger(field.type))
    loaded.not_finite =
        fmt::format("!({0} >= -1.7976931348623157e+308 && {0} <= 1.7976931348623157e+308)", v);
  if (CanBeOutOfRange(field))
    loaded.out_of_range = fmt::format("{0} < {1} || {0} > {2}", v, Literal(field.min), Literal(field.max));
  return loaded;
}

std::string Conditions(const std::vector<std::string>& conditions, std::string_view status) {
  std::string text;
  for (const std::string& each : conditions) text += (text.empty() ? "  if (" : " ||\n      ") + each;
  return text.empty() ? text : text + fmt::format(")\n    return @P@_{};\n", status);
}

std::string Decoder(const Named& message) {
  const MessageType& type = message.type;
  const std::string capitals = UpperCase(message.name);
  std::string text = fmt::format(
      "/* @P@_OK, and sets `message`, only if the payload is this message: its id, its exact length, every "
      "value finite and in\n"
      " * its range. A check misses some damage, so all of these are compared. */\n"
      "static inline enum @p@_status @p@_decode_{}(\n    const uint8_t* payload, size_t payload_bytes{}) "
      "{{\n",
      message.name, message.fields.empty() ? "" : fmt::format(", struct @p@_msg_{}* message", message.name));
  std::string declarations, stores;
  std::vector<std::string> not_finite, out_of_range;
  for (std::size_t i = 0; i < message.fields.size(); ++i) {
    const LoadedField loaded = Load(type.fields[i], i);
    declarations += loaded.declaration;
    if (!loaded.not_finite.empty()) not_finite.push_back(loaded.not_finite);
    if (!loaded.out_of_range.empty()) out_of_range.push_back(loaded.out_of_range);
    stores += fmt::format(
        "  message->{} = {}v{};\n", message.fields[i],
        CFieldType(type.fields[i]) == "float" && !IsPlainFloat(type.fields[i]) ? "(float)" : "", i);
  }
  if (type.id)
    text += fmt::format(
        "  if (payload_bytes < {0}) return @P@_BAD_LENGTH;\n"
        "  if (@p@_load(payload, {0}, {1}) != 0x{2:X}u) return @P@_UNKNOWN_ID;\n",
        NumberBytes(type.id->type), IsBig(type.id->order), type.id->bits);
  text += fmt::format("  if (payload_bytes != @P@_PAYLOAD_BYTES_{}) return @P@_BAD_LENGTH;\n", capitals);
  if (!type.id && message.fields.empty()) text += "  (void)payload;\n";
  text +=
      declarations + Conditions(not_finite, "NOT_FINITE") + Conditions(out_of_range, "OUT_OF_RANGE") + stores;
  return text + "  return @P@_OK;\n}\n";
}

// Finds the type of a payload, as Protocol::Classify() does.
std::string Identify(const std::vector<Named>& messages) {
  std::string text =
      "\n/* ---- The type of a payload, by its id and length. @P@_OK, and sets `type`, if there is one. "
      "*/\n\n"
      "enum @p@_type {";
  for (std::size_t i = 0; i < messages.size(); ++i)
    text += fmt::format("{} @P@_MSG_{}", i == 0 ? "" : ",", UpperCase(messages[i].name));
  text +=
      " };\n\nstatic inline enum @p@_status @p@_identify(enum @p@_line line, const uint8_t* payload, size_t "
      "payload_bytes,\n"
      "                                             enum @p@_type* type) {\n  (void)payload;\n";
  for (const Named& message : messages) {
    text += fmt::format("  if (line == @P@_{}) {{\n", LineName(message.type.direction));
    if (const auto& id = message.type.id) {
      text += fmt::format("    if (payload_bytes < {}) return @P@_BAD_LENGTH;\n", NumberBytes(id->type));
      text += fmt::format("    if (@p@_load(payload, {}, {}) == 0x{:X}u) {{\n", NumberBytes(id->type),
                          IsBig(id->order), id->bits);
    } else {
      text += "    {\n";
    }
    text += fmt::format(
        "      *type = @P@_MSG_{0};\n"
        "      return payload_bytes == @P@_PAYLOAD_BYTES_{0} ? @P@_OK : @P@_BAD_LENGTH;\n    }}\n  }}\n",
        UpperCase(message.name));
  }
  return text + "  return @P@_UNKNOWN_ID;\n}\n";
}

// --- The framing.

std::string_view CheckText(CheckKind check) {
  switch (check) {
    case CheckKind::kFletcher16:
      return c_header::kFletcher16;
    case CheckKind::kCrc16Ibm3740:
      return c_header::kCrc16Ibm3740;
    case CheckKind::kCrc16IbmSdlc:
      return c_header::kCrc16IbmSdlc;
    case CheckKind::kCrc32IsoHdlc:
      return c_header::kCrc32IsoHdlc;
    case CheckKind::kSum8:
      return c_header::kSum8;
    case CheckKind::kNone:
      return {};
  }
  ThrowBrokenInvariant("a kind of check");
}

struct FramingText {
  std::string_view code;
  std::string room;   // of a frame, for n bytes of payload and check
  std::string reset;  // of the reader
  std::vector<Replacement> replacements = {};
};

std::string BytesText(std::span<const std::uint8_t> bytes, std::string_view format) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    if (!text.empty()) text += ", ";
    text += fmt::format(fmt::runtime(format), byte);
  }
  return text;
}

FramingText LengthPrefixed(const link::Framing& framing) {
  const std::span<const std::uint8_t> sync = framing.special_bytes();
  const std::size_t header_bytes = framing.Encode({}).size() - framing.check_bytes();
  const std::size_t length_bytes = header_bytes - sync.size();
  // The longest part of the marks with which their first i bytes end.
  std::vector<std::uint8_t> shorter(sync.size(), 0);
  for (std::size_t i = 1; i < sync.size(); ++i)
    for (std::size_t size = 1; size < i; ++size)
      if (std::equal(sync.begin(), sync.begin() + static_cast<std::ptrdiff_t>(size),
                     sync.begin() + static_cast<std::ptrdiff_t>(i - size)))
        shorter[i] = static_cast<std::uint8_t>(size);
  const std::size_t largest = length_bytes == 1 ? 0xFF : 0xFFFF;
  return {.code = c_header::kLengthPrefixed,
          .room = fmt::format("(n) + {}", header_bytes),
          .reset = "  reader->state = 0;\n  reader->count = 0;\n",
          .replacements = {{"@sync_count@", std::to_string(sync.size())},
                           {"@sync@", BytesText(sync, "0x{:02X}")},
                           {"@shorter@", BytesText(shorter, "{}")},
                           {"@length_bytes@", std::to_string(length_bytes)},
                           {"@payload_max@", std::to_string(std::min(link::kPayloadBytesMax, largest))}}};
}

FramingText TextOf(const link::Framing& framing) {
  if (framing.name() == "hdlc")
    return {.code = c_header::kHdlc,
            .room = "2 * (n) + 2",
            .reset = "  reader->state = 0;\n  reader->size = 0;\n"};
  if (framing.name() == "cobs")
    return {.code = c_header::kCobs,
            .room = "(n) + 2 + (n) / 254",
            .reset = "  reader->size = 0;\n  reader->left = 0;\n  reader->state = 0;\n"};
  Check(framing.name() == "length_prefixed", "a framing that has a C header");
  return LengthPrefixed(framing);
}

std::string Frames(const link::Framing& framing) {
  const FramingText own = TextOf(framing);
  const CheckKind check = framing.check().value_or(CheckKind::kNone);
  std::vector<Replacement> replacements = own.replacements;
  replacements.emplace_back("@put_check@", check == CheckKind::kNone ? "" : c_header::kPutCheck);
  replacements.emplace_back("@check_is_big@", check == CheckKind::kCrc16Ibm3740 ? "1" : "0");
  replacements.emplace_back("@reset@", own.reset);
  std::string text = "\n/* ---- Frames, with any payload in them. */\n";
  text += CheckText(check);
  text += check == CheckKind::kNone ? c_header::kUnchecked : c_header::kChecked;
  text += own.code;
  text += c_header::kReset;
  return Replaced(text, replacements);
}

constexpr std::string_view kTop =
    R"c(/* The protocol '@name@' for a firmware in C99 or C++11. `tiltproof protocol header` wrote this file: write
 * it again when the protocol has changed. It needs no library, no heap and no globals.
 *
 *   struct @p@_reader reader;                            one for each line
 *   @p@_reset(&reader);
 *   for each byte that arrives:
 *     size_t size = @p@_take(&reader, byte);             not 0 when the byte ends a frame with a right check
 *     @p@_decode_MESSAGE(reader.bytes, size, &message)   @P@_OK when the payload is that message
 *   size_t size = @p@_send_MESSAGE(&message, frame);     the bytes to send
 *
 * Units are SI, angles rad. World axes: @world@. Body axes: @body@. A value of 8 or 16 bits,
 * or an unscaled f32, is a float; other values are doubles. Compile without -ffast-math, which takes NaN for a number. */
#ifndef @P@_PROTOCOL_H
#define @P@_PROTOCOL_H

#include <stddef.h>
#include <stdint.h>

#define @P@_CONTROL_PERIOD_NS @period_ns@ /* of the client */
#define @P@_CHECK_BYTES @check_bytes@
/* Longest payload that a reader takes. Define a larger one in front of the header to read longer ones of your own. */
#ifndef @P@_LONGEST_PAYLOAD
#define @P@_LONGEST_PAYLOAD @longest@
#endif
/* Longest frame of a payload. */
#define @P@_STUFFED(n) (@room@)
#define @P@_FRAME_ROOM(payload_bytes) @P@_STUFFED((payload_bytes) + @P@_CHECK_BYTES)
)c";

bool Any(const Protocol& protocol, bool (*holds)(const MessageField&)) {
  return std::any_of(protocol.messages.begin(), protocol.messages.end(), [&](const MessageType& type) {
    return std::any_of(type.fields.begin(), type.fields.end(), holds);
  });
}

}  // namespace

std::string CPrefix(const Protocol& protocol) {
  std::string prefix = Identifier(protocol.name);
  for (char& c : prefix)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return prefix;
}

std::vector<std::string> CMessageNames(const Protocol& protocol) {
  std::vector<std::string> names;
  for (const MessageType& type : protocol.messages) names.push_back(type.name);
  return Identifiers(names);
}

std::vector<std::string> CFieldNames(const MessageType& type) {
  std::vector<std::string> names;
  for (const MessageField& field : type.fields) names.push_back(field.signal);
  return Identifiers(names);
}

std::string_view CFieldType(const MessageField& field) {
  if (IsCount(field)) {
    const std::size_t bytes = NumberBytes(field.type);
    return bytes == 1 ? "uint8_t" : bytes == 2 ? "uint16_t" : "uint32_t";
  }
  if (IsPlainFloat(field)) return "float";
  // Floats of normal size keep the 16 bits of the number.
  constexpr double kScaleMin = 1e-30, kScaleMax = 1e30;
  const bool is_short = IsInteger(field.type) && NumberBytes(field.type) <= 2;
  return is_short && field.scale >= kScaleMin && field.scale <= kScaleMax ? "float" : "double";
}

std::string CHeader(const Protocol& protocol) {
  const std::vector<std::string> names = CMessageNames(protocol);
  std::vector<Named> messages;
  std::size_t longest = 1;
  for (std::size_t i = 0; i < names.size(); ++i) {
    messages.push_back({protocol.messages[i], names[i], CFieldNames(protocol.messages[i])});
    longest = std::max(longest, protocol.messages[i].payload_bytes);
  }
  std::string text(kTop);
  text += c_header::kCommon;
  if (Any(protocol, [](const MessageField& field) { return field.type == NumberType::kF64; }))
    text += c_header::kDoubles;
  if (Any(protocol, [](const MessageField& field) { return IsInteger(field.type) && !IsCount(field); }))
    text += c_header::kIntegers;
  if (Any(protocol, IsCount)) text += c_header::kNewer;
  text += Frames(*protocol.framing);
  for (const Named& message : messages)
    text += Constants(message) + Struct(message) + Encoders(message) + Decoder(message);
  text += Identify(messages) + "\n#endif\n";
  const std::string prefix = CPrefix(protocol);
  // Names and numbers of the protocol come last, so that nothing in them is replaced.
  return Replaced(text, {{"@world@", protocol.world == link::WorldAxes::kEnu ? "x east, y north, z up"
                                                                             : "x north, y east, z down"},
                         {"@body@", protocol.body == link::BodyAxes::kFlu ? "x forward, y left, z up"
                                                                          : "x forward, y right, z down"},
                         {"@period_ns@", std::to_string(protocol.control_period_ns)},
                         {"@check_bytes@", std::to_string(protocol.framing->check_bytes())},
                         {"@longest@", std::to_string(longest)},
                         {"@room@", TextOf(*protocol.framing).room},
                         {"@P@", UpperCase(prefix)},
                         {"@p@", prefix},
                         {"@name@", prefix}});
}

}  // namespace tiltproof::harness
