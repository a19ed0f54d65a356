#include "harness/report/flight_pack.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <span>
#include <string_view>

#include "harness/report/decimation.h"
#include "harness/report/json_fields.h"
#include "link/check.h"
#include "link/framing.h"
#include "link/protocol.h"
#include "link/raw_framing.h"

namespace tiltproof::harness {
namespace {

void AppendU32(std::string& bytes, std::size_t value) {
  Check(value <= std::numeric_limits<std::uint32_t>::max(), "a size or a distance in the page has 32 bits");
  for (unsigned shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(value >> shift & 0xFF);
}

// JSON and the numbers behind it.
struct Part {
  Json json = Json::object();
  std::string numbers;

  std::string Bytes() const {
    const std::string text = JsonText(json);
    std::string bytes;
    AppendU32(bytes, text.size());
    return bytes + text + numbers;
  }
};

void AppendDeflated(std::string& bytes, const Part& part) {
  const std::string deflated = Deflate(part.Bytes());
  AppendU32(bytes, deflated.size());
  bytes += deflated;
}

bool IsShown(const std::string& column) { return column != "t_s" && !column.starts_with(stl::kActivePrefix); }

void AddSeries(Part& part, const std::string& name, std::span<const double> values, std::size_t points_max) {
  const PackedSeries packed = PackSeries(values, DecimatedRows(values, points_max));
  part.json["series"].push_back({{"name", name},
                                 {"unit", SignalNamed(name, SignalFrame::kNone).unit},
                                 {"count", packed.count},
                                 {"low", packed.low},
                                 {"high", packed.high},
                                 {"at", part.numbers.size()},
                                 {"size", packed.bytes.size()}});
  part.numbers += packed.bytes;
}

// The time of each row as its distance from the row before, in nanoseconds.
void AddTimes(Part& part, const std::vector<TimeNs>& times_ns) {
  part.json["times"] = {{"count", times_ns.size()},
                        {"first_ns", times_ns.empty() ? 0 : times_ns.front()},
                        {"at", part.numbers.size()}};
  for (std::size_t r = 0; r < times_ns.size(); ++r)
    AppendU32(part.numbers, r == 0 ? 0 : static_cast<std::size_t>(times_ns[r] - times_ns[r - 1]));
}

Json ScenarioJson(const Scenario& scenario) {
  Json json = {{"name", scenario.name},
               {"description", scenario.description},
               {"tags", scenario.tags},
               {"model", scenario.model},
               {"firmware", scenario.firmware},
               {"duration_s", ToSeconds(scenario.duration_ns)},
               {"protocol", scenario.link.protocol->name}};
  if (scenario.link.ideal)
    json["ideal_link"] = true;
  else
    json["baud"] = scenario.link.baud;
  for (std::size_t i = 0; i < scenario.client_count(); ++i) json["clients"].push_back(scenario.client_id(i));
  json["faults"] = Json::array();
  for (const auto& fault : scenario.faults)
    json["faults"].push_back({{"id", fault.id}, {"type", fault.type}, {"target", TargetText(fault)}});
  json["criteria"] = Json::array();
  for (const CriterionSpec& criterion : scenario.criteria) {
    Json entry = {{"name", criterion.name}, {"stl", criterion.stl}, {"metric", criterion.metric}};
    JsonWriter::Put(entry["min"], criterion.min);
    JsonWriter::Put(entry["max"], criterion.max);
    json["criteria"].push_back(std::move(entry));
  }
  return json;
}

// Empty for a thrust in newton.
std::string_view TextOf(link::ThrustUnit unit) {
  switch (unit) {
    case link::ThrustUnit::kNewton:
      return "";
    case link::ThrustUnit::kShare:
      return "share";
    case link::ThrustUnit::kShareOfSpeed:
      return "share of speed";
  }
  return "";
}

Json MessagesJson(const link::Protocol& protocol) {
  Json messages = Json::array();
  for (const link::MessageType& type : protocol.messages) {
    Json fields = Json::array();
    for (const link::MessageField& field : type.fields)
      fields.push_back({{"signal", field.signal},
                        {"type", Name(field.type)},
                        {"order", Name(field.order)},
                        {"scale", field.scale},
                        {"as", TextOf(field.as)},
                        {"offset", field.offset}});
    messages.push_back({{"name", type.name}, {"bytes", type.payload_bytes}, {"fields", fields}});
  }
  return messages;
}

Json FramingJson(const link::Framing& framing) {
  Json roles = Json::array();
  for (int i = 0; i <= static_cast<int>(LastOf(link::ByteRole())); ++i)
    roles.push_back(Name(static_cast<link::ByteRole>(i)));
  return {{"name", framing.name()},
          {"check", framing.check() ? std::string(Name(*framing.check())) : ""},
          {"roles", roles}};
}

// A digit for each byte of a frame: the place of its role in FramingJson().
std::string RolesText(const link::Framing& framing, std::span<const std::uint8_t> frame) {
  std::string text;
  for (const link::ByteRole role : framing.Roles(frame))
    text += static_cast<char>('0' + static_cast<int>(role));
  return text;
}

std::string Hex(std::span<const std::uint8_t> bytes) { return fmt::format("{:02x}", fmt::join(bytes, "")); }

// Adds the reading of a receiver that starts here: a message and its payload, or the reason for none.
void PutMeaning(Json& json, const link::Protocol& protocol, link::Direction direction,
                std::span<const std::uint8_t> bytes) {
  const std::unique_ptr<link::FrameReader> reader = protocol.framing->MakeReader();
  auto read = reader->Next(bytes);
  if (!read) read = reader->Finish();
  if (!read) return;
  json["status"] = read->status;
  if (!read->ok) return;
  const link::MessageType* type = protocol.Classify(direction, read->payload);
  if (type == nullptr) return;
  json["message"] = type->name;
  json["payload"] = Hex(read->payload);
}

// The line between boards of a wire; null: it is of a client's own line.
const LineEntry* LineOf(const Scenario& scenario, const WireId& wire) {
  const std::size_t line = wire.client - scenario.client_count();
  return wire.client < scenario.client_count() || line >= scenario.lines.size() ? nullptr
                                                                                : &scenario.lines[line];
}

// "to_plant"; of a line between boards "to_a", for the client at its end.
std::string DirectionText(const WireId& wire, const LineEntry* line) {
  if (line == nullptr) return std::string(Name(wire.direction));
  return "to_" + line->between.at(wire.direction == link::Direction::kToClient ? 0 : 1);
}

Json FrameJson(const FlightView& view, const LineFrame& frame) {
  const LineEntry* line = LineOf(view.scenario, frame.wire);
  const link::Protocol& protocol = line == nullptr             ? *view.scenario.link.protocol
                                   : line->protocol == nullptr ? *link::RawProtocol()
                                                               : *line->protocol;
  Json json = {{"time_ns", frame.begin_ns}, {"direction", DirectionText(frame.wire, line)}};
  if (view.scenario.has_several_clients() && frame.wire.client < view.scenario.client_count())
    json["client"] = view.scenario.client_id(frame.wire.client);
  if (line != nullptr) json["client"] = line->id;
  json["fate"] = Name(frame.fate);
  if (!frame.sent.empty()) {
    json["sent"] = Hex(frame.sent);
    json["roles"] = RolesText(*protocol.framing, frame.sent);
    PutMeaning(json, protocol, frame.wire.direction, frame.sent);
  }
  if (frame.delivered.empty()) return json;
  std::vector<std::uint8_t> whole;
  for (const LinkRecord& record : frame.delivered)
    std::copy(record.bytes.begin(), record.bytes.end(), std::back_inserter(whole));
  Json& delivered =
      json["delivered"] = {{"time_ns", frame.delivered.front().begin_ns}, {"bytes", Hex(whole)}};
  PutMeaning(delivered, protocol, frame.wire.direction, whole);
  return json;
}

// All rows in [begin, end), column by column; of each number first all lowest bytes, and so on, because those of
// neighbours resemble each other.
void AddRows(Part& part, const FlightView& view, TimeNs begin_ns, TimeNs end_ns) {
  const auto first = std::lower_bound(view.times_ns.begin(), view.times_ns.end(), begin_ns);
  const auto last = std::lower_bound(first, view.times_ns.end(), end_ns);
  const auto from = static_cast<std::size_t>(first - view.times_ns.begin());
  const auto count = static_cast<std::size_t>(last - first);
  part.json["first_row"] = from;
  part.json["row_count"] = count;
  for (std::size_t c = 0; c < view.trace.columns().size(); ++c) {
    if (!IsShown(view.trace.columns()[c])) continue;
    const std::size_t at = part.numbers.size();
    part.numbers.resize(at + 8 * count);
    for (std::size_t r = 0; r < count; ++r) {
      const double value = view.trace.at(from + r, c);
      std::uint64_t bits;
      std::memcpy(&bits, &value, sizeof bits);
      for (std::size_t byte = 0; byte < 8; ++byte)
        part.numbers[at + byte * count + r] = static_cast<char>(bits >> (8 * byte) & 0xFF);
    }
  }
}

std::string CloseUp(const FlightView& view, TimeNs begin_ns) {
  const TimeNs end_ns = begin_ns + kCloseUp_ns;
  Part part;
  AddRows(part, view, begin_ns, end_ns);
  Json& frames = part.json["frames"] = Json::array();
  const auto before = [](const LineFrame& frame, TimeNs time_ns) { return frame.begin_ns < time_ns; };
  for (auto frame = std::lower_bound(view.frames.begin(), view.frames.end(), begin_ns, before);
       frame != view.frames.end() && frame->begin_ns < end_ns; ++frame)
    frames.push_back(FrameJson(view, *frame));
  return Deflate(part.Bytes());
}

// The begins of the quarters of a second to be shown, the most important first.
std::vector<TimeNs> CloseUpsOf(const FlightView& view, std::size_t count_max) {
  std::vector<TimeNs> begins;
  std::set<TimeNs> known;
  const std::vector<double> moments = MomentsOf(view);
  const TimeNs end_ns = view.times_ns.empty() ? 0 : view.times_ns.back();
  for (const TimeNs reach_ns : {TimeNs{0}, kCloseUp_ns, kNsPerS, kReach_ns}) {
    for (const double moment_s : moments) {
      if (begins.size() >= count_max) return begins;
      const TimeNs at_ns = FromSeconds(moment_s) / kCloseUp_ns;
      const TimeNs reach = reach_ns / kCloseUp_ns;
      for (TimeNs i = std::max<TimeNs>(at_ns - reach, 0); i <= at_ns + reach; ++i)
        if (i * kCloseUp_ns <= end_ns && known.insert(i).second) begins.push_back(i * kCloseUp_ns);
    }
  }
  return begins;
}

// The close-ups one after another; their places go to `json`.
std::string CloseUps(const FlightView& view, std::size_t bytes_max, Json& json) {
  // One takes at least this many bytes, so no more are looked for.
  constexpr std::size_t kBytesMin = 100;
  json = Json::array();
  std::string all;
  for (const TimeNs begin_ns : CloseUpsOf(view, bytes_max / kBytesMin)) {
    const std::string bytes = CloseUp(view, begin_ns);
    if (all.size() + bytes.size() > bytes_max) break;
    json.push_back({{"begin_s", ToSeconds(begin_ns)},
                    {"end_s", ToSeconds(begin_ns + kCloseUp_ns)},
                    {"at", all.size()},
                    {"size", bytes.size()}});
    all += bytes;
  }
  return all;
}

void PutLineErrors(Json& json, const FlightView& view) {
  std::int64_t count = 0;
  Json& errors = json["line_errors"] = Json::array();
  for (const LineFrame& frame : view.frames) {
    if (frame.fate == FrameFate::kIntact) continue;
    const LineEntry* line = LineOf(view.scenario, frame.wire);
    if (++count <= static_cast<std::int64_t>(kLineErrorsMax))
      errors.push_back({ToSeconds(frame.begin_ns), frame.wire.client,
                        (line == nullptr ? "" : line->id + "_") + DirectionText(frame.wire, line),
                        Name(frame.fate)});
  }
  json["line_error_count"] = count;
}

}  // namespace

std::string Deflate(std::string_view bytes) {
  uLongf size = compressBound(bytes.size());
  std::string compressed(size, '\0');
  Check(compress2(reinterpret_cast<Bytef*>(compressed.data()), &size,
                  reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), Z_DEFAULT_COMPRESSION) == Z_OK,
        "zlib compresses into a buffer of its own bound");
  compressed.resize(size);
  return compressed;
}

Json HeadJson(const FlightView& view) {
  Json json;
  json["scenario"] = ScenarioJson(view.scenario);
  JsonWriter::Put(json["vehicle"], view.vehicle);
  JsonWriter::Put(json["bounds"], view.bounds);
  json["columns"] = Json::array();
  json["states"] = Json::array();
  json["inputs"] = Json::array();
  if (view.trace.columns().empty()) return json;
  for (const std::string& column : view.trace.columns())
    if (IsShown(column)) json["columns"].push_back(column);
  const VehicleColumns columns = FindVehicleColumns(view.trace);
  for (const std::size_t c : columns.states) json["states"].push_back(view.trace.columns()[c]);
  for (const std::size_t c : columns.inputs) json["inputs"].push_back(view.trace.columns()[c]);
  return json;
}

std::string PackFlight(const FlightView& view, const PackLimits& limits) {
  Part part;
  Json& json = part.json = HeadJson(view);
  JsonWriter::PutFields(json["result"], view.result);
  JsonWriter::PutFields(json["result"], view.result.score);
  json["result"]["green"] = view.result.green();
  JsonWriter::Put(json["events"], view.events);
  json["firmware_log"] = view.firmware_log;
  json["resolved"] = view.resolved;
  json["folder"] = view.folder.string();
  JsonWriter::Put(json["problems"], view.problems);
  JsonWriter::Put(json["bands"], view.bands);
  JsonWriter::Put(json["robustness"], view.robustness);
  if (view.why) {
    JsonWriter::Put(json["why"], *view.why);
    json["why"].erase("curve");
  }
  json["messages"] = MessagesJson(*view.scenario.link.protocol);
  json["framing"] = FramingJson(*view.scenario.link.protocol->framing);
  Json& ticks = json["ticks"] = Json::array();
  for (const FaultTick& tick : view.ticks) ticks.push_back({tick.fault, tick.time_s, tick.what});
  PutLineErrors(json, view);
  AddTimes(part, view.times_ns);
  json["series"] = Json::array();
  if (view.trace.row_count() > 0) {
    std::vector<double> values(view.trace.row_count());
    for (std::size_t c = 0; c < view.trace.columns().size(); ++c) {
      if (!IsShown(view.trace.columns()[c])) continue;
      for (std::size_t r = 0; r < values.size(); ++r) values[r] = view.trace.at(r, c);
      AddSeries(part, view.trace.columns()[c], values, limits.points_max);
    }
  }
  for (const auto& series : view.computed) AddSeries(part, series.name, series.values, limits.points_max);
  std::string bytes;
  AppendDeflated(bytes, part);
  const std::size_t rest = limits.bytes_aim - std::min(limits.bytes_aim, bytes.size());
  Part places;
  const std::string close_ups = CloseUps(
      view, std::min(std::max(rest, kCloseUpBytesMin), limits.close_up_bytes_max), places.json["close_ups"]);
  AppendDeflated(bytes, places);
  return bytes + close_ups;
}

}  // namespace tiltproof::harness
