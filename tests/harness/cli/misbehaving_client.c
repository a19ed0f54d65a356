/* Firmware that does what firmware must not, 0.3 s after power-on: which, is the name of the build it is
 * asked to be. One that begins with "destroy_" does it at its end. MISBEHAVE_AT_LOAD names what it does while it is
 * loaded. */
#define _GNU_SOURCE
#undef NDEBUG
#include <assert.h>
#include <fenv.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "firmware/tiltproof_client.h"

/* Of misbehaving_throw.cpp. */
void throw_exception(void);
void throw_escapes(void);

#define PERIOD_NS 12000000

struct TiltproofClient {
  const TiltproofHost* host;
  int64_t next_request_ns;
  int misbehaved_in_thread;
};

static void misbehave(const char* how);

__attribute__((constructor)) static void at_load(void) {
  const char* how = getenv("MISBEHAVE_AT_LOAD");
  if (how != NULL) misbehave(how);
}

/* 7E, the float id, values, Fletcher-16, 7E: start (1), read sensors (2) and actuators (3) of the paper's dialect. These
 * hold the vehicle of the paper: 10.271 N, 10.280 N, 0 N m, 0 N m. */
static const uint8_t kStart[] = {0x7E, 0x00, 0x00, 0x80, 0x3F, 0xBF, 0x40, 0x7E};
static const uint8_t kRead[] = {0x7E, 0x00, 0x00, 0x00, 0x40, 0x40, 0x40, 0x7E};
static const uint8_t kHold[] = {0x7E, 0x00, 0x00, 0x40, 0x40, 0xBE, 0x56, 0x24, 0x41, 0x4C, 0x7C, 0x24,
                                0x41, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x29, 0xAF, 0x7E};

/* No messages: of id 5, of three values, and of a value that is no number. */
static const uint8_t kWrongId[] = {0x7E, 0x00, 0x00, 0xA0, 0x40, 0xBE, 0x56, 0x24, 0x41, 0x4C, 0x7C, 0x24,
                                   0x41, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x89, 0x76, 0x7E};
static const uint8_t kShort[] = {0x7E, 0x00, 0x00, 0x40, 0x40, 0xBE, 0x56, 0x24, 0x41, 0x4C,
                                 0x7C, 0x24, 0x41, 0x00, 0x00, 0x00, 0x00, 0x29, 0x0B, 0x7E};
static const uint8_t kNan[] = {0x7E, 0x00, 0x00, 0x40, 0x40, 0x00, 0x00, 0xC0, 0x7F, 0x4C, 0x7C, 0x24,
                               0x41, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xEE, 0x6E, 0x7E};

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  TiltproofClient* client = calloc(1, sizeof *client);
  if (client != NULL) client->host = host;
  return client;
}

static int at_end(const TiltproofClient* client) {
  return strncmp(client->host->firmware, "destroy_", 8) == 0;
}

void tiltproof_client_destroy(TiltproofClient* client) {
  client->host->log(client->host->context, 0, "too late for the log");
  if (at_end(client)) misbehave(client->host->firmware + 8);
  free(client);
}

static void block_signals(void) {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, NULL);
}

/* Writes behind its buffer, which has a guard there. */
static void* (*volatile const fill)(void*, int, size_t) = memset;
__attribute__((noinline)) static void smash(void) {
  char buffer[8];
  fill(buffer, 1, 24);
}

__attribute__((noinline)) static int descend(int count) {
  volatile char frame[256];
  frame[count & 255] = (char)count;
  return count == 0 ? 0 : descend(count - 1) + frame[0];
}

static void* crash_in_thread(void* nowhere) {
  *(volatile int*)nowhere = 1;
  return NULL;
}

static volatile int transmitted_in_thread;
static void* transmit_in_thread(void* client) {
  const TiltproofHost* host = ((const TiltproofClient*)client)->host;
  for (volatile int forever = 1; forever; transmitted_in_thread = 1)
    host->transmit(host->context, TILTPROOF_UART_MAIN, 0, kRead, sizeof kRead);
  return NULL;
}

static void lower(int limit) {
  struct rlimit lower = {0, 0};
  setrlimit(limit, &lower);
}

static void misbehave(const char* how) {
  if (strcmp(how, "thread") == 0) {
    pthread_t threads[8];
    for (int i = 0; i < 8; ++i) pthread_create(&threads[i], NULL, crash_in_thread, NULL);
    pthread_join(threads[0], NULL);
  }
  if (strcmp(how, "crash") == 0) {
    volatile int* nowhere = NULL;
    *nowhere = 1;
  }
  if (strcmp(how, "recursion") == 0) descend(1000000000);
  if (strcmp(how, "hang_blocked") == 0 || strcmp(how, "asleep_blocked") == 0) block_signals();
  if (strcmp(how, "hang") == 0 || strcmp(how, "hang_blocked") == 0)
    for (volatile int forever = 1; forever;) {
    }
  if (strcmp(how, "asleep") == 0 || strcmp(how, "asleep_blocked") == 0)
    for (volatile int forever = 1; forever;) pause();
  if (strcmp(how, "abort") == 0) abort();
  if (strcmp(how, "assertion") == 0) assert(how == NULL);
  if (strcmp(how, "smash") == 0) smash();
  if (strcmp(how, "free_twice") == 0) {
    void* volatile memory = malloc(64);
    free(memory);
    free(memory);
  }
  if (strcmp(how, "exit") == 0) exit(3);
  if (strcmp(how, "quick_exit") == 0) quick_exit(3);
  if (strcmp(how, "underscore_exit") == 0) _exit(0);
  if (strcmp(how, "raw_exit") == 0) syscall(SYS_exit_group, 0);
  if (strcmp(how, "exec") == 0) execlp("true", "true", (char*)NULL);
  if (strcmp(how, "raw_exec") == 0) {
    char* arguments[] = {"true", NULL};
    syscall(SYS_execve, "/bin/true", arguments, environ);
  }
  if (strcmp(how, "pthread_exit") == 0) pthread_exit(NULL);
  if (strcmp(how, "throw") == 0) throw_exception();
  if (strcmp(how, "throw_escapes") == 0) throw_escapes();
  if (strcmp(how, "stop") == 0) raise(SIGSTOP);
  if (strcmp(how, "stop_forever") == 0)
    for (;;) raise(SIGSTOP);
  if (strcmp(how, "raise_term") == 0) raise(SIGTERM);
  if (strcmp(how, "kill_int") == 0) kill(getpid(), SIGINT);
  if (strcmp(how, "kill_hup") == 0) kill(0, SIGHUP);
  if (strcmp(how, "kill_kill") == 0) kill(getpid(), SIGKILL);
  if (strcmp(how, "lower_files") == 0) lower(RLIMIT_NOFILE);
  if (strcmp(how, "lower_size") == 0) lower(RLIMIT_FSIZE);
  if (strcmp(how, "fork") == 0) fork();
  /* The copy flies on while the original waits, and is gone. The C library knows of no fork. */
  if (strcmp(how, "copy") == 0) {
    long copy = syscall(SYS_clone, SIGCHLD, 0, 0, 0, 0);
    if (copy > 0) {
      waitpid((pid_t)copy, NULL, 0);
      syscall(SYS_exit_group, 0);
    }
  }
  if (strcmp(how, "close_all") == 0)
    for (int descriptor = 3; descriptor < 256; ++descriptor) close(descriptor);
  /* It goes on after its flight, in a session of its own. */
  if (strcmp(how, "leave_child") == 0 && fork() == 0 && setsid() > 0)
    for (;;) pause();
  if (strcmp(how, "round") == 0) fesetround(FE_UPWARD);
  if (strcmp(how, "chatter") == 0) {
    puts("chatter-on-stdout");
    fputs("chatter-on-stderr\r\n\033[2J", stderr);
  }
}

static int is(const TiltproofClient* client, const char* build) {
  return strcmp(client->host->firmware, build) == 0;
}

/* Holds the vehicle, or not. Returns when the last bit has left. */
static int64_t command(const TiltproofClient* client, int64_t now_ns) {
  const TiltproofHost* host = client->host;
  const uint8_t* frame = kHold;
  size_t size = sizeof kHold;
  if (is(client, "starts_only") || is(client, "asks_only")) return now_ns;
  if (now_ns > 300000000 && (is(client, "mute") || is(client, "silent"))) return now_ns;
  if (is(client, "wrong_id")) frame = kWrongId, size = sizeof kWrongId;
  if (is(client, "short")) frame = kShort, size = sizeof kShort;
  if (is(client, "not_a_number")) frame = kNan, size = sizeof kNan;
  return host->transmit(host->context, TILTPROOF_UART_MAIN, now_ns, frame, size);
}

int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  if (now_ns > 300000000 && !at_end(client) && !client->misbehaved_in_thread) {
    misbehave(client->host->firmware);
    if (is(client, "thread_transmits")) {
      pthread_t thread;
      client->misbehaved_in_thread = pthread_create(&thread, NULL, transmit_in_thread, client) == 0;
      while (!transmitted_in_thread) {
      }
    }
  }
  if (now_ns >= client->next_request_ns) {
    const int64_t sent_ns = command(client, now_ns);
    if (!is(client, "starts_only") && !(now_ns > 300000000 && is(client, "silent")))
      client->host->transmit(client->host->context, TILTPROOF_UART_MAIN, sent_ns, kRead, sizeof kRead);
    client->next_request_ns += PERIOD_NS;
  }
  if (now_ns > 300000000 && is(client, "nanoseconds")) return now_ns + 1;
  return client->next_request_ns;
}

int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  client->next_request_ns =
      client->host->transmit(client->host->context, TILTPROOF_UART_MAIN, now_ns, kStart, sizeof kStart);
  return client->next_request_ns;
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  (void)client, (void)uart, (void)now_ns, (void)bytes, (void)count;
}

int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  return tiltproof_client_start(client, now_ns);
}
