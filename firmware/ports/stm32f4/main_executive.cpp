// The flight firmware on a cyclic executive: one thread that sleeps until the next tick that is due, or until
// a frame may have come, then runs to completion.
//
// TILTPROOF_FIRMWARE (a build's name) and TILTPROOF_DIALECT (a Dialect) come from CMakeLists.txt.

#include "firmware/builds.h"
#include "firmware/flight_application.h"
#include "firmware/ports/stm32f4/board.h"
#include "firmware/ports/stm32f4/fault_record.h"
#include "firmware/ports/stm32f4/run_statistics.h"
#include "firmware/ports/stm32f4/stm32f4.h"
#include "firmware/ports/stm32f4/stm32f4_port.h"
#include "firmware/ports/stm32f4/symbols.h"

using namespace tiltproof;           // NOLINT: the application itself
using namespace tiltproof::stm32f4;  // NOLINT

TiltproofClientStatus tiltproof_status;

namespace {

constinit Stm32f4Port port;
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

}  // namespace

firmware::FlightApplication flight_application(*firmware::FindBuild(TILTPROOF_FIRMWARE),
                                               link::Dialect::TILTPROOF_DIALECT, port);

void stm32f4::OnReceived(firmware::Uart /*uart*/) { received = true; }

extern "C" void SysTick_Handler() { CountTick(); }

int main() {
  const ResetReason reason = StartBoard();
  StartUsarts();
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
    wake = flight_application.Tick(TickTime());

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
