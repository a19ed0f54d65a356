#include "harness/dds/qos.h"

#include <array>

namespace tiltproof::dds {
namespace {

constexpr TimeNs kRealTimeDeadlineNs = 24 * kNsPerMs;  // two control periods of the built-in protocols

constexpr auto kTopics = std::to_array<TopicQos>({
    {.topic = "tiltproof/heartbeat",
     .type = "Heartbeat",
     .heard_depth = 64,
     .lease_ns = kHeartbeatLeaseNs,
     .why = "written every 50 ms by the working thread, so that a killed and a hung node look alike"},
    {.topic = "tiltproof/run_scenario",
     .type = "RunScenario",
     .for_latecomers = true,
     .heard_depth = 8,
     .why = "a node that comes late must know what is flown"},
    {.topic = "tiltproof/run_command",
     .type = "RunCommand",
     .for_latecomers = true,
     .why = "one command at a time, acknowledged; the last one holds"},
    {.topic = "tiltproof/run_ack",
     .type = "RunAck",
     .for_latecomers = true,
     .why = "one answer a command and node; the last one holds"},
    {.topic = "tiltproof/run_state",
     .type = "RunState",
     .for_latecomers = true,
     .why = "the present state is what counts"},
    {.topic = "tiltproof/plant_state",
     .type = "PlantState",
     .deadline_ns = kRealTimeDeadlineNs,
     .why = "the latest counts; the deadline is two control periods"},
    {.topic = "tiltproof/reference", .type = "Reference", .why = "the latest counts"},
    {.topic = "tiltproof/serial_tap",
     .type = "SerialTap",
     .keep_all = true,
     .log = true,
     .why = "a log; volatile, for the memory of a long flight"},
    {.topic = "tiltproof/fault_command",
     .type = "FaultCommand",
     .keep_all = true,
     .why = "each one counts, and none may be obeyed again by a node that comes late"},
    {.topic = "tiltproof/fault_activation",
     .type = "FaultActivation",
     .keep_all = true,
     .log = true,
     .why = "a log; volatile, for the memory of a long flight"},
    {.topic = "tiltproof/run_event",
     .type = "RunEvent",
     .for_latecomers = true,
     .keep_all = true,
     .log = true,
     .why = "a log that a monitor reads from the start whenever it comes"},
    {.topic = "tiltproof/trace_rows",
     .type = "TraceRows",
     .keep_all = true,
     .log = true,
     .why = "a log; volatile, for the memory of a long flight"},
    {.topic = "tiltproof/node_report",
     .type = "NodeReport",
     .for_latecomers = true,
     .why = "one message an instance, so the last one is all of them"},
    {.topic = "tiltproof/score",
     .type = "Score",
     .for_latecomers = true,
     .why = "one message an instance, so the last one is all of them"},
    {.topic = "tiltproof/step_request",
     .type = "StepRequest",
     .keep_all = true,
     .why = "one exchange at a time, in several messages when it is long"},
    {.topic = "tiltproof/step_response",
     .type = "StepResponse",
     .keep_all = true,
     .why = "one exchange at a time; upcalls of the firmware come before the answer"},
});

constexpr const TopicQos& Find(std::string_view type) {
  for (const auto& topic : kTopics) {
    if (topic.type == type) return topic;
  }
  throw "no such type";  // at compile time: does not compile
}

template <class T>
constexpr const TopicQos* kQosOf = nullptr;
template <>
constexpr const TopicQos* kQosOf<Heartbeat> = &Find("Heartbeat");
template <>
constexpr const TopicQos* kQosOf<RunScenario> = &Find("RunScenario");
template <>
constexpr const TopicQos* kQosOf<RunCommand> = &Find("RunCommand");
template <>
constexpr const TopicQos* kQosOf<RunAck> = &Find("RunAck");
template <>
constexpr const TopicQos* kQosOf<RunState> = &Find("RunState");
template <>
constexpr const TopicQos* kQosOf<PlantState> = &Find("PlantState");
template <>
constexpr const TopicQos* kQosOf<Reference> = &Find("Reference");
template <>
constexpr const TopicQos* kQosOf<SerialTap> = &Find("SerialTap");
template <>
constexpr const TopicQos* kQosOf<FaultCommand> = &Find("FaultCommand");
template <>
constexpr const TopicQos* kQosOf<FaultActivation> = &Find("FaultActivation");
template <>
constexpr const TopicQos* kQosOf<RunEvent> = &Find("RunEvent");
template <>
constexpr const TopicQos* kQosOf<TraceRows> = &Find("TraceRows");
template <>
constexpr const TopicQos* kQosOf<NodeReport> = &Find("NodeReport");
template <>
constexpr const TopicQos* kQosOf<Score> = &Find("Score");
template <>
constexpr const TopicQos* kQosOf<StepRequest> = &Find("StepRequest");
template <>
constexpr const TopicQos* kQosOf<StepResponse> = &Find("StepResponse");

std::string InWords(const TopicQos& t) {
  std::string text = "RELIABLE";
  text += t.for_latecomers ? ", TRANSIENT_LOCAL" : ", VOLATILE";
  text += t.keep_all ? ", KEEP_ALL" : ", KEEP_LAST 1";
  if (t.deadline_ns != 0) text += ", DEADLINE " + std::to_string(t.deadline_ns / kNsPerMs) + " ms";
  if (t.lease_ns != 0) text += ", MANUAL_BY_TOPIC lease " + std::to_string(t.lease_ns / kNsPerMs) + " ms";
  if (t.log) text += "; each sequence once, gaps found";
  return text;
}

}  // namespace

template <class T>
const TopicQos& QosOf() {
  static_assert(kQosOf<T> != nullptr);
  return *kQosOf<T>;
}
template const TopicQos& QosOf<Heartbeat>();
template const TopicQos& QosOf<RunScenario>();
template const TopicQos& QosOf<RunCommand>();
template const TopicQos& QosOf<RunAck>();
template const TopicQos& QosOf<RunState>();
template const TopicQos& QosOf<PlantState>();
template const TopicQos& QosOf<Reference>();
template const TopicQos& QosOf<SerialTap>();
template const TopicQos& QosOf<FaultCommand>();
template const TopicQos& QosOf<FaultActivation>();
template const TopicQos& QosOf<RunEvent>();
template const TopicQos& QosOf<TraceRows>();
template const TopicQos& QosOf<NodeReport>();
template const TopicQos& QosOf<Score>();
template const TopicQos& QosOf<StepRequest>();
template const TopicQos& QosOf<StepResponse>();

std::vector<TopicRow> TopicTable() {
  std::vector<TopicRow> rows;
  for (const auto& t : kTopics) {
    rows.push_back({std::string(t.topic), std::string(t.type), InWords(t), std::string(t.why)});
  }
  return rows;
}

}  // namespace tiltproof::dds
