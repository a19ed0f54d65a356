#include "harness/client/firmware_guard.h"

#include <dlfcn.h>
#include <execinfo.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <utility>

#include "harness/client/code_place.h"

#ifndef sigev_notify_thread_id
#define sigev_notify_thread_id _sigev_un._tid
#endif

namespace tiltproof::harness {
namespace {

constexpr TimeNs kLookNs = 200 * kNsPerMs;

FirmwareGuard::Watched own_watched;
FirmwareGuard::Watched* watched = &own_watched;
pthread_t guarded_thread{};
pid_t guarded_process = -1;
TimeNs hung_after_ns = FirmwareGuard::kHungAfterNs;
timer_t timer{};

volatile sig_atomic_t inside = 0;
// In the harness, which the call under way has called back.
volatile sig_atomic_t called_back = 0;
FirmwareCall present_call = FirmwareCall::kNone;
std::array<char, 512> ended_by{};
volatile sig_atomic_t caught_signal = 0;
volatile sig_atomic_t caught_cause = 0;
CodePlace crash_place;
volatile sig_atomic_t looking_at_stack = 0;
std::atomic<const char*> foreign_call_back{nullptr};  // which function another thread has called back
std::atomic<pid_t> crashing_thread{0};                // the first that is not guarded
volatile sig_atomic_t stack_overflowed = 0;
const void* firmware_base = nullptr;
// 1, and 0 in a process that the firmware has forked from within a call, by whatever system call: the kernel clears it there.
// Reading it costs nothing, where asking for the process's number would cost a flight 3 % of its time.
const volatile int* original = nullptr;

// Duration of the present call; only the timer's handler updates it.
struct OwnTimeOfCall {
  std::uint64_t call = 0;
  TimeNs looked_ns = 0, run_ns = 0, waited_ns = 0;  // by then
  TimeNs own_ns = 0;
} own_time;
int waits_file = -1;

TimeNs Reading(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return time.tv_sec * kNsPerS + time.tv_nsec;
}

// Time that this thread has waited for a processor: the second number (Documentation/scheduler/sched-stats.rst of
// Linux). 0 where the kernel does not tell. Async-signal-safe.
TimeNs Waited() {
  std::array<char, 64> text;
  const ssize_t size = waits_file < 0 ? -1 : pread(waits_file, text.data(), text.size(), 0);
  const char* const end = text.data() + std::max<ssize_t>(size, 0);
  const char* at = std::find(static_cast<const char*>(text.data()), end, ' ');
  TimeNs waited_ns = 0;
  for (at = at == end ? end : at + 1; at != end && *at >= '0' && *at <= '9'; ++at)
    waited_ns = 10 * waited_ns + (*at - '0');
  return waited_ns;
}

// Describes the innermost place in the firmware's library, if there is one. What it finds may be damaged: this may crash, too.
void FindCrashPlace(const void* context, CodePlace& found) {
  const auto& registers = static_cast<const ucontext_t*>(context)->uc_mcontext;
#if defined(__x86_64__)
  const auto at = static_cast<std::uintptr_t>(registers.gregs[REG_RIP]);
  const auto* stack = reinterpret_cast<void* const*>(registers.gregs[REG_RSP]);
#elif defined(__aarch64__)
  const auto at = static_cast<std::uintptr_t>(registers.pc);
  void* const link = reinterpret_cast<void*>(registers.regs[30]);
  void* const* const stack = &link;
#else
  const std::uintptr_t at = 0;
  static_cast<void>(registers);
  void* const* const stack = nullptr;
#endif
  Dl_info info{};
  void* const place = reinterpret_cast<void*>(at);
  const auto is_firmwares = [&](const void* address) {
    return dladdr(address, &info) != 0 && info.dli_fbase == firmware_base;
  };
  if (firmware_base == nullptr) return;
  if (is_firmwares(place)) return FindCode(place, found);
  std::array<void*, 64> return_addresses;  // the innermost first
  int count = 0;
  if (at != 0 && dladdr(place, &info) != 0) {
    count = backtrace(return_addresses.data(), static_cast<int>(return_addresses.size()));
  } else if (stack != nullptr && reinterpret_cast<std::uintptr_t>(stack) % sizeof(void*) == 0) {
    // It called what is no code.
    return_addresses[0] = *stack;
    count = 1;
  }
  for (int i = 0; i < count; ++i)
    if (const void* const call = CallBefore(return_addresses[static_cast<std::size_t>(i)]);
        is_firmwares(call))
      return FindCode(call, found);
}

// True if an access that failed was where the stack grows. Its memory is there, except at its end.
bool IsAtStackPointer(const void* accessed, const void* context) {
  const auto& registers = static_cast<const ucontext_t*>(context)->uc_mcontext;
#if defined(__x86_64__)
  const auto pointer = static_cast<std::uintptr_t>(registers.gregs[REG_RSP]);
#elif defined(__aarch64__)
  const auto pointer = static_cast<std::uintptr_t>(registers.sp);
#else
  static_cast<void>(registers);
  return false;
#endif
  // A frame may be large; above it, in the frames of others, is what a buffer there may overrun.
  constexpr std::uintptr_t kBelow = 65536, kAbove = 4096;
  const auto address = reinterpret_cast<std::uintptr_t>(accessed);
  return address + kBelow >= pointer && address < pointer + kAbove;
}

// In a thread that the firmware has started. The first that crashes ends the process, once its place is found.
void NoteThread(const void* context) {
  const auto self = static_cast<pid_t>(syscall(SYS_gettid));
  pid_t first = 0;
  if (crashing_thread.compare_exchange_strong(first, self)) {
    FindCrashPlace(context, watched->thread_crash_place);
  }
  // It ends this thread, too.
  while (crashing_thread.load(std::memory_order_relaxed) != self) pause();
}

void MarkOriginal() {
  static void* const page =
      mmap(nullptr, sizeof(int), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (page == MAP_FAILED) throw std::bad_alloc();
  // Where the kernel cannot, the engine still takes no result from a copy.
  madvise(page, sizeof(int), MADV_WIPEONFORK);
  *static_cast<int*>(page) = 1;
  original = static_cast<const int*>(page);
}

// There is one flight only, and it is not a copy's.
void EndCopy() {
  if (original != nullptr && *original == 0) _Exit(0);
}

std::string PlaceOfCrash() {
  if (stack_overflowed == 0) return crash_place.at.data();
  const char* const function = crash_place.function.data();
  return *function == '\0' ? "stack overflow" : fmt::format("stack overflow in {}", function);
}

void StartTimer() {
  struct sigevent event {};
  event.sigev_notify = SIGEV_THREAD_ID;
  event.sigev_signo = SIGALRM;
  event.sigev_notify_thread_id = static_cast<pid_t>(syscall(SYS_gettid));
  if (timer_create(CLOCK_MONOTONIC, &event, &timer) != 0)
    throw std::runtime_error(fmt::format("no timer to guard the firmware's calls: {}", std::strerror(errno)));
  const timespec period{0, kLookNs};
  const itimerspec every{period, period};
  timer_settime(timer, 0, &every, nullptr);
}

}  // namespace

std::string_view Name(FirmwareCall call) {
  switch (call) {
    case FirmwareCall::kNone:
      break;
    case FirmwareCall::kLoad:
      return "dlopen";
    case FirmwareCall::kVersion:
      return "tiltproof_client_abi_version";
    case FirmwareCall::kCreate:
      return "tiltproof_client_create";
    case FirmwareCall::kStart:
      return "tiltproof_client_start";
    case FirmwareCall::kReceive:
      return "tiltproof_client_receive";
    case FirmwareCall::kGrant:
      return "tiltproof_client_grant";
    case FirmwareCall::kReset:
      return "tiltproof_client_reset";
    case FirmwareCall::kStatus:
      return "tiltproof_client_status";
    case FirmwareCall::kRole:
      return "tiltproof_client_role";
    case FirmwareCall::kDestroy:
      return "tiltproof_client_destroy";
  }
  return "no call";
}

sigjmp_buf FirmwareGuard::jump_;
FloatingPointModes FirmwareGuard::modes_;
std::exception_ptr FirmwareGuard::error_;
bool FirmwareGuard::has_left_calls_ = false;

void FirmwareGuard::Install(Watched* shared, TimeNs limit_ns) {
  if (guarded_process == getpid()) timer_delete(timer);
  watched = shared != nullptr ? shared : &own_watched;
  hung_after_ns = limit_ns;
  guarded_thread = pthread_self();
  guarded_process = getpid();
  own_time = {};
  foreign_call_back = nullptr;
  MarkOriginal();

  // A crash may be a stack overflow: the handler needs a stack of its own.
  static std::array<char, 65536> handler_stack;
  stack_t stack{};
  stack.ss_sp = handler_stack.data();
  stack.ss_size = handler_stack.size();
  sigaltstack(&stack, nullptr);

  // It loads what it needs the first time, which a handler must not.
  void* own_address = nullptr;
  static_cast<void>(backtrace(&own_address, 1));

  struct sigaction action {};
  // NODEFER: the handler is left by a jump, which would otherwise keep the signal blocked.
  action.sa_flags = SA_ONSTACK | SA_NODEFER | SA_RESTART | SA_SIGINFO;
  sigemptyset(&action.sa_mask);
  action.sa_sigaction = OnCrash;
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTRAP, SIGSYS})
    sigaction(number, &action, nullptr);
  action.sa_flags &= ~SA_SIGINFO;
  action.sa_handler = OnTimer;
  sigaction(SIGALRM, &action, nullptr);

  if (waits_file >= 0) close(waits_file);
  waits_file = open("/proc/thread-self/schedstat", O_RDONLY | O_CLOEXEC);
  StartTimer();
}

bool FirmwareGuard::IsInside() { return inside != 0 && pthread_equal(pthread_self(), guarded_thread) != 0; }

void FirmwareGuard::Enter(FirmwareCall call) {
  modes_ = FloatingPointModes();
  present_call = call;
  crash_place = {};
  watched->calls_count.store(watched->calls_count.load(std::memory_order_relaxed) + 1,
                             std::memory_order_relaxed);
  watched->inside.store(call, std::memory_order_relaxed);
  inside = 1;
}

void FirmwareGuard::Leave() {
  EndCopy();
  if (const char* const function = foreign_call_back.load(std::memory_order_relaxed)) {
    std::snprintf(ended_by.data(), ended_by.size(),
                  "called %s from a thread of its own, which no firmware may; that was noticed", function);
    Jump(kEnded);
  }
  inside = 0;
  watched->inside.store(FirmwareCall::kNone, std::memory_order_relaxed);
  modes_.Restore();
}

FloatingPointModes FirmwareGuard::LeaveForCallBack() {
  const FloatingPointModes firmwares;
  modes_.Restore();
  called_back = 1;
  inside = 0;
  return firmwares;
}

// A firmware that calls back without end spends most of its time in there, and is over its limit all the same.
void FirmwareGuard::ReturnToFirmware() {
  called_back = 0;
  inside = 1;
  if (own_time.call == watched->calls_count.load(std::memory_order_relaxed) &&
      own_time.own_ns > hung_after_ns)
    Jump(kHung);
}

void FirmwareGuard::ThrowFromCallBack() {
  called_back = 0;
  Jump(kHarnessError);
}

void FirmwareGuard::EndCall(const char* what, const CodePlace& place) {
  if (!IsInside() || guarded_process != getpid()) return;
  crash_place = place;
  std::snprintf(ended_by.data(), ended_by.size(), "%s", what);
  Jump(kEnded);
}

bool FirmwareGuard::IsGuardedThread() {
  return guarded_process == -1 || pthread_equal(pthread_self(), guarded_thread) != 0;
}

void FirmwareGuard::NoteForeignCallBack(const char* function) {
  foreign_call_back.store(function, std::memory_order_relaxed);
}

bool FirmwareGuard::IsFirmwares(const void* base) { return base != nullptr && base == firmware_base; }

void FirmwareGuard::SetFirmware(const void* address) {
  Dl_info info{};
  firmware_base = address != nullptr && dladdr(address, &info) != 0 ? info.dli_fbase : nullptr;
}

const CodePlace& FirmwareGuard::CrashPlace() { return crash_place; }

void FirmwareGuard::OnCrash(int signal_number, siginfo_t* info, void* context) {
  if (!IsInside() || guarded_process != getpid()) {
    // The harness's own crash, or that of a thread that the firmware has started: die of it.
    if (guarded_process == getpid() && pthread_equal(pthread_self(), guarded_thread) == 0)
      NoteThread(context);
    signal(signal_number, SIG_DFL);
    raise(signal_number);
    return;
  }
  if (looking_at_stack == 0) {
    caught_signal = signal_number;
    looking_at_stack = 1;
    stack_overflowed = signal_number == SIGSEGV && IsAtStackPointer(info->si_addr, context) ? 1 : 0;
    FindCrashPlace(context, crash_place);
  }
  looking_at_stack = 0;
  Jump(kCrashed);
}

void FirmwareGuard::OnTimer(int /*signal_number*/) {
  const int error = errno;
  CountOwnTime();
  if (IsInside()) {
    if (watched->stopped_itself.load(std::memory_order_relaxed)) Jump(kStoppedItself);
    if (own_time.own_ns > hung_after_ns) Jump(kHung);
  }
  errno = error;
}

void FirmwareGuard::CountOwnTime() {
  const std::uint64_t call = watched->calls_count.load(std::memory_order_relaxed);
  const OwnTimeOfCall before = own_time;
  own_time.call = call;
  own_time.looked_ns = Reading(CLOCK_MONOTONIC);
  own_time.run_ns = Reading(CLOCK_THREAD_CPUTIME_ID);
  own_time.waited_ns = Waited();
  if (call != before.call || (inside == 0 && called_back == 0)) {
    own_time.own_ns = 0;
    return;
  }
  // The timer does not go on while the process is stopped: what is more than that was not its own.
  const TimeNs elapsed_ns = std::min(own_time.looked_ns - before.looked_ns, 2 * kLookNs);
  const TimeNs waited_ns = own_time.waited_ns - before.waited_ns;
  // The harness may wait, too: for other processes.
  own_time.own_ns += called_back != 0 ? std::min(own_time.run_ns - before.run_ns, elapsed_ns)
                                      : std::max<TimeNs>(elapsed_ns - waited_ns, 0);
}

void FirmwareGuard::NoteException(const char* what) {
  std::snprintf(ended_by.data(), ended_by.size(), "threw an exception: %s", what);
  caught_cause = kEnded;
}

void FirmwareGuard::Jump(Cause cause) {
  caught_cause = cause;
  siglongjmp(jump_, 1);
}

void FirmwareGuard::Throw() {
  EndCopy();
  inside = 0;
  has_left_calls_ = true;
  watched->inside.store(FirmwareCall::kNone, std::memory_order_relaxed);
  modes_.RestoreAll();
  switch (static_cast<Cause>(caught_cause)) {
    case kHung:
      throw FirmwareTrouble(true,
                            fmt::format("the firmware did not return from {} within {} s of its own time",
                                        Name(present_call), ToSeconds(hung_after_ns)));
    case kStoppedItself:
      throw FirmwareTrouble(true, fmt::format("the firmware stopped itself in {}", Name(present_call)));
    case kEnded:
      throw FirmwareTrouble(false, fmt::format("the firmware {} in {}", ended_by.data(), Name(present_call)),
                            {.kind = FirmwareEndKind::kInOwnCode, .place = crash_place.at.data()});
    case kHarnessError:
      std::rethrow_exception(std::exchange(error_, nullptr));
    case kCrashed:
      break;
  }
  throw FirmwareTrouble(
      false,
      fmt::format("the firmware crashed in {}: {}{}", Name(present_call), strsignal(caught_signal),
                  stack_overflowed != 0 ? " (stack overflow)" : ""),
      {.kind = FirmwareEndKind::kInOwnCode, .place = PlaceOfCrash()});
}

}  // namespace tiltproof::harness
