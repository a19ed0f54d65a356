/* A program that waits in every way that the C library has, for preload_test.py: waiting_program CASE PORT REFERENCE_PORT.
 * Each line of its output is a name and a number; `at` and others end with the time in microseconds. */
#define _GNU_SOURCE
#include <elf.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/io_uring.h>
#include <mqueue.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/auxv.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/ipc.h>
#include <sys/msg.h>
#include <sys/random.h>
#include <sys/select.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/sysinfo.h>
#include <sys/time.h>
#include <sys/timerfd.h>
#include <sys/times.h>
#include <sys/wait.h>
#include <termios.h>
#include <threads.h>
#include <time.h>
#include <unistd.h>
#include <x86intrin.h>

static const char *port_path, *reference_path;

static long long us_of(clockid_t clock) {
  struct timespec time;
  clock_gettime(clock, &time);
  return time.tv_sec * 1000000LL + time.tv_nsec / 1000;
}
static void say(const char* name, long value) {
  printf("%s %ld at %lld\n", name, value, us_of(CLOCK_MONOTONIC));
  fflush(stdout);
}
static struct timespec in_us(long us) { return (struct timespec){us / 1000000, us % 1000000 * 1000}; }
static struct timespec at_us(clockid_t clock, long after_us) {
  const long long us = us_of(clock) + after_us;
  return (struct timespec){us / 1000000, us % 1000000 * 1000};
}
static int open_port(int flags) { return open(port_path, O_RDWR | O_NOCTTY | flags); }

/* The function of the kernel's shared page, found by hand as some run-time libraries do. */
static void* shared_page_function(const char* name) {
  const char* page = (const char*)getauxval(AT_SYSINFO_EHDR);
  const Elf64_Ehdr* header = (const Elf64_Ehdr*)page;
  const Elf64_Shdr* sections = (const Elf64_Shdr*)(page + header->e_shoff);
  for (int i = 0; i < header->e_shnum; ++i) {
    if (sections[i].sh_type != SHT_DYNSYM) continue;
    const Elf64_Sym* symbols = (const Elf64_Sym*)(page + sections[i].sh_offset);
    const char* names = page + sections[sections[i].sh_link].sh_offset;
    for (size_t k = 0; k < sections[i].sh_size / sizeof *symbols; ++k)
      if (strcmp(names + symbols[k].st_name, name) == 0) return (void*)(page + symbols[k].st_value);
  }
  return NULL;
}

static void clocks(void) {
  struct timespec time_ns = {0, 0};
  struct timeval time_us = {0, 0};
  usleep(2500);
  say("monotonic", (long)us_of(CLOCK_MONOTONIC));
  say("raw", (long)us_of(CLOCK_MONOTONIC_RAW));
  say("coarse", (long)us_of(CLOCK_MONOTONIC_COARSE));
  say("boot", (long)us_of(CLOCK_BOOTTIME));
  say("realtime", (long)us_of(CLOCK_REALTIME));
  gettimeofday(&time_us, NULL);
  say("timeofday", time_us.tv_sec * 1000000L + time_us.tv_usec);
  say("time", (long)time(NULL));
  timespec_get(&time_ns, TIME_UTC);
  say("timespec_get", time_ns.tv_sec * 1000000L + time_ns.tv_nsec / 1000);
  syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &time_ns);
  say("direct", time_ns.tv_nsec / 1000);
  int (*by_hand)(clockid_t, struct timespec*) =
      (int (*)(clockid_t, struct timespec*))shared_page_function("__vdso_clock_gettime");
  by_hand(CLOCK_MONOTONIC, &time_ns);
  say("by_hand", time_ns.tv_nsec / 1000);
  usleep(2000000);
  struct tms used;
  struct sysinfo system;
  say("times", (long)times(&used));
  say("uptime", sysinfo(&system) == 0 ? system.uptime : -1);
  /* The processor's time stays the machine's. */
  volatile double x = 1;
  const long long before_us = us_of(CLOCK_PROCESS_CPUTIME_ID);
  for (long i = 0; i < 3000000; ++i) x *= 1.0000001;
  say("processor", us_of(CLOCK_PROCESS_CPUTIME_ID) > before_us);
}

static void sleeps(void) {
  struct timespec time = in_us(1500), left = {0, 0};
  say("nanosleep", nanosleep(&time, &left));
  say("clock_nanosleep", clock_nanosleep(CLOCK_MONOTONIC, 0, &time, NULL));
  time = at_us(CLOCK_MONOTONIC, 10000);
  say("absolute", clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, NULL));
  time = at_us(CLOCK_REALTIME, 10000);
  say("realtime", clock_nanosleep(CLOCK_REALTIME, TIMER_ABSTIME, &time, NULL));
  say("past", clock_nanosleep(CLOCK_REALTIME, TIMER_ABSTIME, &(struct timespec){1, 0}, NULL));
  say("usleep", usleep(250));
  say("sleep", sleep(2));
  time = in_us(1000);
  say("direct", syscall(SYS_nanosleep, &time, NULL));
}

static void polls(void) {
  const int port = open_port(0);
  struct pollfd one = {port, POLLIN, 0};
  struct timespec time = in_us(2500);
  struct timeval left = {0, 7000};
  struct epoll_event event = {.events = EPOLLIN, .data.u32 = 7};
  fd_set set;
  say("poll", poll(&one, 1, 10));
  say("zero", poll(&one, 1, 0));
  say("ppoll", ppoll(&one, 1, &time, NULL));
  FD_ZERO(&set);
  FD_SET(port, &set);
  say("select", select(port + 1, &set, NULL, NULL, &left));
  say("set", FD_ISSET(port, &set));
  say("left", left.tv_usec);
  FD_SET(port, &set);
  say("pselect", pselect(port + 1, &set, NULL, NULL, &time, NULL));
  const int epoll = epoll_create1(0);
  epoll_ctl(epoll, EPOLL_CTL_ADD, port, &event);
  say("epoll_wait", epoll_wait(epoll, &event, 1, 3));
  say("epoll_pwait", epoll_pwait(epoll, &event, 1, 4, NULL));
  say("nothing", poll(NULL, 0, 5));
  /* Bytes come at 100 ms, 110 ms and 120 ms. */
  char bytes[8];
  say("poll_input", poll(&one, 1, 1000));
  say("read", read(port, bytes, sizeof bytes));
  left = (struct timeval){1, 0};
  FD_SET(port, &set);
  say("select_input", select(port + 1, &set, NULL, NULL, &left));
  say("left", left.tv_usec);
  say("read", read(port, bytes, sizeof bytes));
  say("epoll_input", epoll_wait(epoll, &event, 1, 1000));
  say("data", event.data.u32);
}

static void ports(void) {
  struct termios settings;
  char bytes[32];
  int count = 0;
  struct stat status = {0};
  say("exists", access(port_path, R_OK | W_OK));
  stat(port_path, &status);
  say("is_device", S_ISCHR(status.st_mode));
  char* path = realpath(port_path, NULL);
  say("real_path", strcmp(path, port_path));
  free(path);
  const int port = open_port(0);
  say("isatty", isatty(port));
  tcgetattr(port, &settings);
  cfmakeraw(&settings);
  cfsetspeed(&settings, B115200);
  settings.c_cc[VMIN] = 4;
  settings.c_cc[VTIME] = 0;
  say("tcsetattr", tcsetattr(port, TCSANOW, &settings));
  say("speed", cfgetospeed(&settings) == B115200);
  /* Two bytes at 10 ms, three at 20 ms, one at 30 ms. */
  say("read4", read(port, bytes, sizeof bytes));
  say("third", bytes[2]);
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 2; /* 0.2 s */
  tcsetattr(port, TCSANOW, &settings);
  say("read1", read(port, bytes, sizeof bytes));
  say("time_out", read(port, bytes, sizeof bytes));
  settings.c_cc[VTIME] = 0;
  tcsetattr(port, TCSANOW, &settings);
  say("poll_mode", read(port, bytes, sizeof bytes));
  fcntl(port, F_SETFL, O_NONBLOCK);
  settings.c_cc[VMIN] = 1;
  tcsetattr(port, TCSANOW, &settings);
  say("nonblocking", read(port, bytes, sizeof bytes));
  say("errno", errno == EAGAIN);
  /* 100 characters of 10 bits at 115200 baud: 8680.6 us. */
  memset(bytes, 'x', sizeof bytes);
  for (int i = 0; i < 5; ++i) count += (int)write(port, bytes, 20);
  say("written", count);
  ioctl(port, TIOCOUTQ, &count);
  say("queued", count);
  say("tcdrain", tcdrain(port));
  /* Two bytes at 500 ms, dropped; two at 510 ms. */
  poll(&(struct pollfd){port, POLLIN, 0}, 1, 1000);
  ioctl(port, FIONREAD, &count);
  say("waiting", count);
  tcflush(port, TCIFLUSH);
  say("flushed", poll(&(struct pollfd){port, POLLIN, 0}, 1, 0));
  const int copy = dup(port);
  close(port);
  fcntl(copy, F_SETFL, 0);
  say("copy", read(copy, bytes, 1));
  say("byte", bytes[0]);
  close(copy);
  /* The C library's files, on the other port: a line comes at 600 ms. */
  FILE* file = fopen(reference_path, "r+");
  setvbuf(file, NULL, _IONBF, 0);
  say("fgets", fgets(bytes, sizeof bytes, file) != NULL);
  fputs("reply\n", file);
  say("line", strcmp(bytes, "line\n"));
}

static void timers(void) {
  uint64_t count = 0;
  const int timer = timerfd_create(CLOCK_MONOTONIC, 0);
  struct itimerspec value = {.it_value = in_us(5000), .it_interval = in_us(2000)};
  say("settime", timerfd_settime(timer, 0, &value, NULL));
  say("read", read(timer, &count, sizeof count));
  say("count", (long)count);
  usleep(7000); /* until 12: also at 7, 9 and 11 ms */
  say("poll", poll(&(struct pollfd){timer, POLLIN, 0}, 1, 0));
  read(timer, &count, sizeof count);
  say("count", (long)count);
  timerfd_gettime(timer, &value);
  say("left", value.it_value.tv_nsec / 1000);
  value = (struct itimerspec){.it_value = at_us(CLOCK_MONOTONIC, 3000)};
  timerfd_settime(timer, TFD_TIMER_ABSTIME, &value, NULL);
  read(timer, &count, sizeof count);
  say("absolute", (long)count);
  value = (struct itimerspec){.it_value = {0, 0}};
  timerfd_settime(timer, 0, &value, NULL);
  say("stopped", poll(&(struct pollfd){timer, POLLIN, 0}, 1, 50));
  const int realtime = timerfd_create(CLOCK_REALTIME, TFD_NONBLOCK);
  value = (struct itimerspec){.it_value = at_us(CLOCK_REALTIME, 3000)};
  timerfd_settime(realtime, TFD_TIMER_ABSTIME, &value, NULL);
  say("early", read(realtime, &count, sizeof count));
  say("realtime", poll(&(struct pollfd){realtime, POLLIN, 0}, 1, 50));
}

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t condition = PTHREAD_COND_INITIALIZER;

static void* hold_mutex(void* unused) {
  pthread_mutex_lock(&mutex);
  usleep(30000);
  pthread_mutex_unlock(&mutex);
  return unused;
}

static void locks(void) {
  struct timespec time = at_us(CLOCK_REALTIME, 4000);
  sem_t semaphore;
  pthread_condattr_t attributes;
  pthread_cond_t monotonic;
  pthread_t thread;
  pthread_mutex_lock(&mutex);
  say("cond_timedwait", pthread_cond_timedwait(&condition, &mutex, &time));
  time = at_us(CLOCK_MONOTONIC, 4000);
  say("cond_clockwait", pthread_cond_clockwait(&condition, &mutex, CLOCK_MONOTONIC, &time));
  pthread_condattr_init(&attributes);
  pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
  pthread_cond_init(&monotonic, &attributes);
  time = at_us(CLOCK_MONOTONIC, 4000);
  say("cond_monotonic", pthread_cond_timedwait(&monotonic, &mutex, &time));
  pthread_mutex_unlock(&mutex);
  sem_init(&semaphore, 0, 0);
  time = at_us(CLOCK_REALTIME, 4000);
  say("sem_timedwait", sem_timedwait(&semaphore, &time));
  pthread_create(&thread, NULL, hold_mutex, NULL);
  usleep(1000);
  time = at_us(CLOCK_REALTIME, 4000);
  say("mutex_timedlock", pthread_mutex_timedlock(&mutex, &time));
  pthread_mutex_lock(&mutex);
  say("mutex_lock", 0);
  pthread_mutex_unlock(&mutex);
  say("join", pthread_join(thread, NULL));
}

static int turn = 0;
static void* ping_pong(void* own) {
  for (int i = 0; i < 3; ++i) {
    pthread_mutex_lock(&mutex);
    while (turn != (int)(intptr_t)own) pthread_cond_wait(&condition, &mutex);
    say(own ? "pong" : "ping", i);
    usleep(1000);
    turn = !turn;
    pthread_cond_broadcast(&condition);
    pthread_mutex_unlock(&mutex);
  }
  return own;
}

static pthread_barrier_t barrier;
static pthread_mutex_t inheriting;
static void* by_order(void* own) {
  pthread_barrier_wait(&barrier);
  for (int i = 0; i < 2; ++i) {
    pthread_mutex_lock(&inheriting);
    say("thread", (long)(intptr_t)own);
    usleep(100);
    pthread_mutex_unlock(&inheriting);
    sched_yield();
  }
  return own;
}

static void threads(void) {
  pthread_t first, second, some[4];
  void* result = NULL;
  pthread_create(&first, NULL, ping_pong, (void*)0);
  pthread_create(&second, NULL, ping_pong, (void*)1);
  pthread_join(first, NULL);
  pthread_join(second, &result);
  say("joined", (long)(intptr_t)result);
  pthread_mutexattr_t attributes;
  pthread_mutexattr_init(&attributes);
  pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
  pthread_mutex_init(&inheriting, &attributes);
  pthread_barrier_init(&barrier, NULL, 4);
  for (intptr_t i = 0; i < 4; ++i) pthread_create(&some[i], NULL, by_order, (void*)i);
  for (int i = 0; i < 4; ++i) pthread_join(some[i], NULL);
  say("all", 4);
}

/* More than 8 heaps of the C library: it then asks for the number of processors, in the thread that is new. */
static void* use_heap(void* number) {
  const struct timespec time = {0, 1000000};
  for (int i = 0; i < 3; ++i) {
    free(malloc(100));
    nanosleep(&time, NULL);
  }
  return number;
}
static void many(void) {
  pthread_t some[40];
  for (intptr_t i = 0; i < 40; ++i) pthread_create(&some[i], NULL, use_heap, (void*)i);
  for (int i = 0; i < 40; ++i) pthread_join(some[i], NULL);
  say("joined", 40);
}

static volatile int alarms = 0;
static void on_alarm(int number) {
  (void)number;
  ++alarms;
}
static void* pause_thread(void* unused) {
  const struct timespec time = {10, 0};
  struct timespec left = {0, 0};
  say("interrupted", nanosleep(&time, &left));
  say("left_ms", left.tv_sec * 1000 + left.tv_nsec / 1000000);
  return unused;
}

static void signals(void) {
  struct sigaction action = {.sa_handler = on_alarm};
  struct itimerval interval = {.it_value = {0, 5000}, .it_interval = {0, 3000}};
  sigset_t set, open_set;
  pthread_t thread;
  timer_t timer;
  sigfillset(&action.sa_mask);
  sigaction(SIGALRM, &action, NULL);
  sigaction(SIGUSR1, &action, NULL);
  setitimer(ITIMER_REAL, &interval, NULL);
  say("pause", pause());
  say("sleep", usleep(100000));
  say("alarms", alarms);
  getitimer(ITIMER_REAL, &interval);
  say("interval", interval.it_interval.tv_usec);
  interval = (struct itimerval){{0, 0}, {0, 0}};
  setitimer(ITIMER_REAL, &interval, NULL);
  alarm(2);
  say("alarm", sleep(10));
  /* A signal that only the wait lets through. */
  sigfillset(&set);
  sigprocmask(SIG_BLOCK, &set, &open_set);
  alarms = 0;
  timer_create(CLOCK_MONOTONIC, NULL, &timer);
  const struct itimerspec value = {.it_value = in_us(4000)};
  timer_settime(timer, 0, &value, NULL);
  say("blocked", usleep(10000));
  say("alarms", alarms);
  say("ppoll", ppoll(NULL, 0, NULL, &open_set));
  say("alarms", alarms);
  timer_settime(timer, 0, &value, NULL);
  say("sigsuspend", sigsuspend(&open_set));
  timer_settime(timer, 0, &value, NULL);
  sigemptyset(&set);
  sigaddset(&set, SIGALRM);
  int number = 0;
  say("sigwait", sigwait(&set, &number));
  say("signal", number == SIGALRM);
  say("sigtimedwait", sigtimedwait(&set, NULL, &(struct timespec){0, 2000000}));
  sigprocmask(SIG_SETMASK, &open_set, NULL);
  pthread_create(&thread, NULL, pause_thread, NULL);
  usleep(5000);
  pthread_kill(thread, SIGUSR1);
  say("join", pthread_join(thread, NULL));
  pthread_create(&thread, NULL, pause_thread, NULL);
  usleep(1000);
  pthread_cancel(thread);
  say("cancelled", pthread_join(thread, NULL));
}

static void random_numbers(void) {
  uint32_t number = 0;
  getrandom(&number, sizeof number, 0);
  say("random", number);
  say("address", (long)(intptr_t)malloc(10));
  say("code", (long)(intptr_t)&random_numbers);
}

static int sleep_in_thread(void* result) {
  usleep(1000);
  say("slept", 1);
  return (int)(intptr_t)result;
}
static void c11_thread(void) {
  thrd_t thread;
  int result = 0;
  thrd_create(&thread, sleep_in_thread, (void*)7);
  thrd_join(thread, &result);
  say("result", result);
}

/* ------------------------------------------------------------------------------------------------------- refused */
static void forks(void) { say("fork", fork()); }
static void spawns(void) { say("system", system("true")); }
static void replaces(void) { execl("/bin/true", "true", NULL); }
static void reads_cycles(void) { say("cycles", (long)__rdtsc()); }
static void spins_on_clock(void) {
  while (us_of(CLOCK_MONOTONIC) < 1000) {
  }
}
static void spins_on_port(void) {
  const int port = open_port(O_NONBLOCK);
  char byte;
  while (read(port, &byte, 1) != 1) {
  }
}
static void spins_on_poll(void) {
  struct pollfd one = {open_port(0), POLLIN, 0};
  while (poll(&one, 1, 0) == 0) {
  }
}
static volatile int flag = 0;
static void spins_on_flag(void) {
  while (!flag) {
  }
}
static void on_timer(union sigval value) { (void)value; }
static void timer_thread(void) {
  struct sigevent event = {.sigev_notify = SIGEV_THREAD, .sigev_notify_function = on_timer};
  timer_t timer;
  timer_create(CLOCK_MONOTONIC, &event, &timer);
  sleep(1);
}
static void profiles(void) {
  const struct itimerval value = {{0, 1000}, {0, 1000}};
  setitimer(ITIMER_PROF, &value, NULL);
}
static void edits_lines(void) {
  struct termios settings;
  const int port = open_port(0);
  tcgetattr(port, &settings);
  settings.c_lflag |= ICANON;
  tcsetattr(port, TCSANOW, &settings);
}
static void uses_ring(void) {
  struct io_uring_params parameters = {0};
  syscall(SYS_io_uring_setup, 4, &parameters);
}
static void opens_queue(void) { mq_open("/tiltproof-waiting", O_RDONLY | O_CREAT, 0600, NULL); }
static void waits_for_message(void) {
  struct {
    long type;
    char text[8];
  } message;
  msgrcv(msgget(IPC_PRIVATE, 0600), &message, sizeof message.text, 0, 0);
}
static void sets_clock(void) {
  const struct timespec time = {.tv_sec = 1};
  clock_settime(CLOCK_REALTIME, &time);
}
static void crashes(void) { *(volatile int*)16 = 1; }
static void exits(void) {
  const int port = open_port(0);
  if (write(port, "x", 1) != 1) exit(6);
  usleep(1000);
  exit(5);
}

static const struct {
  const char* name;
  void (*run)(void);
} cases[] = {{"clocks", clocks},
             {"sleeps", sleeps},
             {"polls", polls},
             {"ports", ports},
             {"timers", timers},
             {"locks", locks},
             {"threads", threads},
             {"many", many},
             {"signals", signals},
             {"random", random_numbers},
             {"fork", forks},
             {"system", spawns},
             {"exec", replaces},
             {"rdtsc", reads_cycles},
             {"spin_clock", spins_on_clock},
             {"spin_port", spins_on_port},
             {"spin_poll", spins_on_poll},
             {"spin_flag", spins_on_flag},
             {"c11", c11_thread},
             {"timer_thread", timer_thread},
             {"profile", profiles},
             {"icanon", edits_lines},
             {"io_uring", uses_ring},
             {"mq_open", opens_queue},
             {"msgrcv", waits_for_message},
             {"clock_settime", sets_clock},
             {"crash", crashes},
             {"exit", exits}};

int main(int count, char** words) {
  if (count < 4) return 2;
  port_path = words[2];
  reference_path = words[3];
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i)
    if (strcmp(cases[i].name, words[1]) == 0) cases[i].run();
  return 0;
}
