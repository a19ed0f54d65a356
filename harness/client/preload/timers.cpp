#include "harness/client/preload/timers.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>

#include <cerrno>

#include "harness/client/preload/harness_line.h"
#include "harness/client/preload/kernel.h"
#include "harness/client/preload/threads.h"

namespace tiltproof::preload {
namespace {

constexpr int kTimersMax = 64;

struct Timer {
  bool used = false, realtime = false;
  long descriptor = -1;  // of an event; -1: it has a signal
  int signal = 0;        // 0: none
  int tid = 0;           // 0: the process
  sigval value = {};
  std::int64_t next_ns = kNever, interval_ns = 0;
};
Timer timers[kTimersMax] = {{.used = true, .signal = SIGALRM}};

Timer* NewTimer() {
  for (Timer& timer : timers)
    if (!timer.used) {
      timer = {};
      timer.used = true;
      return &timer;
    }
  return nullptr;
}

Timer* OfDescriptor(long descriptor) {
  for (Timer& timer : timers)
    if (timer.used && descriptor >= 0 && timer.descriptor == descriptor) return &timer;
  return nullptr;
}

timespec Spec(std::int64_t ns) { return {ns / kSecond, ns % kSecond}; }

void Get(const Timer& timer, itimerspec* value) {
  value->it_interval = Spec(timer.interval_ns);
  value->it_value = Spec(timer.next_ns == kNever ? 0 : timer.next_ns - Now() > 0 ? timer.next_ns - Now() : 1);
}

void DropCount(const Timer& timer) {
  std::uint64_t count;
  if (timer.descriptor < 0) return;
  const long flags = Kernel(SYS_fcntl, timer.descriptor, F_GETFL);
  Kernel(SYS_fcntl, timer.descriptor, F_SETFL, flags | O_NONBLOCK);
  Kernel(SYS_read, timer.descriptor, &count, sizeof count);
  Kernel(SYS_fcntl, timer.descriptor, F_SETFL, flags);
}

long Set(Timer& timer, bool absolute, const itimerspec* value, itimerspec* old) {
  if (old != nullptr) Get(timer, old);
  const auto is_wrong = [](const timespec& spec) {
    return spec.tv_sec < 0 || spec.tv_nsec < 0 || spec.tv_nsec >= kSecond;
  };
  if (is_wrong(value->it_value) || is_wrong(value->it_interval)) return -EINVAL;
  const bool stops = value->it_value.tv_sec == 0 && value->it_value.tv_nsec == 0;
  DropCount(timer);
  timer.next_ns = stops ? kNever : DeadlineOf(&value->it_value, absolute, timer.realtime);
  timer.interval_ns = value->it_interval.tv_sec * kSecond + value->it_interval.tv_nsec;
  if (timer.next_ns <= Now()) ExpireTimers();
  return 0;
}

void Fire(const Timer& timer, std::uint64_t count) {
  if (timer.descriptor >= 0) {
    Kernel(SYS_write, timer.descriptor, &count, sizeof count);
    return;
  }
  if (timer.signal == 0) return;
  siginfo_t info = {};
  info.si_signo = timer.signal;
  info.si_code = SI_TIMER;
  info.si_value = timer.value;
  const long process = Kernel(SYS_getpid);
  if (timer.tid == 0)
    Kernel(SYS_rt_sigqueueinfo, process, timer.signal, &info);
  else
    Kernel(SYS_rt_tgsigqueueinfo, process, timer.tid, timer.signal, &info);
  InterruptFor(timer.signal, timer.tid);
}

}  // namespace

std::int64_t NextTimer() {
  std::int64_t next_ns = kNever;
  for (const Timer& timer : timers)
    if (timer.used && timer.next_ns < next_ns) next_ns = timer.next_ns;
  return next_ns;
}

void ExpireTimers() {
  for (;;) {
    Timer* first = nullptr;
    for (Timer& timer : timers)
      if (timer.used && timer.next_ns <= Now() && (first == nullptr || timer.next_ns < first->next_ns))
        first = &timer;
    if (first == nullptr) return;
    std::uint64_t count = 1;
    if (first->interval_ns > 0) {
      count += static_cast<std::uint64_t>((Now() - first->next_ns) / first->interval_ns);
      first->next_ns += static_cast<std::int64_t>(count) * first->interval_ns;
    } else {
      first->next_ns = kNever;
    }
    Fire(*first, count);
  }
}

long CreateTimerDescriptor(int clock, int flags) {
  if (clock != CLOCK_MONOTONIC && clock != CLOCK_REALTIME && clock != CLOCK_BOOTTIME) return -EINVAL;
  Timer* timer = NewTimer();
  if (timer == nullptr) return -EMFILE;
  const long descriptor = Kernel(SYS_eventfd2, 0, flags);  // the flags have the same values
  timer->used = descriptor >= 0;
  timer->descriptor = descriptor;
  timer->realtime = clock == CLOCK_REALTIME;
  return descriptor;
}

long SetTimerDescriptor(long descriptor, int flags, const itimerspec* value, itimerspec* old) {
  Timer* timer = OfDescriptor(descriptor);
  return timer == nullptr ? kNoTimer : Set(*timer, (flags & TFD_TIMER_ABSTIME) != 0, value, old);
}

long GetTimerDescriptor(long descriptor, itimerspec* value) {
  const Timer* timer = OfDescriptor(descriptor);
  if (timer == nullptr) return kNoTimer;
  Get(*timer, value);
  return 0;
}

void CloseTimerDescriptor(long descriptor) {
  if (Timer* timer = OfDescriptor(descriptor)) timer->used = false;
}

void RefuseTimerThreads() { Refuse("it makes a timer that starts threads (SIGEV_THREAD)"); }

long CreateTimer(int clock, const void* raw, int* id) {
  const auto* event = static_cast<const sigevent*>(raw);
  if (clock != CLOCK_MONOTONIC && clock != CLOCK_REALTIME && clock != CLOCK_BOOTTIME)
    Refuse("it makes a timer on a clock of processor time");
  if (event != nullptr && event->sigev_signo == kTimerHelperSignal) RefuseTimerThreads();
  Timer* timer = NewTimer();
  if (timer == nullptr) return -EAGAIN;
  *id = static_cast<int>(timer - timers);
  timer->realtime = clock == CLOCK_REALTIME;
  timer->signal = event == nullptr ? SIGALRM : event->sigev_notify == SIGEV_NONE ? 0 : event->sigev_signo;
  if (event == nullptr)
    timer->value.sival_int = *id;
  else
    timer->value = event->sigev_value;
  if (event != nullptr && event->sigev_notify == SIGEV_THREAD_ID) timer->tid = event->_sigev_un._tid;
  return 0;
}

long SetTimer(int id, int flags, const itimerspec* value, itimerspec* old) {
  if (id < 0 || id >= kTimersMax || !timers[id].used || value == nullptr) return -EINVAL;
  return Set(timers[id], (flags & TIMER_ABSTIME) != 0, value, old);
}

long GetTimer(int id, itimerspec* value) {
  if (id < 0 || id >= kTimersMax || !timers[id].used) return -EINVAL;
  Get(timers[id], value);
  return 0;
}

long DeleteTimer(int id) {
  if (id <= kIntervalTimer || id >= kTimersMax || !timers[id].used) return -EINVAL;
  timers[id].used = false;
  return 0;
}

}  // namespace tiltproof::preload
