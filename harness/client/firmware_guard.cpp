#include "harness/client/firmware_guard.h"

#include <sys/time.h>

#include <array>
#include <cstring>

namespace tiltproof::harness {

sigjmp_buf FirmwareGuard::jump_;
volatile sig_atomic_t FirmwareGuard::inside_ = 0;
volatile sig_atomic_t FirmwareGuard::ticks_ = 0;
volatile sig_atomic_t FirmwareGuard::caught_signal_ = 0;

void FirmwareGuard::Install() {
  // A crash may be a stack overflow: the handler needs a stack of its own.
  static std::array<char, 65536> handler_stack;
  stack_t stack{};
  stack.ss_sp = handler_stack.data();
  stack.ss_size = handler_stack.size();
  sigaltstack(&stack, nullptr);

  struct sigaction action {};
  action.sa_handler = OnSignal;
  // NODEFER: the handler is left by a jump, which would otherwise keep the signal blocked.
  action.sa_flags = SA_ONSTACK | SA_NODEFER | SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (const int signal_number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGALRM})
    sigaction(signal_number, &action, nullptr);

  const itimerval every_second{{1, 0}, {1, 0}};
  setitimer(ITIMER_REAL, &every_second, nullptr);
}

void FirmwareGuard::OnSignal(int signal_number) {
  if (signal_number == SIGALRM) {
    ticks_ = ticks_ + 1;
    // The first tick may come at once after the call began. Between calls the count means nothing: Enter()
    // clears it.
    if (inside_ == 0 || ticks_ <= kHungAfter_s) return;
  } else if (inside_ == 0) {
    // The harness's own crash: die of it.
    signal(signal_number, SIG_DFL);
    raise(signal_number);
    return;
  }
  inside_ = 0;
  caught_signal_ = signal_number;
  siglongjmp(jump_, 1);
}

void FirmwareGuard::Throw() {
  const int signal_number = caught_signal_;
  if (signal_number == SIGALRM)
    throw FirmwareTrouble(true, "the firmware did not return from a call within " +
                                    std::to_string(kHungAfter_s) + " s of wall-clock time");
  throw FirmwareTrouble(false, "the firmware crashed: " + std::string(strsignal(signal_number)));
}

}  // namespace tiltproof::harness
