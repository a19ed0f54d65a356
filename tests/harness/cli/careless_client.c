/* A firmware whose reader of frames has one defect; which, is the name of the build it is asked to be. It asks once a
 * period, and answers each reply of 64 bytes with a checksum that is right.
 *
 * careful: none. careless: a long frame overwrites what lies behind its buffer, a guard that is
 * checked: whatever else it would meet may be another thing in each process. deaf: an escape
 * before the closing flag leaves it waiting for ever. absurd: what it is told becomes what it commands, in each field. restless: a
 * payload of two bytes makes it start again. loop: a frame of nothing but zeros is never finished. broken: it needs no
 * hostile byte. secret: a message whose first two bytes are a certain word ends it; each byte is compared by itself.
 * overrun: a long frame overruns a block of the heap; the C library notices it when the harness next asks for memory.
 * twofold: short and long frames let it write to address 8 and 16.
 * hasty: after a short frame it wants to be woken at once, again and again.
 * leaves: after a short frame it cannot be destroyed.
 * raises: after a short frame it sends its process SIGKILL. killed, terminated: it does so by a bare system call,
 * which the guard cannot see, and with SIGTERM.
 * slow: it boots for a second. smashed: a long frame is copied to the stack, which a guard of the compiler's notices. */
#define _GNU_SOURCE
#include <malloc.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "firmware/tiltproof_client.h"

#define PERIOD_NS 12000000

typedef struct {
  uint8_t bytes[80];
  uint32_t guard;
} Reader;

struct TiltproofClient {
  Reader reader;
  size_t count;
  int escaped, deaf, hasty, leaves, starts;
  const TiltproofHost* host;
  int64_t now_ns, next_request_ns, sent_until_ns;
};

static const uint32_t kGuard = 0x600D600D;

/* Start, read sensors, and actuators that hold the vehicle: 7E, the float id, the values, Fletcher-16, 7E. */
static const uint8_t kStart[] = {0x7E, 0x00, 0x00, 0x80, 0x3F, 0xBF, 0x40, 0x7E};
static const uint8_t kRead[] = {0x7E, 0x00, 0x00, 0x00, 0x40, 0x40, 0x40, 0x7E};

static int is(const TiltproofClient* client, const char* build) {
  return strcmp(client->host->firmware, build) == 0;
}

static unsigned check_of(const uint8_t* bytes, size_t count) {
  unsigned sum1 = 0, sum2 = 0;
  for (size_t i = 0; i < count; ++i) {
    sum1 = (sum1 + bytes[i]) % 255;
    sum2 = (sum2 + sum1) % 255;
  }
  return sum1 | sum2 << 8;
}

static void say(TiltproofClient* client, const uint8_t* bytes, size_t count) {
  const int64_t at_ns = client->now_ns > client->sent_until_ns ? client->now_ns : client->sent_until_ns;
  client->sent_until_ns =
      client->host->transmit(client->host->context, TILTPROOF_UART_MAIN, at_ns, bytes, count);
}

/* `more` is added to the command that holds the vehicle. */
static void command(TiltproofClient* client, const float more[4]) {
  const float values[5] = {3.F, 10.F + more[0], 10.F + more[1], more[2], more[3]};
  uint8_t payload[22], frame[48], *out = frame;
  memcpy(payload, values, 20);
  const unsigned check = check_of(payload, 20);
  payload[20] = (uint8_t)check;
  payload[21] = (uint8_t)(check >> 8);
  *out++ = 0x7E;
  for (size_t i = 0; i < sizeof payload; ++i) {
    const int escape = payload[i] == 0x7E || payload[i] == 0x7D;
    if (escape) *out++ = 0x7D;
    *out++ = escape ? payload[i] ^ 0x20 : payload[i];
  }
  *out++ = 0x7E;
  say(client, frame, (size_t)(out - frame));
}

/* Who knows only that it goes on has 2^16 words to try. */
static void check_word(const uint8_t* bytes) {
  if (bytes[0] != 0x4B) return;
  if (bytes[1] == 0xA7) abort();
}

__attribute__((noinline)) static void copy_frame(const uint8_t* bytes, size_t count) {
  uint8_t copy[40];
  for (size_t i = 0; i < count; ++i) ((volatile uint8_t*)copy)[i] = bytes[i];
}

/* Where nothing is: the compiler does not know. */
static volatile uint8_t* volatile nowhere = (volatile uint8_t*)16;
__attribute__((noinline)) static void crash_elsewhere(const uint8_t* bytes) { *nowhere = bytes[0]; }

/* It is the last block of the heap, so that the size of all that is free stands behind it. */
static void overrun_block(void) {
  uint8_t* block = malloc(100000);
  if (block != NULL) memset(block + malloc_usable_size(block), 0xFF, 8);
}

static void on_frame(TiltproofClient* client) {
  const uint8_t* bytes = client->reader.bytes;
  if (client->count < 3) return;
  const size_t size = client->count - 2;
  if (size > sizeof client->reader.bytes) return;
  if (check_of(bytes, size) != (unsigned)(bytes[size] | bytes[size + 1] << 8)) return;
  if (is(client, "restless") && size == 2) client->starts = 0;
  if (is(client, "loop")) {
    size_t zeros = 0;
    while (zeros < size && bytes[zeros] == 0) ++zeros;
    /* Asleep: its time passes all the same, and no processor is busy. */
    for (volatile int forever = zeros == size; forever;) pause();
  }
  if (is(client, "smashed") && size > 64 && size <= 76) copy_frame(bytes, size);
  if (is(client, "hasty") && size < 10) client->hasty = 1;
  if (is(client, "leaves") && size < 10) client->leaves = 1;
  if (is(client, "raises") && size < 10) kill(getpid(), SIGKILL);
  if (is(client, "killed") && size < 10) syscall(SYS_kill, getpid(), SIGKILL);
  if (is(client, "terminated") && size < 10) syscall(SYS_kill, getpid(), SIGTERM);
  if (is(client, "twofold") && size < 10) *nowhere = 1;
  if (is(client, "twofold") && size > 64) crash_elsewhere(bytes);
  if (is(client, "overrun") && size > 64) overrun_block();
  if (is(client, "secret")) check_word(bytes);
  if (size != 64) return;
  float more[4] = {0};
  if (is(client, "absurd")) memcpy(more, bytes, sizeof more);
  command(client, more);
}

static void take(TiltproofClient* client, uint8_t byte) {
  Reader* reader = &client->reader;
  if (reader->guard != kGuard) abort();
  if (byte == 0x7E) {
    if (is(client, "deaf") && client->escaped) client->deaf = 1;
    if (client->count > 0 && !client->escaped && !client->deaf) on_frame(client);
    client->count = 0;
    client->escaped = 0;
    return;
  }
  if (byte == 0x7D) {
    client->escaped = 1;
    return;
  }
  const size_t limit = is(client, "careless") ? sizeof *reader : sizeof reader->bytes;
  const uint8_t plain = client->escaped ? byte ^ 0x20 : byte;
  client->escaped = 0;
  if (client->count >= limit) return;
  memcpy((uint8_t*)reader + client->count++, &plain, 1);
}

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  TiltproofClient* client = calloc(1, sizeof *client);
  if (client == NULL) return NULL;
  client->host = host;
  client->reader.guard = kGuard;
  return client;
}

void tiltproof_client_destroy(TiltproofClient* client) {
  if (client->leaves) abort();
  free(client);
}

int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  return tiltproof_client_grant(client, now_ns);
}

int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  client->now_ns = now_ns;
  if (is(client, "slow") && now_ns < 1000000000) return 1000000000;
  if (client->hasty) return now_ns;
  if (now_ns < client->next_request_ns) return client->next_request_ns;
  if (client->starts == 0) say(client, kStart, sizeof kStart);
  client->starts = 1;
  if (is(client, "broken") && now_ns > 200000000) abort();
  say(client, kRead, sizeof kRead);
  client->next_request_ns = now_ns + PERIOD_NS;
  return client->next_request_ns;
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  client->now_ns = now_ns;
  for (size_t i = 0; i < count && uart == TILTPROOF_UART_MAIN; ++i) take(client, bytes[i]);
}

int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  client->starts = 0;
  client->next_request_ns = now_ns;
  return tiltproof_client_grant(client, now_ns);
}
