/* A firmware that is a program of its own and flies in lockstep (`--client 'program:CMD'`), for C and C++.
 *
 * It needs the C library and nothing else. docs/program.md describes the protocol byte by byte, for other languages.
 * A firmware that has the functions of tiltproof_client.h becomes a program with one more file:
 *
 *   #include "firmware/tiltproof_client.h"
 *   #include "firmware/tiltproof_program.h"
 *
 *   int main(void) { return tiltproof_program_run(); }
 *
 * The same code then flies with the same bits as a library and as a program. Without these functions, a program has a
 * loop:
 *
 *   TiltproofProgram program;
 *   TiltproofEvent event;
 *   if (!tiltproof_program_open(&program)) return 1;
 *   tiltproof_program_ready(&program, 0);
 *   while (tiltproof_program_next(&program, &event) != TILTPROOF_PROGRAM_END) {
 *     if (event.kind == TILTPROOF_PROGRAM_BYTES) {
 *       tiltproof_program_transmit(&program, event.uart, event.now_ns, event.bytes, event.count);
 *     } else {
 *       tiltproof_program_wait(&program, TILTPROOF_PROGRAM_NEVER);
 *     }
 *   }
 *   tiltproof_program_close(&program);
 *
 * All times are nanoseconds of the program's own clock since power-on. The first grant is power-on, at time 0. The
 * program must never read the machine's clock, nor sleep: only then do two flights have the same bits.
 */
#ifndef TILTPROOF_PROGRAM_H
#define TILTPROOF_PROGRAM_H

#include <errno.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

/* C, also where C++ includes it. NOLINTBEGIN(modernize-use-nullptr,readability-identifier-naming,bugprone-*) */
#ifdef __cplusplus
extern "C" {
#endif

#define TILTPROOF_PROGRAM_VERSION 1u
#define TILTPROOF_PROGRAM_NEVER INT64_MAX /* "waiting for bytes only" */

enum {
  /* Kinds of messages to the program. */
  TILTPROOF_PROGRAM_HELLO = 1,
  TILTPROOF_PROGRAM_GRANT = 2,
  TILTPROOF_PROGRAM_BYTES = 3,
  TILTPROOF_PROGRAM_RESET = 4,
  TILTPROOF_PROGRAM_SENT = 5,
  TILTPROOF_PROGRAM_END = 6,
  TILTPROOF_PROGRAM_COMPUTED = 7,
  /* Kinds of messages from the program. */
  TILTPROOF_PROGRAM_READY = 0x81,
  TILTPROOF_PROGRAM_WAITING = 0x82,
  TILTPROOF_PROGRAM_TRANSMIT = 0x83,
  TILTPROOF_PROGRAM_STATUS = 0x84,
  TILTPROOF_PROGRAM_ROLE = 0x85,
  TILTPROOF_PROGRAM_LOG = 0x86,
  TILTPROOF_PROGRAM_REFUSED = 0x87,
  TILTPROOF_PROGRAM_COMPUTE = 0x88,
  /* Flags of ready. */
  TILTPROOF_PROGRAM_TELLS_STATUS = 1,
  TILTPROOF_PROGRAM_TELLS_ROLE = 2,
  /* Flag of grant and reset: the clock is wrong, so that only the harness can say when bytes have left. Flag of transmit:
   * a `sent` is wanted. */
  TILTPROOF_PROGRAM_ASK = 1,
  TILTPROOF_PROGRAM_HEADER_BYTES = 8,
  TILTPROOF_PROGRAM_BODY_BYTES_MAX = 1 << 20, /* of a message */
  TILTPROOF_PROGRAM_UARTS_MAX = 16
};

typedef struct {
  uint8_t* bytes;
  size_t size, capacity;
} TiltproofBuffer;

/* A transmitter: bytes go back to back. */
typedef struct {
  int64_t baud, character_bits; /* baud 0: bytes take no time */
  int64_t free_ns, busy_begin_ns, busy_bytes;
} TiltproofTransmitter;

typedef struct {
  int socket;
  uint32_t uart_count;
  const char* firmware;   /* the scenario's `firmware` key; "" if there is none */
  const char* dialect;    /* the protocol's name */
  const char* parameters; /* JSON, as in tiltproof_client.h */
  /* Internal. */
  TiltproofTransmitter uarts[TILTPROOF_PROGRAM_UARTS_MAX];
  char* strings;
  TiltproofBuffer in, out, event;
  size_t taken; /* of in.bytes */
  int64_t now_ns;
  int must_ask, lost, has_status, has_role, role;
  uint32_t supervisor_state, failsafe_count;
} TiltproofProgram;

typedef struct {
  int kind; /* TILTPROOF_PROGRAM_GRANT, _BYTES, _RESET or _END */
  int uart; /* of bytes */
  int64_t now_ns;
  const uint8_t* bytes; /* valid until the next call of tiltproof_program_next() */
  size_t count;
} TiltproofEvent;

/* -------------------------------------------------------------------------------------------------------- internal */

static inline uint32_t tiltproof_get_u32(const uint8_t* in) {
  return (uint32_t)in[0] | (uint32_t)in[1] << 8 | (uint32_t)in[2] << 16 | (uint32_t)in[3] << 24;
}
static inline int64_t tiltproof_get_i64(const uint8_t* in) {
  return (int64_t)((uint64_t)tiltproof_get_u32(in) | (uint64_t)tiltproof_get_u32(in + 4) << 32);
}
static inline void tiltproof_put_u32(uint8_t* out, uint32_t value) {
  for (int i = 0; i < 4; ++i) out[i] = (uint8_t)(value >> 8 * i);
}
static inline void tiltproof_put_i64(uint8_t* out, int64_t value) {
  tiltproof_put_u32(out, (uint32_t)(uint64_t)value);
  tiltproof_put_u32(out + 4, (uint32_t)((uint64_t)value >> 32));
}

/* Room for `count` more bytes behind those that are there. */
static inline uint8_t* tiltproof_room(TiltproofBuffer* buffer, size_t count) {
  if (buffer->capacity - buffer->size < count) {
    size_t capacity = buffer->capacity != 0 ? buffer->capacity : 4096;
    while (capacity - buffer->size < count) capacity *= 2;
    uint8_t* bytes = (uint8_t*)realloc(buffer->bytes, capacity);
    if (bytes == NULL) abort();
    buffer->bytes = bytes;
    buffer->capacity = capacity;
  }
  return buffer->bytes + buffer->size;
}

/* Appends a message without its data, and returns where the body begins. */
static inline uint8_t* tiltproof_message(TiltproofProgram* program, int kind, int number, int flags,
                                         size_t body) {
  uint8_t* out = tiltproof_room(&program->out, TILTPROOF_PROGRAM_HEADER_BYTES + body);
  memset(out, 0, TILTPROOF_PROGRAM_HEADER_BYTES);
  tiltproof_put_u32(out, (uint32_t)body);
  out[4] = (uint8_t)kind;
  out[5] = (uint8_t)number;
  out[6] = (uint8_t)flags;
  program->out.size += TILTPROOF_PROGRAM_HEADER_BYTES + body;
  return out + TILTPROOF_PROGRAM_HEADER_BYTES;
}

static inline void tiltproof_flush(TiltproofProgram* program) {
  size_t done = 0;
  while (done < program->out.size && !program->lost) {
    const ssize_t count =
        send(program->socket, program->out.bytes + done, program->out.size - done, MSG_NOSIGNAL);
    if (count > 0) done += (size_t)count;
    if (count < 0 && errno != EINTR) program->lost = 1;
  }
  program->out.size = 0;
}

/* Reads until a whole message is at `at` of in.bytes. 0: the harness is gone. */
static inline int tiltproof_await(TiltproofProgram* program, size_t at) {
  TiltproofBuffer* const in = &program->in;
  while (in->size < at + TILTPROOF_PROGRAM_HEADER_BYTES ||
         in->size - at - TILTPROOF_PROGRAM_HEADER_BYTES < tiltproof_get_u32(in->bytes + at)) {
    if (program->lost) return 0;
    uint8_t* const room = tiltproof_room(in, 4096);
    const ssize_t count = recv(program->socket, room, in->capacity - in->size, 0);
    if (count > 0) in->size += (size_t)count;
    if (count == 0 || (count < 0 && errno != EINTR)) program->lost = 1;
  }
  return 1;
}

static inline size_t tiltproof_whole(const uint8_t* message) {
  return TILTPROOF_PROGRAM_HEADER_BYTES + (size_t)tiltproof_get_u32(message);
}

/* The next message, from its header on; NULL: the harness is gone. */
static inline const uint8_t* tiltproof_read(TiltproofProgram* program) {
  TiltproofBuffer* const in = &program->in;
  if (program->taken == in->size) program->taken = in->size = 0;
  if (!tiltproof_await(program, program->taken)) return NULL;
  const uint8_t* const message = in->bytes + program->taken;
  program->taken += tiltproof_whole(message);
  return message;
}

/* The time in the answer to a question. It may come behind messages that were on their way: these are kept. */
static inline int64_t tiltproof_take_time(TiltproofProgram* program, int kind, int64_t otherwise_ns) {
  TiltproofBuffer* const in = &program->in;
  for (size_t at = program->taken; tiltproof_await(program, at); at += tiltproof_whole(in->bytes + at)) {
    if (in->bytes[at + 4] != kind) continue;
    const int64_t time_ns = tiltproof_get_i64(in->bytes + at + TILTPROOF_PROGRAM_HEADER_BYTES);
    const size_t end = at + tiltproof_whole(in->bytes + at);
    memmove(in->bytes + at, in->bytes + end, in->size - end);
    in->size -= end - at;
    return time_ns;
  }
  return otherwise_ns;
}

/* --------------------------------------------------------------------------------------------------------- the calls */

static inline void tiltproof_program_close(TiltproofProgram* program) {
  if (program->socket >= 0) close(program->socket);
  free(program->strings);
  free(program->in.bytes);
  free(program->out.bytes);
  free(program->event.bytes);
  memset(program, 0, sizeof *program);
  program->socket = -1;
}

/* Connects and reads who to be. 0: this is no flight (a message on standard error says why). */
static inline int tiltproof_program_open(TiltproofProgram* program) {
  memset(program, 0, sizeof *program);
  program->socket = -1;
  struct sockaddr_un address;
  memset(&address, 0, sizeof address);
  address.sun_family = AF_UNIX;
  const char* const path = getenv("TILTPROOF_SOCKET");
  if (path == NULL || strlen(path) >= sizeof address.sun_path) {
    fprintf(stderr,
            "no TILTPROOF_SOCKET: fly this program with `tiltproof run ... --client 'program:CMD'`\n");
    return 0;
  }
  memcpy(address.sun_path, path, strlen(path));
  program->socket = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (program->socket < 0 || connect(program->socket, (struct sockaddr*)&address, sizeof address) != 0) {
    fprintf(stderr, "cannot connect to %s: %s\n", path, strerror(errno));
    tiltproof_program_close(program);
    return 0;
  }
  /* A line that is printed before a crash is kept. */
  setvbuf(stdout, NULL, _IOLBF, 0);
  const uint8_t* const hello = tiltproof_read(program);
  const size_t size = hello == NULL ? 0 : tiltproof_get_u32(hello);
  if (hello == NULL || hello[4] != TILTPROOF_PROGRAM_HELLO || size < 8 ||
      tiltproof_get_u32(hello + TILTPROOF_PROGRAM_HEADER_BYTES) < TILTPROOF_PROGRAM_VERSION) {
    fprintf(stderr, "this tiltproof does not speak version %u of the protocol\n", TILTPROOF_PROGRAM_VERSION);
    tiltproof_program_close(program);
    return 0;
  }
  const uint8_t* at = hello + TILTPROOF_PROGRAM_HEADER_BYTES + 4;
  program->uart_count = tiltproof_get_u32(at);
  at += 4;
  for (uint32_t i = 0; i < program->uart_count; ++i, at += 8) {
    if (i >= TILTPROOF_PROGRAM_UARTS_MAX) continue;
    program->uarts[i].baud = tiltproof_get_u32(at);
    program->uarts[i].character_bits = tiltproof_get_u32(at + 4);
  }
  program->strings = (char*)malloc(size + 3);
  if (program->strings == NULL) abort();
  char* text = program->strings;
  const char** const names[3] = {&program->firmware, &program->dialect, &program->parameters};
  for (int i = 0; i < 3; ++i) {
    const uint32_t length = tiltproof_get_u32(at);
    memcpy(text, at + 4, length);
    text[length] = '\0';
    *names[i] = text;
    text += length + 1;
    at += 4 + length;
  }
  return 1;
}

/* Must follow open. `flags`: TILTPROOF_PROGRAM_TELLS_STATUS, TILTPROOF_PROGRAM_TELLS_ROLE. */
static inline void tiltproof_program_ready(TiltproofProgram* program, int flags) {
  tiltproof_put_u32(tiltproof_message(program, TILTPROOF_PROGRAM_READY, 0, flags, 4),
                    TILTPROOF_PROGRAM_VERSION);
  tiltproof_flush(program);
}

/* Instead of ready: it cannot be that firmware, and why. */
static inline void tiltproof_program_refuse(TiltproofProgram* program, const char* why) {
  memcpy(tiltproof_message(program, TILTPROOF_PROGRAM_REFUSED, 0, 0, strlen(why)), why, strlen(why));
  tiltproof_flush(program);
}

/* What comes next: returns event->kind. After a grant or a reset, tiltproof_program_wait() must follow. */
static inline int tiltproof_program_next(TiltproofProgram* program, TiltproofEvent* event) {
  memset(event, 0, sizeof *event);
  for (;;) {
    const uint8_t* const message = tiltproof_read(program);
    event->kind = message == NULL ? (int)TILTPROOF_PROGRAM_END : (int)message[4];
    if (event->kind == TILTPROOF_PROGRAM_END) return event->kind;
    if (event->kind < TILTPROOF_PROGRAM_GRANT || event->kind > TILTPROOF_PROGRAM_RESET) continue;
    const uint8_t* const body = message + TILTPROOF_PROGRAM_HEADER_BYTES;
    event->now_ns = program->now_ns = tiltproof_get_i64(body);
    program->must_ask = (message[6] & TILTPROOF_PROGRAM_ASK) != 0;
    if (event->kind == TILTPROOF_PROGRAM_BYTES) {
      event->uart = message[5];
      event->count = tiltproof_get_u32(message) - 8;
      /* A copy: what is sent meanwhile may move the message. */
      program->event.size = 0;
      event->bytes = tiltproof_room(&program->event, event->count + 1);
      memcpy(program->event.bytes, body + 8, event->count);
    }
    return event->kind;
  }
}

/* Gives bytes to the UART's transmitter at now_ns: the present time, or up to 1 s later. Returns the time at which the
 * last stop bit leaves. On the reference line (UART 1) there is no way back: what is sent there goes nowhere. */
static inline int64_t tiltproof_program_transmit(TiltproofProgram* program, int uart, int64_t now_ns,
                                                 const uint8_t* bytes, size_t count) {
  if (uart < 0 || (uint32_t)uart >= program->uart_count || uart >= TILTPROOF_PROGRAM_UARTS_MAX ||
      bytes == NULL || count == 0)
    return now_ns;
  const int ask = program->must_ask;
  for (size_t done = 0; done < count;) {
    size_t part = count - done;
    if (part > TILTPROOF_PROGRAM_BODY_BYTES_MAX - 8) part = TILTPROOF_PROGRAM_BODY_BYTES_MAX - 8;
    const int last = done + part == count;
    uint8_t* const out = tiltproof_message(program, TILTPROOF_PROGRAM_TRANSMIT, uart,
                                           ask && last ? TILTPROOF_PROGRAM_ASK : 0, 8 + part);
    tiltproof_put_i64(out, now_ns);
    memcpy(out + 8, bytes + done, part);
    done += part;
  }
  if (ask) {
    tiltproof_flush(program);
    return tiltproof_take_time(program, TILTPROOF_PROGRAM_SENT, now_ns);
  }
  if (uart == 1) return now_ns;
  TiltproofTransmitter* const line = &program->uarts[uart];
  if (now_ns < program->now_ns) now_ns = program->now_ns;
  if (now_ns - program->now_ns > 1000000000) now_ns = program->now_ns + 1000000000;
  if (now_ns > line->free_ns) {
    line->free_ns = line->busy_begin_ns = now_ns;
    line->busy_bytes = 0;
  }
  if (line->baud == 0) return line->free_ns;
  line->busy_bytes += (int64_t)count;
  while (line->busy_bytes >= line->baud) {
    line->busy_begin_ns += line->character_bits * 1000000000;
    line->busy_bytes -= line->baud;
  }
  line->free_ns = line->busy_begin_ns + line->busy_bytes * line->character_bits * 1000000000 / line->baud;
  return line->free_ns;
}

/* States that the program computes: it begins at now_ns, takes length_ns on a sound processor, and should end by
 * deadline_ns. Returns when it ends (TiltproofHost.compute). What depends on the result is to be sent then or later. It
 * costs one more exchange with the harness. */
static inline int64_t tiltproof_program_compute(TiltproofProgram* program, int64_t now_ns, int64_t length_ns,
                                                int64_t deadline_ns) {
  uint8_t* const out = tiltproof_message(program, TILTPROOF_PROGRAM_COMPUTE, 0, 0, 24);
  tiltproof_put_i64(out, now_ns);
  tiltproof_put_i64(out + 8, length_ns);
  tiltproof_put_i64(out + 16, deadline_ns);
  tiltproof_flush(program);
  return tiltproof_take_time(program, TILTPROOF_PROGRAM_COMPUTED, now_ns);
}

/* The program's supervisor, as in TiltproofClientStatus: sent when it has changed. */
static inline void tiltproof_program_status(TiltproofProgram* program, uint32_t supervisor_state,
                                            uint32_t failsafe_count) {
  if (program->has_status && program->supervisor_state == supervisor_state &&
      program->failsafe_count == failsafe_count)
    return;
  program->has_status = 1;
  program->supervisor_state = supervisor_state;
  program->failsafe_count = failsafe_count;
  uint8_t* const out = tiltproof_message(program, TILTPROOF_PROGRAM_STATUS, 0, 0, 8);
  tiltproof_put_u32(out, supervisor_state);
  tiltproof_put_u32(out + 4, failsafe_count);
}

/* The program's role among several clients: 0 standby, 1 active, 2 failed. Sent when it has changed. */
static inline void tiltproof_program_role(TiltproofProgram* program, int role) {
  if (program->has_role && program->role == role) return;
  program->has_role = 1;
  program->role = role;
  tiltproof_message(program, TILTPROOF_PROGRAM_ROLE, role, 0, 0);
}

/* One line of text for the flight's firmware.log. */
static inline void tiltproof_program_log(TiltproofProgram* program, int64_t now_ns, const char* text) {
  size_t count = text == NULL ? 0 : strlen(text);
  if (count > TILTPROOF_PROGRAM_BODY_BYTES_MAX - 8) count = TILTPROOF_PROGRAM_BODY_BYTES_MAX - 8;
  uint8_t* const out = tiltproof_message(program, TILTPROOF_PROGRAM_LOG, 0, 0, 8 + count);
  tiltproof_put_i64(out, now_ns);
  if (count != 0) memcpy(out + 8, text, count);
}

/* Ends a grant or a reset: nothing more to do until this time, or until bytes come. */
static inline void tiltproof_program_wait(TiltproofProgram* program, int64_t until_ns) {
  tiltproof_put_i64(tiltproof_message(program, TILTPROOF_PROGRAM_WAITING, 0, 0, 8), until_ns);
  tiltproof_flush(program);
}

/* --------------------------------------------------------------------- a program from the functions of a library */
#ifdef TILTPROOF_CLIENT_H

#pragma weak tiltproof_client_status
#pragma weak tiltproof_client_role

static inline int64_t tiltproof_run_transmit(void* context, int uart, int64_t now_ns, const uint8_t* bytes,
                                             size_t count) {
  return tiltproof_program_transmit((TiltproofProgram*)context, uart, now_ns, bytes, count);
}
static inline int64_t tiltproof_run_compute(void* context, int64_t now_ns, int64_t length_ns,
                                            int64_t deadline_ns) {
  return tiltproof_program_compute((TiltproofProgram*)context, now_ns, length_ns, deadline_ns);
}
static inline void tiltproof_run_log(void* context, int64_t now_ns, const char* text) {
  tiltproof_program_log((TiltproofProgram*)context, now_ns, text);
}

/* Flies the functions of tiltproof_client.h until the flight is over. Returns the exit code for main(). */
static inline int tiltproof_program_run(void) {
  TiltproofProgram program;
  TiltproofEvent event;
  TiltproofHost host;
  if (!tiltproof_program_open(&program)) return 1;
  memset(&host, 0, sizeof host);
  host.abi_version = tiltproof_client_abi_version();
  host.firmware = program.firmware;
  host.dialect = program.dialect;
  host.parameters = program.parameters;
  host.context = &program;
  host.transmit = tiltproof_run_transmit;
  host.log = tiltproof_run_log;
  host.compute = tiltproof_run_compute;
  TiltproofClient* const client = tiltproof_client_create(&host);
  if (client == NULL) {
    tiltproof_program_refuse(&program, "tiltproof_client_create returned NULL");
    tiltproof_program_close(&program);
    return 1;
  }
  tiltproof_program_ready(&program, (tiltproof_client_status != NULL ? TILTPROOF_PROGRAM_TELLS_STATUS : 0) |
                                        (tiltproof_client_role != NULL ? TILTPROOF_PROGRAM_TELLS_ROLE : 0));
  int started = 0;
  while (tiltproof_program_next(&program, &event) != TILTPROOF_PROGRAM_END) {
    int64_t until_ns = 0;
    if (event.kind == TILTPROOF_PROGRAM_BYTES) {
      tiltproof_client_receive(client, event.uart, event.now_ns, event.bytes, event.count);
      continue;
    }
    if (event.kind == TILTPROOF_PROGRAM_RESET) {
      until_ns = tiltproof_client_reset(client, event.now_ns);
    } else {
      until_ns = started ? tiltproof_client_grant(client, event.now_ns)
                         : tiltproof_client_start(client, event.now_ns);
      started = 1;
    }
    if (tiltproof_client_status != NULL) {
      TiltproofClientStatus status;
      memset(&status, 0, sizeof status);
      tiltproof_client_status(client, &status);
      tiltproof_program_status(&program, status.supervisor_state, status.failsafe_count);
    }
    if (tiltproof_client_role != NULL) tiltproof_program_role(&program, (int)tiltproof_client_role(client));
    tiltproof_program_wait(&program, until_ns);
  }
  tiltproof_client_destroy(client);
  tiltproof_program_close(&program);
  return 0;
}

#endif /* TILTPROOF_CLIENT_H */

#ifdef __cplusplus
}
#endif
/* NOLINTEND(modernize-use-nullptr,readability-identifier-naming,bugprone-*) */

#endif
