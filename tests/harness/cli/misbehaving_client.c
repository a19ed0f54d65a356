/* Firmware that does what firmware must not, 0.3 s after power-on: which, is the name of the build it is
 * asked to be. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware/tiltproof_client.h"

#define PERIOD_NS 12000000

struct TiltproofClient {
  const TiltproofHost* host;
  int64_t next_request_ns;
};

/* 7E, the float id, Fletcher-16, 7E: start (1) and read sensors (2) of the paper's dialect. */
static const uint8_t kStart[] = {0x7E, 0x00, 0x00, 0x80, 0x3F, 0xBF, 0x40, 0x7E};
static const uint8_t kRead[] = {0x7E, 0x00, 0x00, 0x00, 0x40, 0x40, 0x40, 0x7E};

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  TiltproofClient* client = calloc(1, sizeof *client);
  if (client != NULL) client->host = host;
  return client;
}

void tiltproof_client_destroy(TiltproofClient* client) { free(client); }

static void misbehave(const char* how) {
  if (strcmp(how, "crash") == 0) {
    volatile int* nowhere = NULL;
    *nowhere = 1;
  }
  if (strcmp(how, "hang") == 0)
    for (volatile int forever = 1; forever;) {
    }
  if (strcmp(how, "exit") == 0) exit(0);
  if (strcmp(how, "chatter") == 0) {
    puts("chatter-on-stdout");
    fflush(stdout);
  }
}

int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  if (now_ns > 300000000) misbehave(client->host->firmware);
  if (now_ns >= client->next_request_ns) {
    client->host->transmit(client->host->context, TILTPROOF_UART_MAIN, now_ns, kRead, sizeof kRead);
    client->next_request_ns += PERIOD_NS;
  }
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
