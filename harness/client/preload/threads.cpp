#include "harness/client/preload/threads.h"

#include <dlfcn.h>
#include <linux/futex.h>
#include <pthread.h>
#include <threads.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "harness/client/preload/kernel.h"

namespace tiltproof::preload {
namespace {

constexpr int kThreadsMax = 512;
constexpr std::int64_t kFutileMax = 20'000'000;  // about half a second
constexpr int kSecondsMax = 4;                   // of processor time, in an instant

enum class State { kFree, kReady, kRunning, kWaiting };

struct Thread {
  State state;
  unsigned turn;  // a futex of the kernel: 1 when the thread may run
  int tid;
  std::uint64_t since;  // order in which threads became ready, or began to wait
  std::int64_t deadline_ns;
  CheckFunction check;
  void* argument;
  ucontext_t* context;    // of the system call that waits; null: signals do not end it
  std::uint64_t awaited;  // signals
  const void* futex;
  std::uint32_t bits, value;
  bool owns;  // the futex's word names its owner (a priority-inheriting lock)
  Woken woken;
};

Thread threads[kThreadsMax];
int thread_count = 0;  // slots that were ever used
Surroundings around;
std::int64_t now_ns = 0;
std::uint64_t order = 0;
std::int64_t futile = 0;
std::uint64_t instants = 0;
int departed = 0;  // a thread that has left, and that the kernel may still know
__thread Thread* self __attribute__((tls_model("initial-exec"))) = nullptr;

void MakeReady(Thread& thread, Woken woken) {
  thread.state = State::kReady;
  thread.since = ++order;
  thread.woken = woken;
  thread.futex = nullptr;
  thread.awaited = 0;
}

// The one that has been in this state for the longest.
template <typename Condition>
Thread* First(State state, Condition condition) {
  Thread* first = nullptr;
  for (int i = 0; i < thread_count; ++i)
    if (threads[i].state == state && condition(threads[i]) &&
        (first == nullptr || threads[i].since < first->since))
      first = &threads[i];
  return first;
}
Thread* FirstReady() {
  return First(State::kReady, [](const Thread&) { return true; });
}

void WakeChecked() {
  for (std::uint64_t after = 0;;) {
    Thread* next = First(State::kWaiting, [after](const Thread& thread) {
      return thread.check != nullptr && thread.since > after;
    });
    if (next == nullptr) return;
    after = next->since;
    if (next->check(next->argument)) MakeReady(*next, Woken::kByCheck);
  }
}

void WakeExpired() {
  around.expire();
  for (;;) {
    Thread* next = First(State::kWaiting, [](const Thread& thread) { return thread.deadline_ns <= now_ns; });
    if (next == nullptr) return;
    MakeReady(*next, Woken::kByDeadline);
  }
}

std::int64_t NextDeadline() {
  std::int64_t next_ns = around.next_ns();
  for (int i = 0; i < thread_count; ++i)
    if (threads[i].state == State::kWaiting && threads[i].deadline_ns < next_ns)
      next_ns = threads[i].deadline_ns;
  return next_ns;
}

// Moves the clock until a thread is ready.
Thread& NextReady() {
  for (;;) {
    if (Thread* ready = FirstReady()) return *ready;
    WakeChecked();
    if (FirstReady() != nullptr) continue;
    const std::int64_t next_ns = NextDeadline();
    if (next_ns > now_ns) {
      const std::int64_t granted_ns = Exchange(next_ns, around.sink);
      if (granted_ns > now_ns) now_ns = granted_ns;
      futile = 0;
      ++instants;
    }
    // Input first: a thread that finds it at its deadline is not late.
    WakeChecked();
    WakeExpired();
  }
}

void AwaitTurn(Thread& thread) {
  while (__atomic_exchange_n(&thread.turn, 0U, __ATOMIC_ACQUIRE) == 0)
    Kernel(SYS_futex, &thread.turn, FUTEX_WAIT_PRIVATE, 0, nullptr);
}

void HandTo(Thread& thread) {
  __atomic_store_n(&thread.turn, 1U, __ATOMIC_RELEASE);
  Kernel(SYS_futex, &thread.turn, FUTEX_WAKE_PRIVATE, 1);
}

// The kernel clears words of a thread that ends (pthread_join(), robust mutexes) and wakes no thread here.
void AfterDeparture() {
  if (departed == 0) return;
  const long process = Kernel(SYS_getpid);
  while (Kernel(SYS_tgkill, process, departed, 0) == 0) Kernel(SYS_sched_yield);
  departed = 0;
  for (;;) {
    Thread* next = First(State::kWaiting, [](const Thread& thread) {
      return thread.futex != nullptr && !thread.owns &&
             __atomic_load_n(static_cast<const std::uint32_t*>(thread.futex), __ATOMIC_ACQUIRE) !=
                 thread.value;
    });
    if (next == nullptr) return;
    MakeReady(*next, Woken::kByCheck);
  }
}

// Runs others until this thread is ready and its turn has come.
void GiveWay(Thread& thread) {
  for (;;) {
    Thread& next = NextReady();
    if (&next != &thread) {
      HandTo(next);
      AwaitTurn(thread);
      AfterDeparture();
    }
    if (thread.state == State::kReady && FirstReady() == &thread) break;
  }
  thread.state = State::kRunning;
}

Thread* NewThread() {
  for (int i = 0; i < kThreadsMax; ++i) {
    if (threads[i].state != State::kFree) continue;
    threads[i] = {};
    threads[i].since = ++order;
    if (i >= thread_count) thread_count = i + 1;
    return &threads[i];
  }
  Refuse("it has more than 512 threads");
}

}  // namespace

std::int64_t Now() { return now_ns; }

std::int64_t DeadlineOf(const timespec* timeout, bool absolute, bool realtime) {
  if (timeout == nullptr) return kNever;
  if (timeout->tv_sec > kNever / kSecond / 2) return kNever;
  std::int64_t at_ns = timeout->tv_sec * kSecond + timeout->tv_nsec;
  if (absolute) return realtime ? at_ns - kEpochSeconds * kSecond : at_ns;
  return at_ns > kNever - now_ns ? kNever : now_ns + at_ns;
}

bool IsKnownThread() { return self != nullptr; }

void BeginThreads(const Surroundings& surroundings, std::int64_t begin_ns) {
  around = surroundings;
  now_ns = begin_ns;
  self = NewThread();
  self->state = State::kRunning;
  self->tid = static_cast<int>(Kernel(SYS_gettid));
}

Woken Wait(std::int64_t deadline_ns, CheckFunction check, void* argument, ucontext_t* context) {
  Thread& thread = *self;
  thread.state = State::kWaiting;
  thread.since = ++order;
  thread.deadline_ns = deadline_ns;
  thread.check = check;
  thread.argument = argument;
  thread.context = context;
  if (deadline_ns <= now_ns) CountFutile(kFutileCall);
  GiveWay(thread);
  return thread.woken;
}

Woken WaitForSignal(std::int64_t deadline_ns, std::uint64_t mask, ucontext_t* context) {
  self->awaited = mask;
  return Wait(deadline_ns, nullptr, nullptr, context);
}

void Yield() {
  CountFutile(kFutileCall);
  MakeReady(*self, Woken::kByCheck);
  GiveWay(*self);
}

void LeaveThread() {
  Thread& thread = *self;
  self = nullptr;
  thread.state = State::kFree;
  departed = thread.tid;
  Thread* next = FirstReady();
  // One that waits then moves the clock: only without this thread do those who join it go on.
  if (next == nullptr) next = First(State::kWaiting, [](const Thread&) { return true; });
  if (next != nullptr) HandTo(*next);
}

void InterruptFor(int signal, int tid) {
  const std::uint64_t mask = 1ULL << (signal - 1);
  Thread* next = First(State::kWaiting, [mask, tid](const Thread& thread) {
    std::uint64_t blocked = 0;
    if (thread.context == nullptr) return false;
    std::memcpy(&blocked, &thread.context->uc_sigmask, sizeof blocked);
    return ((blocked & mask) == 0 || (thread.awaited & mask) != 0) && (tid == 0 || thread.tid == tid);
  });
  if (next != nullptr) MakeReady(*next, Woken::kBySignal);
}

void CountFutile(int weight) {
  if ((futile += weight) > kFutileMax)
    Refuse(
        "it spins: it reads the clock, or asks for input, again and again and never waits, so that no "
        "virtual "
        "time passes; let it wait in poll(), select(), a sleep or a timer");
}

void CheckProgress() {
  static std::uint64_t last = 0;
  static int seconds = 0;
  seconds = instants == last ? seconds + 1 : 0;
  last = instants;
  if (seconds >= kSecondsMax)
    Refuse(
        "it spins: it has taken 4 s of the processor and did not wait once, so that no virtual time passes; "
        "let it wait in poll(), select(), a sleep, a timer or a condition");
}

// ---------------------------------------------------------------------------------------------------------- futexes
namespace {

constexpr std::uint32_t kOwnerMask = FUTEX_TID_MASK;

long Wake(const void* word, int count, std::uint32_t bits) {
  long woken = 0;
  for (; woken < count; ++woken) {
    Thread* next = First(State::kWaiting, [word, bits](const Thread& thread) {
      return thread.futex == word && (thread.bits & bits) != 0;
    });
    if (next == nullptr) break;
    MakeReady(*next, Woken::kByCheck);
  }
  return woken;
}

long WaitForWord(const std::uint32_t* word, std::uint32_t bits, std::int64_t deadline_ns, ucontext_t* context,
                 bool owns = false) {
  self->futex = word;
  self->bits = bits;
  self->value = *word;
  self->owns = owns;
  const Woken woken = Wait(deadline_ns, nullptr, nullptr, context);
  return woken == Woken::kByCheck ? 0 : woken == Woken::kByDeadline ? -ETIMEDOUT : -EINTR;
}

long LockPriority(std::uint32_t* word, std::int64_t deadline_ns, ucontext_t* context, bool wait) {
  const auto own = static_cast<std::uint32_t>(self->tid);
  if ((*word & kOwnerMask) == own) return -EDEADLK;
  if ((*word & kOwnerMask) == 0) {
    *word = own | (*word & FUTEX_WAITERS);
    return 0;
  }
  if (!wait) return -EAGAIN;
  *word |= FUTEX_WAITERS;
  return WaitForWord(word, FUTEX_BITSET_MATCH_ANY, deadline_ns, context, true);
}

long UnlockPriority(std::uint32_t* word) {
  const auto is_waiting = [word](const Thread& thread) { return thread.futex == word; };
  Thread* next = First(State::kWaiting, is_waiting);
  *word = next == nullptr ? 0 : static_cast<std::uint32_t>(next->tid);
  if (next == nullptr) return 0;
  MakeReady(*next, Woken::kByCheck);
  if (First(State::kWaiting, is_waiting) != nullptr) *word |= FUTEX_WAITERS;
  return 0;
}

long Requeue(const void* word, int wake, int move, const void* to) {
  const long woken = Wake(word, wake, FUTEX_BITSET_MATCH_ANY);
  long moved = 0;
  for (; moved < move; ++moved) {
    Thread* next = First(State::kWaiting, [word](const Thread& thread) { return thread.futex == word; });
    if (next == nullptr) break;
    next->futex = to;
  }
  return woken + moved;
}

}  // namespace

long Futex(const long (&a)[6], ucontext_t* context) {
  auto* word = reinterpret_cast<std::uint32_t*>(a[0]);
  const int operation = static_cast<int>(a[1]) & FUTEX_CMD_MASK;
  const bool realtime = (a[1] & FUTEX_CLOCK_REALTIME) != 0;
  const auto value = static_cast<std::uint32_t>(a[2]);
  const auto* timeout = reinterpret_cast<const timespec*>(a[3]);
  const auto bits = static_cast<std::uint32_t>(a[5]);
  switch (operation) {
    case FUTEX_WAIT:
    case FUTEX_WAIT_BITSET:
      if (__atomic_load_n(word, __ATOMIC_SEQ_CST) != value) return -EAGAIN;
      return WaitForWord(word, operation == FUTEX_WAIT ? FUTEX_BITSET_MATCH_ANY : bits,
                         DeadlineOf(timeout, operation == FUTEX_WAIT_BITSET, realtime), context);
    case FUTEX_WAKE:
      return Wake(word, static_cast<int>(value), FUTEX_BITSET_MATCH_ANY);
    case FUTEX_WAKE_BITSET:
      return Wake(word, static_cast<int>(value), bits);
    case FUTEX_CMP_REQUEUE:
      if (__atomic_load_n(word, __ATOMIC_SEQ_CST) != bits) return -EAGAIN;
      [[fallthrough]];
    case FUTEX_REQUEUE:
      return Requeue(word, static_cast<int>(value), static_cast<int>(a[3]),
                     reinterpret_cast<const void*>(a[4]));
    case FUTEX_LOCK_PI:
    case FUTEX_LOCK_PI2:
      return LockPriority(word, DeadlineOf(timeout, true, operation == FUTEX_LOCK_PI || realtime), context,
                          true);
    case FUTEX_TRYLOCK_PI:
      return LockPriority(word, kNever, context, false);
    case FUTEX_UNLOCK_PI:
      return UnlockPriority(word);
    default:
      Refuse(
          "it uses a rare operation of futex(2): a condition variable with a priority-inheriting mutex, or "
          "WAKE_OP");
  }
}

// -------------------------------------------------------------------------------------------------- threads that start
namespace {

struct Start {
  void* (*function)(void*);
  void* argument;
  Thread* thread;
};

void* RunThread(void* raw) {
  const Start start = *static_cast<Start*>(raw);
  self = start.thread;
  __atomic_store_n(&self->tid, static_cast<int>(Kernel(SYS_gettid)), __ATOMIC_RELEASE);
  AwaitTurn(*self);
  AfterDeparture();
  // In its turn: the first use of the heap in a thread may ask the system how many processors there are.
  std::free(raw);
  GiveWay(*self);
  return start.function(start.argument);
}

}  // namespace
}  // namespace tiltproof::preload

// The threads of the program begin here, each when its turn comes.
extern "C" __attribute__((visibility("default"))) int pthread_create(pthread_t* thread,
                                                                     const pthread_attr_t* attributes,
                                                                     void* (*function)(void*),
                                                                     void* argument) noexcept {
  using namespace tiltproof::preload;
  using Create = int (*)(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
  static const auto create = reinterpret_cast<Create>(dlsym(RTLD_NEXT, "pthread_create"));
  if (!IsKnownThread()) return create(thread, attributes, function, argument);
  auto* start = static_cast<Start*>(std::malloc(sizeof(Start)));
  if (start == nullptr) return EAGAIN;
  Thread* own = NewThread();
  own->state = State::kWaiting;
  own->deadline_ns = kNever;
  *start = {function, argument, own};
  const int error = create(thread, attributes, RunThread, start);
  if (error != 0) {
    own->state = State::kFree;
    std::free(start);
    return error;
  }
  // Signals by pthread_kill() need its number.
  while (__atomic_load_n(&own->tid, __ATOMIC_ACQUIRE) == 0) Kernel(SYS_sched_yield);
  MakeReady(*own, Woken::kByCheck);
  return 0;
}

// The C library's own would not come by pthread_create().
extern "C" __attribute__((visibility("default"))) int thrd_create(thrd_t* thread, thrd_start_t function,
                                                                  void* argument) {
  // thrd_join() looks at the lower half of the result only.
  const auto start = reinterpret_cast<void* (*)(void*)>(reinterpret_cast<void (*)()>(function));
  const int error = pthread_create(thread, nullptr, start, argument);
  return error == 0 ? thrd_success : error == EAGAIN ? thrd_nomem : thrd_error;
}
