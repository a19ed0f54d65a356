/* A client that was built with the header of another version of the interface: that of version 1, whose host ends behind
 * `log`. It accepts no other version than its own, as libraries of that time do. */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

typedef struct TiltproofClient TiltproofClient;
typedef struct {
  uint32_t abi_version;
  const char* firmware;
  const char* dialect;
  void* context;
  int64_t (*transmit)(void* context, int uart, int64_t now_ns, const uint8_t* bytes, size_t count);
  void (*log)(void* context, int64_t now_ns, const char* text);
} TiltproofHost;

struct TiltproofClient {
  const TiltproofHost* host;
};

uint32_t tiltproof_client_abi_version(void) { return VERSION; }
TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  if (host->abi_version != VERSION) return NULL;
  TiltproofClient* client = calloc(1, sizeof(*client));
  if (client != NULL) client->host = host;
  return client;
}
void tiltproof_client_destroy(TiltproofClient* client) { free(client); }
int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  client->host->log(client->host->context, now_ns, client->host->firmware);
  return now_ns + 7;
}
void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  (void)client, (void)uart, (void)now_ns, (void)bytes, (void)count;
}
int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  (void)client;
  return now_ns + 7;
}
int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  return tiltproof_client_start(client, now_ns);
}
