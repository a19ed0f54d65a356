/* A client that executes the places of coverage_places.c so many times: at its power-on, and the branch each time that it
 * runs. Its compiler counts nothing of this file. */
#include <stdlib.h>
#include <string.h>

#include "firmware/tiltproof_client.h"

extern unsigned own_counts[18];
#define DECLARE(k) void place_##k(void);
DECLARE(0)
DECLARE(1)
DECLARE(2)
DECLARE(3)
DECLARE(4)
DECLARE(5)
DECLARE(6)
DECLARE(7)
DECLARE(8)
DECLARE(9)
DECLARE(10)
DECLARE(11)
DECLARE(12)
DECLARE(13)
void branch(int left);

struct TiltproofClient {
  int runs_count;
};

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }
TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  (void)host;
  memset(own_counts, 0, sizeof own_counts);
  return calloc(1, sizeof(TiltproofClient));
}
void tiltproof_client_destroy(TiltproofClient* client) { free(client); }
int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  static void (*const kPlaces[])(void) = {place_0, place_1, place_2, place_3,  place_4,  place_5,  place_6,
                                          place_7, place_8, place_9, place_10, place_11, place_12, place_13};
  static const int kTimes[] = {0, 1, 2, 3, 4, 7, 8, 15, 16, 31, 32, 127, 128, 255};
  (void)client;
  for (int i = 0; i < 14; ++i)
    for (int k = 0; k < kTimes[i]; ++k) kPlaces[i]();
  return now_ns;
}
void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  (void)client, (void)uart, (void)now_ns, (void)bytes, (void)count;
}
int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  branch(++client->runs_count % 4 == 0);
  return now_ns + 12000000;
}
int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  return tiltproof_client_start(client, now_ns);
}
