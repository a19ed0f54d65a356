#include "harness/client/preload/calls.h"

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/sysinfo.h>
#include <sys/time.h>
#include <sys/uio.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>

#include "harness/client/preload/harness_line.h"
#include "harness/client/preload/ports.h"
#include "harness/client/preload/threads.h"
#include "harness/client/preload/timers.h"

namespace tiltproof::preload {
namespace {

template <typename T>
T* As(long word) {
  return reinterpret_cast<T*>(word);
}

constexpr std::int64_t kTicksPerSecond = 100;  // of times(), as the kernel tells every program

timespec Spec(std::int64_t ns) { return {ns / kSecond, ns % kSecond}; }
// A time-out of a call, from now on; null: never.
std::int64_t After(const timespec* timeout) { return DeadlineOf(timeout, false, false); }
std::int64_t AfterMs(long ms) { return ms < 0 ? kNever : Now() + ms * 1'000'000; }
bool IsWrong(const timespec& time) { return time.tv_sec < 0 || time.tv_nsec < 0 || time.tv_nsec >= kSecond; }

bool IsVirtual(int clock) {
  return clock >= 0 && clock != CLOCK_PROCESS_CPUTIME_ID && clock != CLOCK_THREAD_CPUTIME_ID &&
         clock <= CLOCK_TAI;
}
bool IsRealtime(int clock) {
  return clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE || clock == CLOCK_REALTIME_ALARM ||
         clock == CLOCK_TAI;
}

// ------------------------------------------------------------------------------------------------------------- waits

std::uint64_t& MaskOf(ucontext_t* context) { return *reinterpret_cast<std::uint64_t*>(&context->uc_sigmask); }

// Wait() with other signals blocked meanwhile, as in ppoll(); null: the thread's own.
Woken WaitWithMask(std::int64_t deadline_ns, CheckFunction check, void* argument, ucontext_t* context,
                   const std::uint64_t* mask) {
  if (mask == nullptr) return Wait(deadline_ns, check, argument, context);
  const std::uint64_t own = MaskOf(context), wanted = *mask & ~kTrapSignals, all = ~0ULL;
  std::uint64_t pending = 0;
  Kernel(SYS_rt_sigpending, &pending, sizeof pending);
  MaskOf(context) = wanted;
  const Woken woken =
      (pending & ~wanted) != 0 ? Woken::kBySignal : Wait(deadline_ns, check, argument, context);
  MaskOf(context) = own;
  if (woken != Woken::kBySignal) return woken;
  // The program's handler runs between these two.
  Kernel(SYS_rt_sigprocmask, SIG_SETMASK, &wanted, nullptr, sizeof wanted);
  Kernel(SYS_rt_sigprocmask, SIG_SETMASK, &all, nullptr, sizeof all);
  return woken;
}

// A call that the kernel answers at once when it is tried: with events, or with 0.
struct Trial {
  long (*attempt)(Trial& trial);
  const Call* call;
  long result;
};

bool Succeeds(void* raw) {
  auto* trial = static_cast<Trial*>(raw);
  trial->result = trial->attempt(*trial);
  return trial->result != 0;
}

long TryUntil(Trial& trial, std::int64_t deadline_ns, const std::uint64_t* mask) {
  if (Succeeds(&trial)) return trial.result;
  if (deadline_ns <= Now()) {
    CountFutile(kFutileCall);
    return 0;
  }
  const Woken woken = WaitWithMask(deadline_ns, Succeeds, &trial, trial.call->context, mask);
  return woken == Woken::kBySignal ? -EINTR : woken == Woken::kByDeadline ? 0 : trial.result;
}

// Runs a wait whose time-out, which the kernel counts down, is in a timespec.
template <typename Run>
long CountDown(timespec* timeout, Run run) {
  if (timeout == nullptr) return run(kNever);
  if (IsWrong(*timeout)) return -EINVAL;
  const std::int64_t deadline_ns = After(timeout);
  const long result = run(deadline_ns);
  *timeout = Spec(deadline_ns > Now() ? deadline_ns - Now() : 0);
  return result;
}

long Poll(const Call& call, std::int64_t deadline_ns, const std::uint64_t* mask) {
  Trial trial = {[](Trial& own) { return Kernel(SYS_poll, own.call->a[0], own.call->a[1], 0); }, &call, 0};
  return TryUntil(trial, deadline_ns, mask);
}

long EpollWait(const Call& call, std::int64_t deadline_ns, const std::uint64_t* mask) {
  Trial trial = {
      [](Trial& own) { return Kernel(SYS_epoll_wait, own.call->a[0], own.call->a[1], own.call->a[2], 0); },
      &call, 0};
  return TryUntil(trial, deadline_ns, mask);
}

// The kernel overwrites the sets, so that each trial needs the wanted ones again.
constexpr std::size_t kSetBytesMax = 1024;  // on a thread's stack
struct SelectTrial : Trial {
  unsigned char wanted[3][kSetBytesMax];
  std::size_t size;
};

long AttemptSelect(Trial& raw) {
  auto& trial = static_cast<SelectTrial&>(raw);
  unsigned char found[3][kSetBytesMax];
  void* sets[3];
  for (int i = 0; i < 3; ++i) {
    sets[i] = trial.call->a[1 + i] == 0 ? nullptr : found[i];
    std::memcpy(found[i], trial.wanted[i], trial.size);
  }
  timeval none = {0, 0};
  const long result = Kernel(SYS_select, trial.call->a[0], sets[0], sets[1], sets[2], &none);
  for (int i = 0; i < 3; ++i)
    if (result >= 0 && sets[i] != nullptr) std::memcpy(As<void>(trial.call->a[1 + i]), found[i], trial.size);
  return result;
}

long Select(const Call& call, std::int64_t deadline_ns, const std::uint64_t* mask) {
  SelectTrial trial;
  trial.attempt = AttemptSelect;
  trial.call = &call;
  if (call.a[0] < 0 || call.a[0] > static_cast<long>(8 * kSetBytesMax)) return -EINVAL;
  trial.size = (static_cast<std::size_t>(call.a[0]) + 63) / 64 * 8;
  for (int i = 0; i < 3; ++i)
    if (call.a[1 + i] != 0) std::memcpy(trial.wanted[i], As<void>(call.a[1 + i]), trial.size);
  return TryUntil(trial, deadline_ns, mask);
}

// The mask of pselect6(), which has its size beside it.
const std::uint64_t* PackedMask(long word) { return word == 0 ? nullptr : *As<const std::uint64_t*>(word); }

long SelectWithTimeval(const Call& call) {
  auto* timeout = As<timeval>(call.a[4]);
  if (timeout == nullptr) return Select(call, kNever, nullptr);
  if (timeout->tv_sec < 0 || timeout->tv_usec < 0) return -EINVAL;
  const std::int64_t deadline_ns = Now() + timeout->tv_sec * kSecond + timeout->tv_usec * 1000;
  const long result = Select(call, deadline_ns, nullptr);
  const std::int64_t left_ns = deadline_ns > Now() ? deadline_ns - Now() : 0;
  *timeout = {left_ns / kSecond, left_ns % kSecond / 1000};
  return result;
}

long Sleep(const Call& call, int clock, bool absolute, const timespec* wanted, timespec* left) {
  if (!IsVirtual(clock)) Refuse("it sleeps by a clock of processor time");
  if (IsWrong(*wanted)) return -EINVAL;
  const std::int64_t deadline_ns = DeadlineOf(wanted, absolute, IsRealtime(clock));
  if (deadline_ns <= Now()) {
    Yield();
    return 0;
  }
  if (Wait(deadline_ns, nullptr, nullptr, call.context) != Woken::kBySignal) return 0;
  if (!absolute && left != nullptr) *left = Spec(deadline_ns - Now());
  return -EINTR;
}

// ------------------------------------------------------------------------------------------------------- descriptors

struct DescriptorWait {
  int descriptor;
  short events;
};
bool IsPollable(void* raw) {
  const auto* wait = static_cast<const DescriptorWait*>(raw);
  pollfd one = {wait->descriptor, wait->events, 0};
  return Kernel(SYS_poll, &one, 1, 0) != 0;
}

// Lets the kernel do a call that may wait for input, once it does not.
long WhenReadable(const Call& call, bool dont_wait) {
  DescriptorWait wait = {static_cast<int>(call.a[0]), POLLIN};
  const auto run = [&call] {
    return Kernel(call.number, call.a[0], call.a[1], call.a[2], call.a[3], call.a[4], call.a[5]);
  };
  if (dont_wait || (Kernel(SYS_fcntl, call.a[0], F_GETFL) & O_NONBLOCK) != 0) {
    const long result = run();
    if (result == -EAGAIN) CountFutile(kFutileCall);
    return result;
  }
  if (!IsPollable(&wait)) {
    timeval timeout = {0, 0};
    socklen_t size = sizeof timeout;
    Kernel(SYS_getsockopt, call.a[0], SOL_SOCKET, SO_RCVTIMEO, &timeout, &size);
    const std::int64_t wait_ns = timeout.tv_sec * kSecond + timeout.tv_usec * 1000;
    const Woken woken = Wait(wait_ns == 0 ? kNever : Now() + wait_ns, IsPollable, &wait, call.context);
    if (woken == Woken::kBySignal) return -EINTR;
    if (woken == Woken::kByDeadline) return -EAGAIN;
  }
  return run();
}

long Read(const Call& call) {
  const int uart = PortOf(call.a[0]);
  if (uart < 0) return WhenReadable(call, false);
  if (call.number == SYS_readv)
    return ReadPort(uart, call.a[0], As<const iovec>(call.a[1]), static_cast<int>(call.a[2]), call.context);
  const iovec one = {As<void>(call.a[1]), static_cast<std::size_t>(call.a[2])};
  return ReadPort(uart, call.a[0], &one, 1, call.context);
}

long Pass(const Call& call) {
  return Kernel(call.number, call.a[0], call.a[1], call.a[2], call.a[3], call.a[4], call.a[5]);
}

long Write(const Call& call) {
  const int uart = PortOf(call.a[0]);
  if (uart < 0) return Pass(call);
  if (call.number == SYS_writev)
    return WritePort(uart, As<const iovec>(call.a[1]), static_cast<int>(call.a[2]));
  const iovec one = {As<void>(call.a[1]), static_cast<std::size_t>(call.a[2])};
  return WritePort(uart, &one, 1);
}

long Open(const Call& call, const char* path, int flags) {
  const long port = path == nullptr ? -1 : OpenPort(path, flags);
  return port != -1 ? port : Pass(call);
}

// Looks at a path, which is argument `word`: a port is as much a device as /dev/null is.
long LookAt(const Call& call, int word) {
  Call seen = call;
  if (IsPortPath(As<const char>(call.a[word]))) seen.a[word] = AsWord("/dev/null");
  return Pass(seen);
}

long Copy(const Call& call) {
  const long copy = Pass(call);
  NoteCopy(call.a[0], copy);
  return copy;
}

long Close(const Call& call) {
  // A program that closes all it might have must not close the line to the harness.
  if (IsOwnDescriptor(call.a[0])) return -EBADF;
  NoteClosed(call.a[0]);
  CloseTimerDescriptor(call.a[0]);
  return Pass(call);
}

long Control(const Call& call) {
  const int uart = PortOf(call.a[0]);
  const long result = uart < 0 ? kNotOfPort
                               : ControlPort(uart, static_cast<unsigned long>(call.a[1]) & 0xffffffffUL,
                                             As<void>(call.a[2]), call.context);
  return result == kNotOfPort ? Pass(call) : result;
}

long OpenSocket(const Call& call) {
  static bool said = false;
  if ((call.a[0] == AF_INET || call.a[0] == AF_INET6) && !said) {
    said = true;
    Log(Now(),
        "tiltproof: the program opens a network socket. Packets that arrive there come in the machine's "
        "time: "
        "two flights may differ.");
  }
  return Pass(call);
}

// The same numbers in each flight. SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
long FillWithNumbers(unsigned char* bytes, std::size_t count) {
  static std::uint64_t state = 0;
  for (std::size_t i = 0; i < count; ++i) {
    static std::uint64_t number = 0;
    static int left = 0;
    if (left == 0) {
      std::uint64_t mixed = state += 0x9e3779b97f4a7c15ULL;
      mixed = (mixed ^ mixed >> 30) * 0xbf58476d1ce4e5b9ULL;
      mixed = (mixed ^ mixed >> 27) * 0x94d049bb133111ebULL;
      number = mixed ^ mixed >> 31;
      left = 8;
    }
    bytes[i] = static_cast<unsigned char>(number >> 8 * --left);
  }
  return static_cast<long>(count);
}

// ----------------------------------------------------------------------------------------------------------- signals

struct KernelAction {
  void* handler;
  unsigned long flags;
  void* restorer;
  std::uint64_t mask;
};

long SetAction(const Call& call) {
  const auto* wanted = As<const KernelAction>(call.a[1]);
  if (call.a[0] == SIGSYS) return 0;  // the trap's own: the program never gets one
  if (call.a[0] == SIGSEGV) return SetSegmentAction(wanted, As<void>(call.a[2]));
  if (wanted == nullptr) return Pass(call);
  KernelAction action = *wanted;
  action.mask &= ~kTrapSignals;
  return Kernel(SYS_rt_sigaction, call.a[0], &action, call.a[2], call.a[3]);
}

// The mask that the kernel restores when the trapped call returns.
long SetMask(const Call& call) {
  std::uint64_t& mask = MaskOf(call.context);
  const auto* wanted = As<const std::uint64_t>(call.a[1]);
  const std::uint64_t before = mask, change = wanted == nullptr ? 0 : *wanted;
  if (call.a[3] != sizeof mask) return -EINVAL;
  if (wanted != nullptr) {
    if (call.a[0] == SIG_BLOCK)
      mask |= change;
    else if (call.a[0] == SIG_UNBLOCK)
      mask &= ~change;
    else if (call.a[0] == SIG_SETMASK)
      mask = change;
    else
      return -EINVAL;
    mask &= ~kTrapSignals;
  }
  if (call.a[2] != 0) *As<std::uint64_t>(call.a[2]) = before;
  return 0;
}

long AwaitSignal(const Call& call) {
  const std::int64_t deadline_ns = After(As<const timespec>(call.a[2]));
  const timespec none = {0, 0};
  const auto take = [&] { return Kernel(SYS_rt_sigtimedwait, call.a[0], call.a[1], &none, call.a[3]); };
  if (const long signal = take(); signal != -EAGAIN) return signal;
  if (deadline_ns <= Now()) {
    CountFutile(kFutileCall);
    return -EAGAIN;
  }
  // Only the thread itself can take a signal that was sent to it.
  if (WaitForSignal(deadline_ns, *As<const std::uint64_t>(call.a[0]), call.context) == Woken::kByDeadline)
    return -EAGAIN;
  const long signal = take();
  return signal == -EAGAIN ? -EINTR : signal;
}

long Pause(const Call& call, const std::uint64_t* mask) {
  while (WaitWithMask(kNever, nullptr, nullptr, call.context, mask) != Woken::kBySignal) {
  }
  return -EINTR;
}

// A signal to the process itself (kill), or to one of its threads (tgkill).
long Kill(const Call& call) {
  const long result = Pass(call);
  const bool to_thread = call.number == SYS_tgkill;
  const long signal = call.a[to_thread ? 2 : 1];
  if (result == 0 && signal != 0 && call.a[0] == Kernel(SYS_getpid))
    InterruptFor(static_cast<int>(signal), to_thread ? static_cast<int>(call.a[1]) : 0);
  return result;
}

// ------------------------------------------------------------------------------------------------------------ timers

itimerspec FromInterval(const itimerval& value) {
  return {{value.it_interval.tv_sec, value.it_interval.tv_usec * 1000},
          {value.it_value.tv_sec, value.it_value.tv_usec * 1000}};
}
itimerval ToInterval(const itimerspec& value) {
  return {{value.it_interval.tv_sec, value.it_interval.tv_nsec / 1000},
          {value.it_value.tv_sec, (value.it_value.tv_nsec + 999) / 1000}};
}

long SetInterval(const Call& call) {
  if (call.a[0] != ITIMER_REAL) Refuse("it sets a timer of processor time (ITIMER_VIRTUAL or ITIMER_PROF)");
  itimerspec old;
  const auto* wanted = As<const itimerval>(call.a[1]);
  const itimerspec value = wanted == nullptr ? itimerspec{} : FromInterval(*wanted);
  const long result = SetTimer(kIntervalTimer, 0, &value, &old);
  if (result == 0 && call.a[2] != 0) *As<itimerval>(call.a[2]) = ToInterval(old);
  return result;
}

long Alarm(long seconds) {
  itimerspec old;
  const itimerspec value = {{0, 0}, {seconds, 0}};
  SetTimer(kIntervalTimer, 0, &value, &old);
  return old.it_value.tv_sec + (old.it_value.tv_nsec > 0 ? 1 : 0);
}

long TimerDescriptorCall(const Call& call) {
  const long result = call.number == SYS_timerfd_settime
                          ? SetTimerDescriptor(call.a[0], static_cast<int>(call.a[1]),
                                               As<const itimerspec>(call.a[2]), As<itimerspec>(call.a[3]))
                          : GetTimerDescriptor(call.a[0], As<itimerspec>(call.a[1]));
  return result == kNoTimer ? Pass(call) : result;
}

// ---------------------------------------------------------------------------------------------------------- dispatch

constexpr long kOther = -4097;

long Waiting(const Call& call) {
  const long(&a)[6] = call.a;
  switch (call.number) {
    case SYS_nanosleep:
      return Sleep(call, CLOCK_MONOTONIC, false, As<const timespec>(a[0]), As<timespec>(a[1]));
    case SYS_clock_nanosleep:
      return Sleep(call, static_cast<int>(a[0]), (a[1] & TIMER_ABSTIME) != 0, As<const timespec>(a[2]),
                   As<timespec>(a[3]));
    case SYS_poll:
      return Poll(call, AfterMs(static_cast<int>(a[2])), nullptr);
    case SYS_ppoll:
      return CountDown(As<timespec>(a[2]), [&](std::int64_t deadline_ns) {
        return Poll(call, deadline_ns, As<const std::uint64_t>(a[3]));
      });
    case SYS_select:
      return SelectWithTimeval(call);
    case SYS_pselect6:
      return CountDown(As<timespec>(a[4]),
                       [&](std::int64_t deadline_ns) { return Select(call, deadline_ns, PackedMask(a[5])); });
    case SYS_epoll_wait:
      return EpollWait(call, AfterMs(static_cast<int>(a[3])), nullptr);
    case SYS_epoll_pwait:
      return EpollWait(call, AfterMs(static_cast<int>(a[3])), As<const std::uint64_t>(a[4]));
    case SYS_epoll_pwait2:
      return EpollWait(call, After(As<const timespec>(a[3])), As<const std::uint64_t>(a[4]));
    case SYS_futex:
      return Futex(a, call.context);
    case SYS_sched_yield:
      Yield();
      return 0;
    case SYS_pause:
      return Pause(call, nullptr);
    case SYS_rt_sigsuspend:
      return Pause(call, As<const std::uint64_t>(a[0]));
    case SYS_rt_sigtimedwait:
      return AwaitSignal(call);
    case SYS_recvfrom:
      return WhenReadable(call, (a[3] & MSG_DONTWAIT) != 0);
    case SYS_recvmsg:
      return WhenReadable(call, (a[2] & MSG_DONTWAIT) != 0);
    case SYS_recvmmsg:
      return WhenReadable(call, (a[3] & MSG_DONTWAIT) != 0);
    case SYS_accept:
    case SYS_accept4:
      return WhenReadable(call, false);
    default:
      return kOther;
  }
}

long OnTime(const Call& call) {
  const long(&a)[6] = call.a;
  switch (call.number) {
    case SYS_clock_gettime:
      return VirtualClockGettime(static_cast<int>(a[0]), As<void>(a[1]));
    case SYS_gettimeofday:
      return VirtualGettimeofday(As<void>(a[0]), As<void>(a[1]));
    case SYS_time:
      return VirtualTime(As<long>(a[0]));
    case SYS_times: {
      const long failed = Kernel(SYS_times, a[0]);
      return failed < 0 ? failed : Now() / (kSecond / kTicksPerSecond);
    }
    case SYS_sysinfo: {
      const long failed = Kernel(SYS_sysinfo, a[0]);
      if (failed == 0) As<struct sysinfo>(a[0])->uptime = Now() / kSecond;
      return failed;
    }
    case SYS_clock_settime:
    case SYS_settimeofday:
    case SYS_clock_adjtime:
    case SYS_adjtimex:
      Refuse("it sets a clock (clock_settime, settimeofday or adjtimex); the harness keeps its time");
    case SYS_alarm:
      return Alarm(a[0]);
    case SYS_setitimer:
      return SetInterval(call);
    case SYS_getitimer: {
      itimerspec value;
      GetTimer(kIntervalTimer, &value);
      *As<itimerval>(a[1]) = ToInterval(value);
      return 0;
    }
    case SYS_timer_create:
      return CreateTimer(static_cast<int>(a[0]), As<const void>(a[1]), As<int>(a[2]));
    case SYS_timer_settime:
      return SetTimer(static_cast<int>(a[0]), static_cast<int>(a[1]), As<const itimerspec>(a[2]),
                      As<itimerspec>(a[3]));
    case SYS_timer_gettime:
      return GetTimer(static_cast<int>(a[0]), As<itimerspec>(a[1]));
    case SYS_timer_delete:
      return DeleteTimer(static_cast<int>(a[0]));
    case SYS_timer_getoverrun:
      return 0;
    case SYS_timerfd_create:
      return CreateTimerDescriptor(static_cast<int>(a[0]), static_cast<int>(a[1]));
    case SYS_timerfd_settime:
    case SYS_timerfd_gettime:
      return TimerDescriptorCall(call);
    default:
      return kOther;
  }
}

long OnDescriptor(const Call& call) {
  const long(&a)[6] = call.a;
  switch (call.number) {
    case SYS_read:
    case SYS_readv:
      return Read(call);
    case SYS_write:
    case SYS_writev:
      return Write(call);
    case SYS_open:
      return Open(call, As<const char>(a[0]), static_cast<int>(a[1]));
    case SYS_openat:
      return Open(call, As<const char>(a[1]), static_cast<int>(a[2]));
    case SYS_stat:
    case SYS_lstat:
    case SYS_access:
    case SYS_readlink:
      return LookAt(call, 0);
    case SYS_newfstatat:
    case SYS_statx:
    case SYS_faccessat:
    case SYS_faccessat2:
    case SYS_readlinkat:
      return LookAt(call, 1);
    case SYS_close:
      return Close(call);
    case SYS_close_range:
      return -ENOSYS;  // the C library then closes one by one
    case SYS_dup:
    case SYS_dup2:
    case SYS_dup3:
      return Copy(call);
    case SYS_fcntl:
      return a[1] == F_DUPFD || a[1] == F_DUPFD_CLOEXEC ? Copy(call) : Pass(call);
    case SYS_ioctl:
      return Control(call);
    case SYS_socket:
      return OpenSocket(call);
    case SYS_getrandom:
      return FillWithNumbers(As<unsigned char>(a[0]), static_cast<std::size_t>(a[1]));
    default:
      return kOther;
  }
}

[[noreturn]] void RefuseCall(const Call& call) {
  switch (call.number) {
    case -1:
      Refuse("it makes a system call of another processor (32-bit code)");
    case SYS_clone:
    case SYS_fork:
    case SYS_vfork:
      Refuse("it starts another process (fork, system, popen or posix_spawn); only one process is held");
    case SYS_execve:
    case SYS_execveat:
      Refuse("it replaces itself with another program (exec); let CMD start that one");
    case SYS_futex_waitv:
      Refuse("it waits for several futexes at once (futex_waitv)");
    case SYS_io_uring_setup:
      Refuse("it uses io_uring, whose waits are invisible");
    case SYS_mq_open:
    case SYS_mq_timedreceive:
    case SYS_mq_timedsend:
      Refuse("it uses a POSIX message queue (mq_open), which would wait in the machine's time");
    case SYS_msgrcv:
    case SYS_semop:
    case SYS_semtimedop:
      Refuse("it waits for a System V message or semaphore (msgrcv, semop) in the machine's time");
    default: {
      static char text[96];
      std::snprintf(text, sizeof text,
                    "it makes the system call %ld (man 2 syscalls), which may wait in the machine's time",
                    call.number);
      Refuse(text);
    }
  }
}

// A thread that pthread_create() starts, before it is one of those that take turns.
long OfUnknownThread(const Call& call) {
  switch (call.number) {
    case SYS_rt_sigprocmask:
      return SetMask(call);
    case SYS_exit:
    case SYS_exit_group:
    case SYS_close:
    case SYS_write:
      return Pass(call);
    case SYS_futex:
      if ((call.a[1] & 127) != 0 || call.a[3] == 0) return Pass(call);
      break;
    case SYS_rt_sigtimedwait:
      if (call.a[0] != 0 && (*As<const std::uint64_t>(call.a[0]) & 1ULL << (kTimerHelperSignal - 1)) != 0)
        RefuseTimerThreads();
      break;
    default:
      break;
  }
  Refuse("a thread that pthread_create() did not start (clone, or a helper of the C library) waits");
}

}  // namespace

long Dispatch(const Call& call) {
  if (!IsKnownThread()) return OfUnknownThread(call);
  if (const long result = Waiting(call); result != kOther) return result;
  if (const long result = OnTime(call); result != kOther) return result;
  if (const long result = OnDescriptor(call); result != kOther) return result;
  switch (call.number) {
    case SYS_rt_sigprocmask:
      return SetMask(call);
    case SYS_rt_sigaction:
      return SetAction(call);
    case SYS_kill:
    case SYS_rt_sigqueueinfo:
    case SYS_tgkill:
      return Kill(call);
    case SYS_exit:
      LeaveThread();
      return Pass(call);
    case SYS_exit_group:
      Flush();
      return Pass(call);
    default:
      RefuseCall(call);
  }
}

int VirtualClockGettime(int clock, void* time) {
  if (!IsVirtual(clock)) return static_cast<int>(Kernel(SYS_clock_gettime, clock, time));
  CountFutile(1);
  const timespec now = Spec(Now() + (IsRealtime(clock) ? kEpochSeconds * kSecond : 0));
  if (time == nullptr) return -EFAULT;
  std::memcpy(time, &now, sizeof now);
  return 0;
}

int VirtualGettimeofday(void* time, void* zone) {
  CountFutile(1);
  const timeval now = {Now() / kSecond + kEpochSeconds, Now() % kSecond / 1000};
  if (time != nullptr) std::memcpy(time, &now, sizeof now);
  if (zone != nullptr) std::memset(zone, 0, sizeof(struct timezone));
  return 0;
}

long VirtualTime(long* seconds) {
  CountFutile(1);
  const long now = Now() / kSecond + kEpochSeconds;
  if (seconds != nullptr) *seconds = now;
  return now;
}

}  // namespace tiltproof::preload
