#include "harness/dds/qos.h"

#include <array>

namespace tiltproof::dds {
namespace {

constexpr TimeNs kRealTimeDeadlineNs = 2 * kControlPeriodNs;

constexpr auto kTopics = std::to_array<TopicQos>({
    {.topic = "tiltproof/heartbeat",
     .type = "Heartbeat",
     .lease_ns = kHeartbeatLeaseNs,
     .why = "written every 50 ms by the working thread, so that a killed and a hung node look alike"},
    {.topic = "tiltproof/run_scenario",
     .type = "RunScenario",
     .for_latecomers = true,
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
    {.topic = "tiltproof/actuation",
     .type = "Actuation",
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
    {.topic = "tiltproof/step_request", .type = "StepRequest", .why = "one exchange at a time"},
    {.topic = "tiltproof/step_response", .type = "StepResponse", .why = "one exchange at a time"},
});

constexpr const TopicQos& Find(std::string_view type) {
  for (const auto& topic : kTopics) {
    if (topic.type == type) return topic;
  }
  throw "no such type";  // at compile time: does not compile
}

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

#define TILTPROOF_QOS(T)                              \
  template <>                                         \
  const TopicQos& QosOf<T>() {                        \
    static constexpr const TopicQos& kQos = Find(#T); \
    return kQos;                                      \
  }
TILTPROOF_QOS(Heartbeat)
TILTPROOF_QOS(RunScenario)
TILTPROOF_QOS(RunCommand)
TILTPROOF_QOS(RunAck)
TILTPROOF_QOS(RunState)
TILTPROOF_QOS(PlantState)
TILTPROOF_QOS(Actuation)
TILTPROOF_QOS(Reference)
TILTPROOF_QOS(SerialTap)
TILTPROOF_QOS(FaultCommand)
TILTPROOF_QOS(FaultActivation)
TILTPROOF_QOS(RunEvent)
TILTPROOF_QOS(TraceRows)
TILTPROOF_QOS(NodeReport)
TILTPROOF_QOS(Score)
TILTPROOF_QOS(StepRequest)
TILTPROOF_QOS(StepResponse)
#undef TILTPROOF_QOS

std::vector<TopicRow> TopicTable() {
  std::vector<TopicRow> rows;
  for (const auto& t : kTopics) {
    rows.push_back({std::string(t.topic), std::string(t.type), InWords(t), std::string(t.why)});
  }
  return rows;
}

}  // namespace tiltproof::dds
