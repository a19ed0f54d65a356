/* A firmware as a program of its own, the way a user would bring one: it opens its serial ports by POSIX
 * termios, keeps time by the machine's clock, and flies the firmware of a library
 * (firmware/tiltproof_client.h) through them. It knows nothing else of tiltproof.
 *
 *   pty_firmware LIBRARY [PORT [REFERENCE_PORT [LINE_PORT]]] [--exit-after S] [--grandchild] [--garbage] [--adapter MS]
 *
 * A port is a path, or fd:N for the master of a pseudo-terminal that the caller holds (this is then the board
 * behind a cable). Without: TILTPROOF_PORT and TILTPROOF_REFERENCE_PORT. LINE_PORT is that of a line to another board.
 *   --exit-after S  S seconds after its start it says why and exits with code 3
 *   --grandchild    starts a process that would live for ever
 *   --garbage       prints bytes that are no text
 *   --adapter MS    what it sends arrives MS milliseconds later, as behind an adapter that buffers
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "firmware/tiltproof_client.h"

enum { kPortsCount = 3 };
static int ports[kPortsCount] = {-1, -1, -1};
static int64_t transmitter_free_ns;
static int64_t byte_time_ns;

/* What the adapter holds, in order. */
static struct {
  int uart;
  int64_t until_ns;
  size_t count;
  uint8_t bytes[256];
} held[16];
static size_t held_first, held_count;
static int64_t adapter_ns;

static int64_t MonotonicNs(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void GiveUp(const char* what, const char* name) {
  fprintf(stderr, "pty_firmware: %s %s: %s\n", what, name, strerror(errno));
  exit(1);
}

static int OpenPort(const char* name) {
  if (strncmp(name, "fd:", 3) == 0) return atoi(name + 3);
  const int port = open(name, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  struct termios settings;
  if (port < 0 || tcgetattr(port, &settings) != 0) GiveUp("cannot open", name);
  cfmakeraw(&settings);
  cfsetspeed(&settings, B921600);
  if (tcsetattr(port, TCSANOW, &settings) != 0) GiveUp("cannot set up", name);
  return port;
}

static void Write(int uart, const uint8_t* bytes, size_t count) {
  const uint8_t* rest = bytes;
  for (size_t left = count; left > 0;) {
    const ssize_t written = write(ports[uart], rest, left);
    if (written < 0 && errno != EAGAIN && errno != EINTR) break;
    if (written <= 0) continue;
    rest += written;
    left -= (size_t)written;
  }
}

/* When the next bytes leave the adapter. */
static int64_t LetGo(int64_t now_ns) {
  for (; held_count > 0; --held_count, held_first = (held_first + 1) % 16) {
    if (held[held_first].until_ns > now_ns) return held[held_first].until_ns;
    Write(held[held_first].uart, held[held_first].bytes, held[held_first].count);
  }
  return TILTPROOF_NEVER;
}

static int64_t Transmit(void* context, int uart, int64_t now_ns, const uint8_t* bytes, size_t count) {
  (void)context;
  if (adapter_ns == 0) {
    Write(uart, bytes, count);
  } else if (held_count < 16 && count <= sizeof held[0].bytes) {
    const size_t last = (held_first + held_count++) % 16;
    held[last].uart = uart;
    held[last].until_ns = now_ns + adapter_ns;
    held[last].count = count;
    memcpy(held[last].bytes, bytes, count);
  }
  if (transmitter_free_ns < now_ns) transmitter_free_ns = now_ns;
  transmitter_free_ns += (int64_t)count * byte_time_ns;
  return transmitter_free_ns;
}

static void Log(void* context, int64_t now_ns, const char* text) {
  (void)context;
  printf("%.3f %s\n", (double)now_ns * 1e-9, text);
  fflush(stdout);
}

static void* Symbol(void* library, const char* name) {
  void* symbol = dlsym(library, name);
  if (symbol == NULL) {
    fprintf(stderr, "pty_firmware: %s\n", dlerror());
    exit(1);
  }
  return symbol;
}

static const char* Environment(const char* name, const char* otherwise) {
  const char* value = getenv(name);
  return value != NULL ? value : otherwise;
}

int main(int argc, char** argv) {
  const char* names[1 + kPortsCount] = {NULL, Environment("TILTPROOF_PORT", NULL),
                                        Environment("TILTPROOF_REFERENCE_PORT", NULL), NULL};
  int64_t exit_after_ns = TILTPROOF_NEVER;
  int named = 0;
  for (int i = 1; i < argc; ++i) {
    if (strcmp(argv[i], "--exit-after") == 0 && i + 1 < argc) {
      exit_after_ns = (int64_t)(atof(argv[++i]) * 1e9);
    } else if (strcmp(argv[i], "--grandchild") == 0) {
      if (fork() == 0) {
        for (;;) pause();
      }
    } else if (strcmp(argv[i], "--garbage") == 0) {
      static const unsigned char kGarbage[] = {0xff, 0xfe, 0x00, 0x1b, '[', '2',  'J', 0xc3,
                                               0x28, 0x80, '"',  '<',  '&', '\\', 7,   '\n'};
      fwrite(kGarbage, 1, sizeof kGarbage, stdout);
      for (int line = 0; line < 20000; ++line) putchar(0x80 + line % 0x80);
      fflush(stdout);
    } else if (strcmp(argv[i], "--adapter") == 0 && i + 1 < argc) {
      adapter_ns = (int64_t)(atof(argv[++i]) * 1e6);
    } else if (named < 1 + kPortsCount) {
      names[named++] = argv[i];
    }
  }
  if (names[0] == NULL || names[1] == NULL) {
    fprintf(stderr, "usage: pty_firmware LIBRARY [PORT [REFERENCE_PORT [LINE_PORT]]]\n");
    return 2;
  }
  // Punctual where that is permitted.
  const struct sched_param priority = {.sched_priority = 10};
  sched_setscheduler(0, SCHED_FIFO, &priority);

  void* library = dlopen(names[0], RTLD_NOW);
  if (library == NULL) {
    fprintf(stderr, "pty_firmware: %s\n", dlerror());
    return 1;
  }
  TiltproofClient* (*create)(const TiltproofHost*);
  int64_t (*start)(TiltproofClient*, int64_t);
  void (*receive)(TiltproofClient*, int, int64_t, const uint8_t*, size_t);
  int64_t (*grant)(TiltproofClient*, int64_t);
  *(void**)&create = Symbol(library, "tiltproof_client_create");
  *(void**)&start = Symbol(library, "tiltproof_client_start");
  *(void**)&receive = Symbol(library, "tiltproof_client_receive");
  *(void**)&grant = Symbol(library, "tiltproof_client_grant");

  byte_time_ns = 10 * INT64_C(1000000000) / atoi(Environment("TILTPROOF_BAUD", "921600"));
  for (int uart = 0; uart < kPortsCount && names[uart + 1] != NULL; ++uart)
    ports[uart] = OpenPort(names[uart + 1]);
  const TiltproofHost host = {.abi_version = TILTPROOF_CLIENT_ABI_VERSION,
                              .firmware = Environment("TILTPROOF_FIRMWARE", "paper"),
                              .dialect = Environment("TILTPROOF_DIALECT", "paper"),
                              .transmit = Transmit,
                              .log = Log,
                              .parameters = Environment("TILTPROOF_PARAMETERS", NULL)};
  TiltproofClient* client = create(&host);
  if (client == NULL) return 1;
  printf("pty_firmware: up\n");
  fflush(stdout);

  const int64_t power_on_ns = MonotonicNs();
  int64_t wake_ns = start(client, 0);
  for (;;) {
    int64_t now_ns = MonotonicNs() - power_on_ns;
    if (now_ns >= exit_after_ns) {
      printf("pty_firmware: the watchdog has bitten\n");
      fprintf(stderr, "pty_firmware: last words without end of line");
      exit(3);
    }
    const int64_t let_go_ns = LetGo(now_ns);
    if (now_ns < wake_ns) {
      int64_t until_ns = wake_ns < exit_after_ns ? wake_ns : exit_after_ns;
      if (let_go_ns < until_ns) until_ns = let_go_ns;
      const int64_t wait_ns = until_ns == TILTPROOF_NEVER ? 1000000000 : until_ns - now_ns;
      const struct timespec timeout = {.tv_sec = wait_ns / 1000000000, .tv_nsec = wait_ns % 1000000000};
      struct pollfd polled[kPortsCount];
      for (int uart = 0; uart < kPortsCount; ++uart)
        polled[uart] = (struct pollfd){.fd = ports[uart], .events = POLLIN};
      ppoll(polled, kPortsCount, &timeout, NULL);
      now_ns = MonotonicNs() - power_on_ns;
      for (int uart = 0; uart < kPortsCount; ++uart) {
        if (polled[uart].revents == 0) continue;
        uint8_t bytes[4096];
        const ssize_t got = read(ports[uart], bytes, sizeof bytes);
        if (got > 0) receive(client, uart, now_ns, bytes, (size_t)got);
        // The harness is gone, and the cable with it.
        if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) return 0;
      }
    }
    wake_ns = grant(client, now_ns);
  }
}
