// The flight firmware on a cyclic executive: one thread that sleeps until the next tick that is due, or until
// a frame may have come, then runs to completion.
//
// TILTPROOF_FIRMWARE (a build's name), TILTPROOF_DIALECT (a Dialect) and TILTPROOF_REDUNDANT (the build talks to other
// boards) come from CMakeLists.txt.

#include <type_traits>

#include "firmware/builds.h"
#include "firmware/flight_application.h"
#include "firmware/ports/stm32f4/board.h"
#include "firmware/ports/stm32f4/fault_record.h"
#include "firmware/ports/stm32f4/other_boards.h"
#include "firmware/ports/stm32f4/run_statistics.h"
#include "firmware/ports/stm32f4/stm32f4.h"
#include "firmware/ports/stm32f4/stm32f4_port.h"
#include "firmware/ports/stm32f4/symbols.h"

using namespace tiltproof;           // NOLINT: the application itself
using namespace tiltproof::stm32f4;  // NOLINT

TiltproofClientStatus tiltproof_status;

namespace {

constexpr bool kIsRedundant = TILTPROOF_REDUNDANT;

constinit std::conditional_t<kIsRedundant, RedundantPort, Stm32f4Port> port;
volatile bool received = false;

// Until `wake` or until a flag has come. Interrupts are off between the question and the sleep, so that none is slept
// over; one that is pending ends the sleep at once, and is served in between.
void SleepUntil(TimeNs wake) {
  EndBusy();
  DisableInterrupts();
  while (!received && TickTime() < wake) {
    WaitForInterrupt();
    EnableInterrupts();
    DisableInterrupts();
  }
  received = false;
  EnableInterrupts();
  BeginBusy();
}

std::size_t OwnPlace() {
  if constexpr (kIsRedundant) return tiltproof_place;
  return 0;
}

}  // namespace

firmware::FlightApplication flight_application(*firmware::FindBuild(TILTPROOF_FIRMWARE),
                                               link::Dialect::TILTPROOF_DIALECT, port, OwnPlace());

void stm32f4::OnReceived(firmware::Uart /*uart*/) { received = true; }

extern "C" void SysTick_Handler() { CountTick(); }

int main() {
  const ResetReason reason = StartBoard();
  StartUsarts();
  if constexpr (kIsRedundant) StartCrossLines();
  StartTicks();
  AddMainStack();
  ConsoleLine line("tiltproof executive, firmware ");
  line.Text(TILTPROOF_FIRMWARE).Text(", dialect ").Text(link::Name(link::Dialect::TILTPROOF_DIALECT));
  line.Text(CrystalRuns() ? "" : ", without crystal").Send();
  ReportRestart(reason);
  StartWatchdog();

  // Power-on for the application is the first tick: from here on all it does stands on the ticks' grid.
  SleepUntil(kTickNs);
  AwaitMiddleOfTick();
  BeginBusy();  // that was no work
  TimeNs wake = flight_application.Start(TickTime());
  std::uint32_t control_count = 0;
  for (;;) {
    SleepUntil(wake);
    Drain(main_receive_ring, [](auto bytes) { flight_application.Receive(firmware::Uart::kMain, bytes); });
    Drain(reference_receive_ring,
          [](auto bytes) { flight_application.Receive(firmware::Uart::kReference, bytes); });
    if constexpr (kIsRedundant)
      ReceiveFromOtherBoards(
          [](firmware::Uart uart, auto bytes) { flight_application.Receive(uart, bytes); });
    wake = flight_application.Tick(TickTime());
    if constexpr (kIsRedundant) tiltproof_role = static_cast<std::uint32_t>(flight_application.role());

    const firmware::Status status = flight_application.status();
    tiltproof_status.supervisor_state = static_cast<std::uint32_t>(status.state);
    tiltproof_status.failsafe_count = status.failsafe_count;
    if (control_count != flight_application.control_count()) {
      control_count = flight_application.control_count();
      FeedWatchdog();
    }
    PrintRunStatistics();
  }
}
