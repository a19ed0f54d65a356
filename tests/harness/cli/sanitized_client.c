/* The minimal firmware with a mistake in how it takes bytes, 0.3 s after its power-on. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#define tiltproof_client_receive ReceiveRightly
#include "firmware/examples/minimal_c/minimal_firmware.c"
#undef tiltproof_client_receive

static volatile int largest = INT_MAX;

static void KeepMessage(const uint8_t* bytes, size_t count) {
  uint8_t* kept = malloc(count);
  for (size_t i = 0; i <= count; ++i) kept[i] = bytes[0];
  free(kept);
}
static void CopyMessage(const uint8_t* bytes, size_t count) {
  volatile uint8_t* kept = malloc(count);
  memcpy((uint8_t*)kept, bytes, count + (size_t)(kept != NULL));
  free((uint8_t*)kept);
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  if (now_ns > 300000000) {
    if (strcmp(client->host->firmware, "overflow") == 0) KeepMessage(bytes, count);
    if (strcmp(client->host->firmware, "copy") == 0) CopyMessage(bytes, count);
    if (strcmp(client->host->firmware, "largest") == 0) ++largest;
  }
  ReceiveRightly(client, uart, now_ns, bytes, count);
}
