/* The firmware of firmware/examples/minimal_c, which also talks to another board: every 5 ms it sends a row of numbered
 * bytes on its first line (UART 2), and it writes to its log which of the other board's arrive, and when. */
#define tiltproof_client_abi_version minimal_abi_version
#define tiltproof_client_create minimal_create
#define tiltproof_client_destroy minimal_destroy
#define tiltproof_client_start minimal_start
#define tiltproof_client_receive minimal_receive
#define tiltproof_client_grant minimal_grant
#define tiltproof_client_reset minimal_reset
#include "firmware/examples/minimal_c/minimal_firmware.c"
#undef tiltproof_client_abi_version
#undef tiltproof_client_create
#undef tiltproof_client_destroy
#undef tiltproof_client_start
#undef tiltproof_client_receive
#undef tiltproof_client_grant
#undef tiltproof_client_reset

#ifndef __arm__
#include <stdio.h>
#endif

enum { kLine = 2, kRowBytes = 24 };
static const int64_t kRowEveryNs = 5000000;

typedef struct {
  TiltproofClient* inner;
  const TiltproofHost* host;
  int64_t inner_wake_ns, next_ns;
  uint8_t sent, expected;
  long received_count, wrong_count;
} Talker;

/* An image, whose log is slow, tells it by these. */
volatile uint32_t talk_received, talk_wrong;

TILTPROOF_CLIENT_API uint32_t tiltproof_client_abi_version(void);
TILTPROOF_CLIENT_API TiltproofClient* tiltproof_client_create(const TiltproofHost* host);
TILTPROOF_CLIENT_API void tiltproof_client_destroy(TiltproofClient* client);
TILTPROOF_CLIENT_API int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns);
TILTPROOF_CLIENT_API void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns,
                                                   const uint8_t* bytes, size_t count);
TILTPROOF_CLIENT_API int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns);
TILTPROOF_CLIENT_API int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns);

static Talker* Own(TiltproofClient* client) { return (Talker*)(void*)client; }

uint32_t tiltproof_client_abi_version(void) { return minimal_abi_version(); }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  Talker* talker = calloc(1, sizeof *talker);
  if (talker == NULL) return NULL;
  talker->host = host;
  talker->inner = minimal_create(host);
  return (TiltproofClient*)(void*)talker;
}

void tiltproof_client_destroy(TiltproofClient* client) {
  minimal_destroy(Own(client)->inner);
  free(client);
}

static int64_t Wake(const Talker* talker) {
  return talker->inner_wake_ns < talker->next_ns ? talker->inner_wake_ns : talker->next_ns;
}

int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  Talker* talker = Own(client);
  talker->next_ns = now_ns + kRowEveryNs;
  talker->inner_wake_ns = minimal_start(talker->inner, now_ns);
  return Wake(talker);
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  Talker* talker = Own(client);
  if (uart < kLine) {
    minimal_receive(talker->inner, uart, now_ns, bytes, count);
    return;
  }
  for (size_t i = 0; i < count; ++i) {
    talker->wrong_count += bytes[i] != talker->expected;
    talker->expected = (uint8_t)(bytes[i] + 1);
  }
  talker->received_count += (long)count;
  talk_received = (uint32_t)talker->received_count;
  talk_wrong = (uint32_t)talker->wrong_count;
#ifndef __arm__
  char text[100];
  snprintf(text, sizeof text, "line %d: %ld bytes, %ld wrong, at %lld ns", uart, talker->received_count,
           talker->wrong_count, (long long)now_ns);
  if (talker->host->log != NULL) talker->host->log(talker->host->context, now_ns, text);
#endif
}

int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  Talker* talker = Own(client);
  talker->inner_wake_ns = minimal_grant(talker->inner, now_ns);
  if (now_ns >= talker->next_ns) {
    uint8_t row[kRowBytes];
    for (size_t i = 0; i < kRowBytes; ++i) row[i] = talker->sent++;
    talker->host->transmit(talker->host->context, kLine, now_ns, row, sizeof row);
    talker->next_ns += kRowEveryNs;
  }
  return Wake(talker);
}

int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  Talker* talker = Own(client);
  talker->sent = talker->expected = 0;
  talker->next_ns = now_ns + kRowEveryNs;
  talker->inner_wake_ns = minimal_reset(talker->inner, now_ns);
  return Wake(talker);
}
