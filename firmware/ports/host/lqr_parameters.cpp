#include "firmware/ports/host/lqr_parameters.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "firmware/ports/host/json.h"
#include "link/cobs_framing.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"
#include "link/protocol.h"

namespace tiltproof::firmware {
namespace {

using link::MessageField;
using link::MessageKind;
using link::MessageType;
using link::NumberType;

constexpr std::size_t kMessagesMax = 256;

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
  return json.TextAt("byte_order") == "big" ? link::ByteOrder::kBig : link::ByteOrder::kLittle;
}

std::shared_ptr<const link::Framing> ReadFraming(const Json& json) {
  link::CheckKind check{};
  if (!ReadCheck(json.TextAt("check"), check)) return nullptr;
  const std::string_view type = json.TextAt("type");
  if (type == "hdlc") return link::MakeHdlcFraming(check);
  if (type == "cobs") return link::MakeCobsFraming(check);
  const Json* sync = json.Find("sync");
  if (type != "length_prefixed" || sync == nullptr) return nullptr;
  link::LengthFormat format;
  format.length_bytes = json.TextAt("length") == "u16" ? 2 : 1;
  for (const Json& byte : sync->items) format.sync.push_back(byte.As<std::uint8_t>().value_or(0));
  if (format.sync.empty() || format.sync.size() > link::LengthHeader::kSyncBytesMax) return nullptr;
  return link::MakeLengthFraming(format, check);
}

bool ReadField(const Json& json, MessageField& field) {
  field.signal = json.TextAt("signal");
  const auto min = json.NumberAt<double>("min"), max = json.NumberAt<double>("max"),
             scale = json.NumberAt<double>("scale");
  if (field.signal.empty() || !min || !max || !scale || !(*scale > 0)) return false;
  field.min = *min;
  field.max = *max;
  field.scale = *scale;
  field.order = OrderOf(json);
  if (field.signal == "sequence") field.content = link::FieldContent::kSequence;
  if (field.signal == "time_us") field.content = link::FieldContent::kTimeUs;
  if (json.TextAt("as") == "share") field.as = link::ThrustUnit::kShare;
  if (json.TextAt("as") == "share_of_speed") field.as = link::ThrustUnit::kShareOfSpeed;
  return ReadType(json.TextAt("type"), field.type);
}

bool ReadMessage(const Json& json, MessageType& type) {
  type.name = json.TextAt("name");
  type.reply = json.TextAt("reply");
  type.starts = json.IsTrueAt("starts");
  type.period_ns = json.NumberAt<TimeNs>("period_ns").value_or(0);
  type.direction = json.TextAt("line") == "reference" ? link::Direction::kReference
                   : json.TextAt("from") == "client"  ? link::Direction::kToPlant
                                                      : link::Direction::kToClient;
  static constexpr std::array kKinds = {MessageKind::kStart, MessageKind::kRequest, MessageKind::kActuators,
                                        MessageKind::kReply, MessageKind::kReference};
  FindNamed(json.TextAt("role"), kKinds, type.kind);  // any other has no meaning for a client
  if (const Json* id = json.Find("id"); id != nullptr && id->kind == Json::Kind::kObject) {
    type.id = link::MessageId{.order = OrderOf(*id), .bits = id->NumberAt<std::uint32_t>("bits").value_or(0)};
    if (!ReadType(id->TextAt("type"), type.id->type)) return false;
  }
  const Json* fields = json.Find("fields");
  if (fields == nullptr || type.name.empty()) return false;
  for (const Json& field : fields->items)
    if (!ReadField(field, type.fields.emplace_back())) return false;
  type = LayOut(std::move(type));
  return type.payload_bytes <= link::kPayloadBytesMax;
}

std::shared_ptr<const link::Protocol> ReadProtocol(const Json& json, double period_s) {
  auto protocol = std::make_shared<link::Protocol>();
  protocol->name = json.TextAt("name");
  const Json *framing = json.Find("framing"), *messages = json.Find("messages");
  if (framing == nullptr || messages == nullptr || messages->items.size() > kMessagesMax) return nullptr;
  protocol->framing = ReadFraming(*framing);
  if (protocol->framing == nullptr) return nullptr;
  protocol->control_period_ns = std::llround(period_s * 1e9);
  protocol->world = json.TextAt("world") == "ned" ? link::WorldAxes::kNed : link::WorldAxes::kEnu;
  protocol->body = json.TextAt("body") == "frd" ? link::BodyAxes::kFrd : link::BodyAxes::kFlu;
  for (const Json& message : messages->items)
    if (!ReadMessage(message, protocol->messages.emplace_back())) return nullptr;
  for (const MessageType& type : protocol->messages)
    if (!type.reply.empty() && protocol->Find(type.reply) == nullptr) return nullptr;
  if (protocol->Find(MessageKind::kActuators) == nullptr) return nullptr;
  return protocol;
}

// A number of each object of a list.
bool ReadEach(const Json& list, std::string_view key, std::span<float> into) {
  if (list.items.size() > into.size()) return false;
  for (std::size_t i = 0; i < list.items.size(); ++i) {
    const auto value = list.items[i].NumberAt<float>(key);
    if (!value) return false;
    into[i] = *value;
  }
  return true;
}

std::vector<std::string> NamesOf(const Json& list) {
  std::vector<std::string> names;
  for (const Json& item : list.items) names.emplace_back(item.TextAt("name"));
  return names;
}

bool ReadGain(const Json& rows, LqrTable& table) {
  if (rows.items.size() != table.input_count) return false;
  for (std::size_t row = 0; row < rows.items.size(); ++row) {
    const std::vector<Json>& columns = rows.items[row].items;
    if (columns.size() != table.sensed_count() + kLqrIntegralCount) return false;
    for (std::size_t column = 0; column < columns.size(); ++column) {
      const auto value = columns[column].As<float>();
      if (!value) return false;
      table.gain[row][column] = *value;
    }
  }
  return true;
}

}  // namespace

bool ReadLqrSetup(const char* parameters, LqrSetup& setup) {
  const std::optional<Json> json = parameters == nullptr ? std::nullopt : ParseJson(parameters);
  if (!json) return false;
  setup = {};
  LqrTable& table = setup.table;
  const auto period_s = json->NumberAt<double>("control_period_s");
  const Json *states = json->Find("states"), *inputs = json->Find("inputs"), *gain = json->Find("gain"),
             *protocol = json->Find("protocol");
  if (!period_s || !(*period_s > 0) || !(*period_s < 1000) || states == nullptr || inputs == nullptr ||
      gain == nullptr || protocol == nullptr)
    return false;
  const std::size_t state_count = states->items.size();
  if (state_count < 12 || state_count % 2 != 0 || inputs->items.empty() ||
      !ReadEach(*states, "hover", table.hover_state) || !ReadEach(*inputs, "hover", table.hover_input) ||
      !ReadEach(*inputs, "min", table.input_min) || !ReadEach(*inputs, "max", table.input_max))
    return false;
  table.period_s = static_cast<float>(*period_s);
  table.hinge_count = state_count / 2 - 6;
  table.input_count = inputs->items.size();
  setup.states = NamesOf(*states);
  setup.inputs = NamesOf(*inputs);
  setup.rates = json->TextAt("angular_rates") == "body"    ? RatesAxes::kBody
                : json->TextAt("angular_rates") == "euler" ? RatesAxes::kEuler
                                                           : RatesAxes::kWorld;
  setup.protocol = ReadProtocol(*protocol, *period_s);
  if (setup.protocol == nullptr) return false;
  const LqrSensors sensors(*setup.protocol, setup.states, setup.rates);
  table.rates_in_world = setup.rates == RatesAxes::kWorld && !sensors.rates_from_gyro();
  return sensors.missing().empty() && ReadGain(*gain, table);
}

}  // namespace tiltproof::firmware
