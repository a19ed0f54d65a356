#include "firmware/ports/host/lqr_parameters.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "link/cobs_framing.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"
#include "link/protocol.h"

namespace tiltproof::firmware {
namespace {

using Json = nlohmann::json;
using link::MessageField;
using link::MessageKind;
using link::MessageType;
using link::NumberType;

constexpr std::size_t kMessagesMax = 256;

// Null when this is no object or has no such key.
const Json* Find(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found == json.end() ? nullptr : &*found;
}
// The text of a string at that key; empty when there is none.
std::string_view TextAt(const Json& json, const char* key) {
  const Json* value = Find(json, key);
  const auto* text = value == nullptr ? nullptr : value->get_ptr<const std::string*>();
  return text == nullptr ? std::string_view() : *text;
}
// nullopt when this is no number, or not one of the type.
template <class Number>
std::optional<Number> NumberOf(const Json& json) {
  if constexpr (std::is_floating_point_v<Number>) {
    if (!json.is_number()) return std::nullopt;
    const double value = json.get<double>();
    if (!(std::abs(value) <= std::numeric_limits<Number>::max())) return std::nullopt;
    return static_cast<Number>(value);
  } else {
    if (!json.is_number_integer()) return std::nullopt;
    const auto value = json.get<std::int64_t>();
    if (!std::in_range<Number>(value)) return std::nullopt;
    return static_cast<Number>(value);
  }
}
// nullopt when there is no number at that key, or not one of the type.
template <class Number>
std::optional<Number> NumberAt(const Json& json, const char* key) {
  const Json* value = Find(json, key);
  return value == nullptr ? std::nullopt : NumberOf<Number>(*value);
}

// Sets `to` to the value whose Name() this is.
template <class Enum, std::size_t n>
bool FindNamed(std::string_view name, const std::array<Enum, n>& all, Enum& to) {
  for (const Enum each : all) {
    if (Name(each) != name) continue;
    to = each;
    return true;
  }
  return false;
}
bool ReadType(std::string_view name, NumberType& to) {
  static constexpr std::array kAll = {NumberType::kU8,  NumberType::kI8,  NumberType::kU16, NumberType::kI16,
                                      NumberType::kU32, NumberType::kI32, NumberType::kF32, NumberType::kF64};
  return FindNamed(name, kAll, to);
}
bool ReadCheck(std::string_view name, link::CheckKind& to) {
  using enum link::CheckKind;
  static constexpr std::array kAll = {kFletcher16, kCrc16Ibm3740, kCrc16IbmSdlc, kCrc32IsoHdlc, kSum8, kNone};
  return FindNamed(name, kAll, to);
}
link::ByteOrder OrderOf(const Json& json) {
  return TextAt(json, "byte_order") == "big" ? link::ByteOrder::kBig : link::ByteOrder::kLittle;
}

std::shared_ptr<const link::Framing> ReadFraming(const Json& json) {
  link::CheckKind check{};
  if (!ReadCheck(TextAt(json, "check"), check)) return nullptr;
  const std::string_view type = TextAt(json, "type");
  if (type == "hdlc") return link::MakeHdlcFraming(check);
  if (type == "cobs") return link::MakeCobsFraming(check);
  const Json* sync = Find(json, "sync");
  if (type != "length_prefixed" || sync == nullptr) return nullptr;
  link::LengthFormat format;
  format.length_bytes = TextAt(json, "length") == "u16" ? 2 : 1;
  for (const Json& byte : *sync) format.sync.push_back(NumberOf<std::uint8_t>(byte).value_or(0));
  if (format.sync.empty() || format.sync.size() > link::LengthHeader::kSyncBytesMax) return nullptr;
  return link::MakeLengthFraming(format, check);
}

bool ReadField(const Json& json, MessageField& field) {
  field.signal = TextAt(json, "signal");
  const auto min = NumberAt<double>(json, "min"), max = NumberAt<double>(json, "max"),
             scale = NumberAt<double>(json, "scale");
  if (field.signal.empty() || !min || !max || !scale || !(*scale > 0)) return false;
  field.min = *min;
  field.max = *max;
  field.scale = *scale;
  field.order = OrderOf(json);
  if (field.signal == "sequence") field.content = link::FieldContent::kSequence;
  if (field.signal == "time_us") field.content = link::FieldContent::kTimeUs;
  if (TextAt(json, "as") == "share") field.as = link::ThrustUnit::kShare;
  if (TextAt(json, "as") == "share_of_speed") field.as = link::ThrustUnit::kShareOfSpeed;
  return ReadType(TextAt(json, "type"), field.type);
}

bool ReadMessage(const Json& json, MessageType& type) {
  type.name = TextAt(json, "name");
  type.reply = TextAt(json, "reply");
  const Json* starts = Find(json, "starts");
  type.starts = starts != nullptr && *starts == true;
  type.period_ns = NumberAt<TimeNs>(json, "period_ns").value_or(0);
  type.direction = TextAt(json, "line") == "reference" ? link::Direction::kReference
                   : TextAt(json, "from") == "client"  ? link::Direction::kToPlant
                                                       : link::Direction::kToClient;
  static constexpr std::array kKinds = {MessageKind::kStart, MessageKind::kRequest, MessageKind::kActuators,
                                        MessageKind::kReply, MessageKind::kReference};
  FindNamed(TextAt(json, "role"), kKinds, type.kind);  // any other has no meaning for a client
  if (const Json* id = Find(json, "id"); id != nullptr && id->is_object()) {
    type.id =
        link::MessageId{.order = OrderOf(*id), .bits = NumberAt<std::uint32_t>(*id, "bits").value_or(0)};
    if (!ReadType(TextAt(*id, "type"), type.id->type)) return false;
  }
  const Json* fields = Find(json, "fields");
  if (fields == nullptr || type.name.empty()) return false;
  for (const Json& field : *fields)
    if (!ReadField(field, type.fields.emplace_back())) return false;
  type = LayOut(std::move(type));
  return type.payload_bytes <= link::kPayloadBytesMax;
}

std::shared_ptr<const link::Protocol> ReadProtocol(const Json& json, double period_s) {
  auto protocol = std::make_shared<link::Protocol>();
  protocol->name = TextAt(json, "name");
  const Json *framing = Find(json, "framing"), *messages = Find(json, "messages");
  if (framing == nullptr || messages == nullptr || messages->size() > kMessagesMax) return nullptr;
  protocol->framing = ReadFraming(*framing);
  if (protocol->framing == nullptr) return nullptr;
  protocol->control_period_ns = std::llround(period_s * 1e9);
  protocol->world = TextAt(json, "world") == "ned" ? link::WorldAxes::kNed : link::WorldAxes::kEnu;
  protocol->body = TextAt(json, "body") == "frd" ? link::BodyAxes::kFrd : link::BodyAxes::kFlu;
  for (const Json& message : *messages)
    if (!ReadMessage(message, protocol->messages.emplace_back())) return nullptr;
  for (const MessageType& type : protocol->messages)
    if (!type.reply.empty() && protocol->Find(type.reply) == nullptr) return nullptr;
  if (protocol->Find(MessageKind::kActuators) == nullptr) return nullptr;
  return protocol;
}

// A number of each object of a list.
bool ReadEach(const Json& list, const char* key, std::span<float> into) {
  if (!list.is_array() || list.size() > into.size()) return false;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const auto value = NumberAt<float>(list[i], key);
    if (!value) return false;
    into[i] = *value;
  }
  return true;
}

std::vector<std::string> NamesOf(const Json& list) {
  std::vector<std::string> names;
  for (const Json& item : list) names.emplace_back(TextAt(item, "name"));
  return names;
}

bool ReadGain(const Json& rows, LqrTable& table) {
  if (!rows.is_array() || rows.size() != table.input_count) return false;
  for (std::size_t row = 0; row < rows.size(); ++row) {
    const Json& columns = rows[row];
    if (!columns.is_array() || columns.size() != table.sensed_count() + kLqrIntegralCount) return false;
    for (std::size_t column = 0; column < columns.size(); ++column) {
      const auto value = NumberOf<float>(columns[column]);
      if (!value) return false;
      table.gain[row][column] = *value;
    }
  }
  return true;
}

}  // namespace

std::size_t ReadPlace(const char* parameters) {
  if (parameters == nullptr) return 0;
  const Json json = Json::parse(parameters, nullptr, /*allow_exceptions=*/false);
  const Json* client = json.is_object() ? Find(json, "client") : nullptr;
  return client != nullptr && client->is_object() ? NumberAt<std::size_t>(*client, "place").value_or(0) : 0;
}

bool ReadLqrSetup(const char* parameters, LqrSetup& setup) {
  if (parameters == nullptr) return false;
  const Json json = Json::parse(parameters, nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) return false;
  setup = {};
  LqrTable& table = setup.table;
  const auto period_s = NumberAt<double>(json, "control_period_s");
  const Json *states = Find(json, "states"), *inputs = Find(json, "inputs"), *gain = Find(json, "gain"),
             *protocol = Find(json, "protocol");
  if (!period_s || !(*period_s > 0) || !(*period_s < 1000) || states == nullptr || inputs == nullptr ||
      gain == nullptr || protocol == nullptr)
    return false;
  const std::size_t state_count = states->size();
  if (state_count < 12 || state_count % 2 != 0 || inputs->empty() ||
      !ReadEach(*states, "hover", table.hover_state) || !ReadEach(*inputs, "hover", table.hover_input) ||
      !ReadEach(*inputs, "min", table.input_min) || !ReadEach(*inputs, "max", table.input_max))
    return false;
  table.period_s = static_cast<float>(*period_s);
  table.hinge_count = state_count / 2 - 6;
  table.input_count = inputs->size();
  setup.states = NamesOf(*states);
  setup.inputs = NamesOf(*inputs);
  setup.rates = TextAt(json, "angular_rates") == "body"    ? RatesAxes::kBody
                : TextAt(json, "angular_rates") == "euler" ? RatesAxes::kEuler
                                                           : RatesAxes::kWorld;
  setup.protocol = ReadProtocol(*protocol, *period_s);
  if (setup.protocol == nullptr) return false;
  const LqrSensors sensors(*setup.protocol, setup.states, setup.rates);
  table.rates_in_world = setup.rates == RatesAxes::kWorld && !sensors.rates_from_gyro();
  return sensors.missing().empty() && ReadGain(*gain, table);
}

}  // namespace tiltproof::firmware
