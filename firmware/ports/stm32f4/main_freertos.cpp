// The flight firmware as the paper's four tasks on FreeRTOS (paper, section 2.3, Figure 8), joined by queues:
//
//   get_sensors --ControlItem--> control --Actuators--> send_actuators
//   get_references --Reference--> control
//
// Priorities rise along the arrows, so that whatever a task hands on has been dealt with, down to the wire, before it
// goes on: the order of things is that of FlightApplication, which the cyclic executive runs. get_sensors wakes at the
// tick that SensorCycle asked for (every 12 ms, or a time-out) and at frames; see README.md for stacks and priorities.
//
// TILTPROOF_FIRMWARE (a build's name) and TILTPROOF_DIALECT (a Dialect) come from CMakeLists.txt.

#include <FreeRTOS.h>
#include <queue.h>
#include <task.h>

#include <array>
#include <span>

#include "firmware/actuator_writer.h"
#include "firmware/builds.h"
#include "firmware/control_activity.h"
#include "firmware/ports/stm32f4/board.h"
#include "firmware/ports/stm32f4/fault_record.h"
#include "firmware/ports/stm32f4/run_statistics.h"
#include "firmware/ports/stm32f4/stm32f4.h"
#include "firmware/ports/stm32f4/stm32f4_port.h"
#include "firmware/ports/stm32f4/symbols.h"
#include "firmware/reference_receiver.h"
#include "firmware/sensor_cycle.h"

using namespace tiltproof;           // NOLINT: the application itself
using namespace tiltproof::stm32f4;  // NOLINT

TiltproofClientStatus tiltproof_status;

// In words; README.md says how much of them is used.
std::array<StackType_t, 384> get_sensors_stack;
std::array<StackType_t, 256> get_references_stack;
std::array<StackType_t, 768> control_stack;
std::array<StackType_t, 256> send_actuators_stack;
std::array<StackType_t, configMINIMAL_STACK_SIZE> idle_stack;

namespace {

constinit Stm32f4Port port;
const firmware::Build& build = *firmware::FindBuild(TILTPROOF_FIRMWARE);
constexpr link::Dialect kDialect = link::Dialect::TILTPROOF_DIALECT;

}  // namespace

firmware::SensorCycle sensor_cycle(build, kDialect, port);
firmware::ReferenceReceiver reference_receiver(kDialect, build.checks);
firmware::ControlActivity control_activity(build);
firmware::ActuatorWriter actuator_writer(kDialect, port);

namespace {

// A queue of `length` items, without heap.
template <class Item, std::size_t length>
class Queue {
 public:
  Queue() : handle_(xQueueCreateStatic(length, sizeof(Item), storage_.data(), &control_block_)) {}

  // The receiver has the higher priority, and so has emptied the queue before the sender comes back.
  void Send(const Item& item) {
    const BaseType_t sent = xQueueSend(handle_, &item, 0);
    configASSERT(sent == pdTRUE);
  }
  // A queue of one: the newest item, whether the one before it has been received or not.
  void Overwrite(const Item& item) { xQueueOverwrite(handle_, &item); }

  bool Receive(Item& item, TickType_t ticks) { return xQueueReceive(handle_, &item, ticks) == pdTRUE; }

 private:
  alignas(Item) std::array<std::uint8_t, length * sizeof(Item)> storage_;
  StaticQueue_t control_block_;
  QueueHandle_t handle_;
};

Queue<firmware::ControlItem, 2> control_queue;
Queue<Actuators, 2> actuator_queue;
Queue<Reference, 1> reference_queue;

TaskHandle_t get_sensors_task;
TaskHandle_t get_references_task;
TimeNs alarm_ns = kTickNs;  // get_sensors is woken at the first tick at or after it

void SleepUntil(TimeNs wake) {
  {
    const InterruptLock lock;
    alarm_ns = wake;
  }
  // A tick that came in between has seen the alarm before.
  if (TickTime() < wake) ulTaskNotifyTake(pdTRUE, portMAX_DELAY);
}

void GetSensors(void*) {
  // Power-on for the application is the first tick: from here on all it does stands on the ticks' grid.
  while (TickTime() < kTickNs) SleepUntil(kTickNs);
  AwaitMiddleOfTick();
  BeginBusy();  // that was no work
  sensor_cycle.Start(TickTime());
  for (;;) {
    while (const auto item = sensor_cycle.Next(TickTime())) control_queue.Send(*item);
    const firmware::Status status = control_activity.status();
    tiltproof_status.supervisor_state = static_cast<std::uint32_t>(status.state);
    tiltproof_status.failsafe_count = status.failsafe_count;
    SleepUntil(sensor_cycle.wake_ns());
    Drain(main_receive_ring, [](auto bytes) { sensor_cycle.Receive(bytes); });
  }
}

void GetReferences(void*) {
  for (;;) {
    ulTaskNotifyTake(pdTRUE, portMAX_DELAY);
    Drain(reference_receive_ring, [](auto bytes) { reference_receiver.Receive(bytes); });
    if (const auto reference = reference_receiver.TakeReference()) reference_queue.Overwrite(*reference);
  }
}

void Control(void*) {
  firmware::ControlItem item;
  Reference reference;
  for (;;) {
    if (!control_queue.Receive(item, portMAX_DELAY)) continue;
    if (reference_queue.Receive(reference, 0)) control_activity.Follow(reference);
    if (const auto command = control_activity.Do(item)) actuator_queue.Send(*command);
    FeedWatchdog();
  }
}

void SendActuators(void*) {
  Actuators command;
  for (;;) {
    if (actuator_queue.Receive(command, portMAX_DELAY)) actuator_writer.Send(TickTime(), command);
  }
}

std::array<StaticTask_t, 4> control_blocks;

// Its name is that of its stack. Each task has a priority of its own, from 1.
TaskHandle_t CreateTask(TaskFunction_t run, const char* name, UBaseType_t priority,
                        std::span<StackType_t> stack) {
  AddStack(name, stack);
  return xTaskCreateStatic(run, name, stack.size(), nullptr, priority, stack.data(),
                           &control_blocks[priority - 1]);
}

}  // namespace

void stm32f4::OnReceived(firmware::Uart uart) {
  const TaskHandle_t task = uart == firmware::Uart::kMain ? get_sensors_task : get_references_task;
  if (task == nullptr) return;  // before there are tasks
  NoteWork();
  BaseType_t must_switch = pdFALSE;
  vTaskNotifyGiveFromISR(task, &must_switch);
  portYIELD_FROM_ISR(must_switch);
}

extern "C" {

void xPortSysTickHandler(void);

void SysTick_Handler() {
  CountTick();
  if (TickTime() >= alarm_ns) {
    NoteWork();
    BaseType_t must_switch = pdFALSE;
    vTaskNotifyGiveFromISR(get_sensors_task, &must_switch);
    portYIELD_FROM_ISR(must_switch);
  }
  xPortSysTickHandler();
}

void vApplicationIdleHook() {
  PrintRunStatistics();
  // An interrupt that is pending ends the sleep at once, and is served, with all that it sets going, when interrupts
  // are back on.
  DisableInterrupts();
  EndBusy();
  WaitForInterrupt();
  EnableInterrupts();
}

void vApplicationGetIdleTaskMemory(StaticTask_t** control_block, StackType_t** stack,
                                   configSTACK_DEPTH_TYPE* words) {
  static StaticTask_t idle_control_block;
  *control_block = &idle_control_block;
  *stack = idle_stack.data();
  *words = idle_stack.size();
}

void vApplicationStackOverflowHook(TaskHandle_t /*task*/, char* /*name*/) {
  Fail(TILTPROOF_CAUSE_STACK_OVERFLOW);
}

void FailAssertion() { Fail(TILTPROOF_CAUSE_ASSERT); }

}  // extern "C"

int main() {
  const ResetReason reason = StartBoard();
  StartUsarts();
  AddMainStack();
  ConsoleLine line("tiltproof FreeRTOS " tskKERNEL_VERSION_NUMBER ", firmware ");
  line.Text(TILTPROOF_FIRMWARE).Text(", dialect ").Text(link::Name(kDialect));
  line.Text(CrystalRuns() ? "" : ", without crystal").Send();
  ReportRestart(reason);

  get_sensors_task = CreateTask(GetSensors, "get_sensors", 1, get_sensors_stack);
  get_references_task = CreateTask(GetReferences, "get_references", 2, get_references_stack);
  CreateTask(Control, "control", 3, control_stack);
  CreateTask(SendActuators, "send_actuators", 4, send_actuators_stack);
  AddStack("idle", idle_stack);
  StartWatchdog();
  vTaskStartScheduler();  // starts the ticks too, and does not come back
  Fail(TILTPROOF_CAUSE_ASSERT);
}
