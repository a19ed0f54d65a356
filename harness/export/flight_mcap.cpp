#include "harness/export/flight_mcap.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "harness/dds/cdr.h"
#include "harness/export/flight_scene.h"
#include "harness/export/foxglove_schemas.h"
#include "harness/export/mcap_writer.h"
#include "harness/export/signal_topics.h"
#include "harness/report/json_fields.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// Messages of the bus as JSON: bytes are hexadecimal text, everything else is as in files.
template <class T>
Json MessageJson(const T& value) {
  if constexpr (HasFields<T>) {
    Json json = Json::object();
    T::Fields([&](const char* name, const auto& field) { json[name] = MessageJson(field); }, value);
    return json;
  } else if constexpr (std::is_base_of_v<std::vector<std::uint8_t>, T>) {
    return fmt::format("{:02x}", fmt::join(value, ""));
  } else if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
    return value;
  } else {
    Json json = Json::array();
    for (const auto& element : value) json.push_back(MessageJson(element));
    return json;
  }
}

// The schema of that.
template <class T>
Json MessageSchema(const T& empty) {
  if constexpr (HasFields<T>) {
    Json schema = {{"type", "object"}};
    T::Fields([&](const char* name, const auto& field) { schema["properties"][name] = MessageSchema(field); },
              empty);
    return schema;
  } else if constexpr (std::is_same_v<T, bool>) {
    return {{"type", "boolean"}};
  } else if constexpr (std::is_integral_v<T>) {
    return {{"type", "integer"}};
  } else if constexpr (std::is_floating_point_v<T>) {
    return {{"type", "number"}};
  } else if constexpr (std::is_same_v<T, std::string> || std::is_base_of_v<std::vector<std::uint8_t>, T>) {
    return {{"type", "string"}};
  } else {
    return {{"type", "array"}, {"items", MessageSchema(typename T::value_type{})}};
  }
}

std::string TopicName(std::string_view name) { return fmt::format("/tiltproof/{}", name); }

class Export {
 public:
  Export(const RecordedFlight& flight, const std::optional<VehicleShape>& vehicle, McapTypes types,
         const std::function<void(std::string_view)>& sink)
      : flight_(flight), types_(types), mcap_(sink), scene_(flight.trace, vehicle) {}

  void Write() {
    Gather();
    DeclareScene();
    DeclareSignals();
    std::stable_sort(messages_.begin(), messages_.end(),
                     [](const Message& a, const Message& b) { return a.time_ns < b.time_ns; });
    auto message = messages_.cbegin();
    auto frame = frames_.cbegin();
    const auto write_until = [&](TimeNs time_ns) {
      for (;;) {
        const bool frame_next =
            frame != frames_.cend() && (message == messages_.cend() || frame->begin_ns <= message->time_ns);
        if (frame_next ? frame->begin_ns > time_ns
                       : message == messages_.cend() || message->time_ns > time_ns)
          return;
        if (frame_next) {
          WriteFrame(*frame++);
        } else {
          mcap_.Write(message->topic, message->time_ns, message->bytes);
          ++message;
        }
      }
    };
    for (std::size_t r = 0; r < flight_.times_ns.size(); ++r) {
      write_until(flight_.times_ns[r] - 1);
      WriteRow(r);
    }
    write_until(kNever);
    mcap_.Finish();
  }

 private:
  struct Message {
    TimeNs time_ns;
    McapWriter::Topic topic;
    std::string bytes;
  };

  template <class T>
  McapWriter::Topic Declare(std::string_view name, const std::string& type, const T& empty,
                            std::map<std::string, std::string> metadata = {}) {
    if (types_ == McapTypes::kIdl)
      return mcap_.AddTopic({.topic = TopicName(name),
                             .schema = "tiltproof::" + type,
                             .schema_encoding = "omgidl",
                             .schema_data = std::string(dds::IdlText()),
                             .message_encoding = "cdr",
                             .metadata = std::move(metadata)});
    Json schema = {{"title", "tiltproof." + type}};
    schema.update(MessageSchema(empty));
    return mcap_.AddTopic({.topic = TopicName(name),
                           .schema = "tiltproof." + type,
                           .schema_encoding = "jsonschema",
                           .schema_data = JsonText(schema),
                           .message_encoding = "json",
                           .metadata = std::move(metadata)});
  }

  template <class T>
  std::string Encoded(const T& message) const {
    return types_ == McapTypes::kIdl ? dds::ToCdr(message) : JsonText(MessageJson(message));
  }
  template <class T>
  void Add(McapWriter::Topic topic, TimeNs time_ns, const T& message) {
    messages_.push_back({time_ns, topic, Encoded(message)});
  }

  std::string ClientId(std::optional<std::size_t> client) const {
    const std::size_t count = flight_.client_ids.size();
    if (!client) return "";
    // Lines between boards follow the clients (WireId).
    return *client < count ? flight_.client_ids[*client] : fmt::format("lines[{}]", *client - count);
  }

  // Everything but the rows of the trace.
  void Gather() {
    Add(Declare("run_scenario", "RunScenario", dds::RunScenario()), 0,
        dds::RunScenario{.run_id = flight_.run_id, .scenario_yaml = flight_.scenario_yaml});
    const auto activations = Declare("fault_activation", "FaultActivation", dds::FaultActivation());
    for (const RecordedActivation& recorded : flight_.activations)
      Add(activations, recorded.activation.time_ns, recorded.activation);
    const auto events = Declare("run_event", "RunEvent", dds::RunEvent());
    for (std::size_t i = 0; i < flight_.events.size(); ++i) {
      const RunEvent& event = flight_.events[i];
      Add(events, event.time_ns,
          dds::RunEvent{.run_id = flight_.run_id,
                        .node_id = ClientId(event.client),
                        .sequence = static_cast<std::int64_t>(i + 1),
                        .time_ns = event.time_ns,
                        .kind = event.kind,
                        .text = event.text});
    }
    GatherFrames();
    const Score& score = flight_.result.score;
    Add(Declare("score", "Score", dds::Score()), flight_.end_ns,
        dds::Score{.run_id = flight_.run_id,
                   .scenario = flight_.result.name,
                   .verdict = std::string(Name(score.verdict)),
                   .reason = score.reason,
                   .metrics_json = JsonText(ToJson(score.metrics))});
  }

  // A long flight has millions: each becomes a message only when its turn comes.
  void GatherFrames() {
    frames_topic_ = Declare("serial_tap", "SerialTap", dds::SerialTap());
    std::size_t offset = 0;
    while (const auto record = flight_.link.Next(offset)) frames_.push_back(*record);
    std::stable_sort(frames_.begin(), frames_.end(),
                     [](const LinkRecord& a, const LinkRecord& b) { return a.begin_ns < b.begin_ns; });
  }

  void WriteFrame(const LinkRecord& record) {
    dds::SerialTap tap{
        .run_id = flight_.run_id, .node_id = ClientId(record.wire.client), .sequence = ++frames_count_};
    tap.frames.push_back({.begin_ns = record.begin_ns,
                          .direction = static_cast<std::uint8_t>(record.wire.direction),
                          .delivered = record.delivered,
                          .bytes = std::vector(record.bytes.begin(), record.bytes.end())});
    mcap_.Write(frames_topic_, record.begin_ns, Encoded(tap));
  }

  McapWriter::Topic DeclareFoxglove(std::string_view name, const char* type, const Json& schema) {
    return mcap_.AddTopic({.topic = TopicName(name),
                           .schema = type,
                           .schema_encoding = "jsonschema",
                           .schema_data = JsonText(schema),
                           .message_encoding = "json"});
  }

  void DeclareScene() {
    transforms_topic_ = DeclareFoxglove("frame_transform", kFrameTransform, FrameTransformSchema());
    messages_.push_back(
        {0, DeclareFoxglove("scene_update", kSceneUpdate, SceneUpdateSchema()), scene_.Update()});
  }

  struct Signals {
    SignalTopic columns;
    McapWriter::Topic topic;
  };

  // In real time, state and reference have the types of the bus, whose numbers are named by the topic's metadata.
  bool HasBusType(const SignalTopic& topic) const {
    return types_ == McapTypes::kIdl && (topic.type == "PlantState" || topic.type == "Reference");
  }

  void DeclareSignals() {
    const VehicleColumns vehicle = FindVehicleColumns(flight_.trace);
    states_count_ = vehicle.states.size();
    for (const SignalTopic& topic : SignalTopicsOf(flight_.trace)) {
      const std::map<std::string, std::string> metadata = {{"columns", topic.ColumnNames()}};
      if (HasBusType(topic)) {
        signals_.push_back({topic, Declare(topic.name, topic.type, 0, metadata)});
        continue;
      }
      const bool idl = types_ == McapTypes::kIdl;
      signals_.push_back({topic, mcap_.AddTopic({.topic = TopicName(topic.name),
                                                 .schema = (idl ? "tiltproof::" : "tiltproof.") + topic.type,
                                                 .schema_encoding = idl ? "omgidl" : "jsonschema",
                                                 .schema_data = idl ? IdlOf(topic) : JsonSchemaOf(topic),
                                                 .message_encoding = idl ? "cdr" : "json",
                                                 .metadata = metadata})});
    }
  }

  void WriteRow(std::size_t r) {
    CheckIndex(r, flight_.trace.row_count(), "each time is that of a row");
    const TimeNs time_ns = flight_.times_ns[r];
    const auto row = flight_.trace.row(r);
    for (const std::string& transform : scene_.Transforms(time_ns, row))
      mcap_.Write(transforms_topic_, time_ns, transform);
    for (const Signals& signals : signals_) {
      if (!HasBusType(signals.columns)) {
        mcap_.Write(signals.topic, time_ns,
                    types_ == McapTypes::kIdl ? ToCdrMessage(signals.columns, time_ns, row)
                                              : ToJsonMessage(signals.columns, time_ns, row));
        continue;
      }
      std::vector<double> values;
      for (const auto& column : signals.columns.columns) values.push_back(row[column.place]);
      const auto sequence = static_cast<std::int64_t>(r + 1);
      if (signals.columns.type == "Reference") {
        mcap_.Write(
            signals.topic, time_ns,
            dds::ToCdr(dds::Reference{
                .run_id = flight_.run_id, .sequence = sequence, .time_ns = time_ns, .values = values}));
        continue;
      }
      Check(states_count_ <= values.size(), "a plant's row begins with its states");
      const auto inputs = values.begin() + static_cast<std::ptrdiff_t>(states_count_);
      mcap_.Write(signals.topic, time_ns,
                  dds::ToCdr(dds::PlantState{.run_id = flight_.run_id,
                                             .sequence = sequence,
                                             .time_ns = time_ns,
                                             .state = std::vector(values.begin(), inputs),
                                             .in_force = std::vector(inputs, values.end())}));
    }
  }

  const RecordedFlight& flight_;
  McapTypes types_;
  McapWriter mcap_;
  FlightScene scene_;
  McapWriter::Topic transforms_topic_ = 0;
  std::vector<Message> messages_;
  std::vector<LinkRecord> frames_;
  McapWriter::Topic frames_topic_ = 0;
  std::int64_t frames_count_ = 0;
  std::vector<Signals> signals_;
  std::size_t states_count_ = 0;
};

}  // namespace

void WriteMcap(const RecordedFlight& flight, const std::optional<VehicleShape>& vehicle, McapTypes types,
               const std::function<void(std::string_view)>& sink) {
  Export(flight, vehicle, types, sink).Write();
}

}  // namespace tiltproof::harness
