// The one table of topics: the message (messages.h), the topic's name and its quality of service (TopicQos). Internal
// to this folder; TopicTable() prints it.
#pragma once

#include "harness/dds/messages.h"
#include "harness/dds/qos.h"

namespace tiltproof::dds {
inline constexpr TimeNs kRealTimeDeadlineNs = 24 * kNsPerMs;  // two control periods of the built-in protocols
}

// Calls X(Message, name, QoS...) for each topic.
#define TILTPROOF_DDS_TOPICS(X)                                                                              \
  X(Heartbeat, "heartbeat", .heard_depth = 64, .lease_ns = kHeartbeatLeaseNs,                                \
    .why = "written every 50 ms by the working thread, so that a killed and a hung node look alike")         \
  X(RunScenario, "run_scenario", .for_latecomers = true, .heard_depth = 8,                                   \
    .why = "a node that comes late must know what is flown")                                                 \
  X(RunCommand, "run_command", .for_latecomers = true,                                                       \
    .why = "one command at a time, acknowledged; the last one holds")                                        \
  X(RunAck, "run_ack", .for_latecomers = true, .why = "one answer per command and node; the last one holds") \
  X(RunState, "run_state", .for_latecomers = true, .why = "the present state is what counts")                \
  X(PlantState, "plant_state", .deadline_ns = kRealTimeDeadlineNs,                                           \
    .why = "the latest counts; the deadline is two control periods")                                         \
  X(Reference, "reference", .why = "the latest counts")                                                      \
  X(SerialTap, "serial_tap", .keep_all = true, .log = true,                                                  \
    .why = "a log; not kept for latecomers, because a long flight would fill the memory")                    \
  X(FaultCommand, "fault_command", .keep_all = true,                                                         \
    .why = "each one counts, and none may be obeyed again by a node that comes late")                        \
  X(FaultActivation, "fault_activation", .keep_all = true, .log = true,                                      \
    .why = "a log; not kept for latecomers, because a long flight would fill the memory")                    \
  X(RunEvent, "run_event", .for_latecomers = true, .keep_all = true, .log = true,                            \
    .why = "a log that a monitor reads from the start whenever it comes")                                    \
  X(Records, "records", .keep_all = true, .log = true,                                                       \
    .why = "a log; not kept for latecomers, because a long flight would fill the memory")                    \
  X(Score, "score", .for_latecomers = true,                                                                  \
    .why = "each instance has one message, so the last one is all of them")                                  \
  X(StepRequest, "step_request", .keep_all = true,                                                           \
    .why = "one exchange at a time; a long one takes several messages")                                      \
  X(StepResponse, "step_response", .keep_all = true,                                                         \
    .why = "one exchange at a time; upcalls of the firmware come before the answer")
