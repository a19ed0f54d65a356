/* A client of the streaming protocol `hum` of docs/protocol.md, with COBS, CRC-16 and scaled integers at 250 Hz. Its code
 * follows that page alone: it shares none with tiltproof, and uses no generated header. It holds the model `quadrotor` at
 * (0, 0, 2) m by cascaded proportional and derivative loops. One source is a library, a program and an image.
 */
#include "firmware/tiltproof_client.h"

#include <stdbool.h>
#include <stdlib.h>

enum {
  kIdStart = 1,
  kIdMotors = 2,
  kIdState = 16,
  kStateBytes = 1 + 2 + 3 * 4 + 9 * 2,
  kCheckBytes = 2,
  kContentBytesMax = 64, /* of a stuffed frame; no message is so long */
  kStartAgainNs = 100000000,
};

struct TiltproofClient {
  const TiltproofHost* host;
  uint8_t content[kContentBytesMax];
  unsigned content_count; /* kContentBytesMax + 1: too many, wait for the next 00 */
  bool has_state;
  uint16_t last_state, motors_count;
  int64_t next_ns;
};

/* --------------------------------------------------------------------------------------------- frames */

/* CRC-16/IBM-3740: polynomial 1021, from FFFF, highest bit first. */
static uint16_t Crc(const uint8_t* bytes, unsigned count) {
  unsigned crc = 0xFFFF;
  for (unsigned i = 0; i < count; ++i) {
    crc ^= (unsigned)bytes[i] << 8;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x8000) != 0 ? (crc << 1 ^ 0x1021) & 0xFFFF : crc << 1;
  }
  return (uint16_t)crc;
}

/* `payload` has room for the check. */
static void Send(TiltproofClient* client, int64_t now_ns, uint8_t* payload, unsigned count) {
  const uint16_t crc = Crc(payload, count);
  payload[count++] = (uint8_t)(crc >> 8);
  payload[count++] = (uint8_t)crc;
  uint8_t frame[kContentBytesMax];
  unsigned code = 0, size = 1;
  for (unsigned i = 0; i < count; ++i) {
    if (payload[i] != 0) {
      frame[size++] = payload[i];
    } else {
      frame[code] = (uint8_t)(size - code);
      code = size++;
    }
  }
  frame[code] = (uint8_t)(size - code);
  frame[size++] = 0;
  client->host->transmit(client->host->context, TILTPROOF_UART_MAIN, now_ns, frame, size);
}

/* Returns the length of the payload, without its check; 0 when the frame is damaged. */
static unsigned Unstuff(const uint8_t* content, unsigned count, uint8_t* payload) {
  unsigned size = 0;
  for (unsigned at = 0; at < count;) {
    const unsigned code = content[at];
    if (code == 0 || at + code > count) return 0;
    for (unsigned i = 1; i < code; ++i) payload[size++] = content[at + i];
    at += code;
    if (at < count && code != 0xFF) payload[size++] = 0;
  }
  if (size <= kCheckBytes) return 0;
  size -= kCheckBytes;
  return Crc(payload, size) == (payload[size] << 8 | payload[size + 1]) ? size : 0;
}

/* ------------------------------------------------------------------------------------------- messages */

static unsigned Unsigned(const uint8_t** at) {
  const unsigned value = (unsigned)(*at)[0] | (unsigned)(*at)[1] << 8;
  *at += 2;
  return value;
}
static float Short(const uint8_t** at, float scale) { return scale * (float)(int16_t)Unsigned(at); }
static float Long(const uint8_t** at, float scale) {
  const uint32_t low = Unsigned(at), high = Unsigned(at);
  return scale * (float)(int32_t)(low | high << 16);
}

static void PutThrust(uint8_t* payload, unsigned* count, float thrust_n) {
  const float steps = thrust_n < 0 ? 0 : thrust_n > 6.0f ? 60000 : thrust_n / 0.0001f + 0.5f;
  const unsigned value = (unsigned)steps;
  payload[(*count)++] = (uint8_t)value;
  payload[(*count)++] = (uint8_t)(value >> 8);
}

/* ------------------------------------------------------------------------------------------ controller */

static float Limited(float value, float limit) {
  return value > limit ? limit : value < -limit ? -limit : value;
}

static void Command(TiltproofClient* client, int64_t now_ns, const uint8_t* at) {
  const float kMass_kg = 0.716f, kGravity_m_s2 = 9.81f, kArm_m = 0.12f, kDrag_m = 0.016f;
  const float kInertia_kg_m2 = 0.007f, kYawInertia_kg_m2 = 0.012f, kTiltMax_rad = 0.3f;
  const float x = Long(&at, 1e-4f), y = Long(&at, 1e-4f), z = Long(&at, 1e-4f);
  const float roll = Short(&at, 1e-4f), pitch = Short(&at, 1e-4f), yaw = Short(&at, 1e-4f);
  const float vx = Short(&at, 1e-3f), vy = Short(&at, 1e-3f), vz = Short(&at, 1e-3f);
  const float wx = Short(&at, 1e-3f), wy = Short(&at, 1e-3f), wz = Short(&at, 1e-3f);
  /* The heading stays near 0. */
  const float ax = -2.2f * x - 2.6f * vx, ay = -2.2f * y - 2.6f * vy;
  const float wanted_pitch = Limited((ax + ay * yaw) / kGravity_m_s2, kTiltMax_rad);
  const float wanted_roll = Limited((ax * yaw - ay) / kGravity_m_s2, kTiltMax_rad);
  const float lift_n = kMass_kg * (kGravity_m_s2 + Limited(6 * (2 - z) - 4 * vz, 5));
  const float about_x = kInertia_kg_m2 * (80 * (wanted_roll - roll) - 16 * wx) / kArm_m;
  const float about_y = kInertia_kg_m2 * (80 * (wanted_pitch - pitch) - 16 * wy) / kArm_m;
  const float about_z = Limited(kYawInertia_kg_m2 * (-6 * yaw - 4 * wz), 0.03f) / kDrag_m;
  uint8_t payload[kContentBytesMax];
  unsigned count = 0;
  payload[count++] = kIdMotors;
  payload[count++] = (uint8_t)client->motors_count;
  payload[count++] = (uint8_t)(client->motors_count >> 8);
  ++client->motors_count;
  PutThrust(payload, &count, (lift_n + about_x - about_y + about_z) / 4); /* front left, turns clockwise */
  PutThrust(payload, &count, (lift_n - about_x - about_y - about_z) / 4); /* front right */
  PutThrust(payload, &count, (lift_n - about_x + about_y + about_z) / 4); /* back right */
  PutThrust(payload, &count, (lift_n + about_x + about_y - about_z) / 4); /* back left */
  Send(client, now_ns, payload, count);
}

static void TakeFrame(TiltproofClient* client, int64_t now_ns) {
  uint8_t payload[kContentBytesMax];
  const unsigned count = Unstuff(client->content, client->content_count, payload);
  if (count != kStateBytes || payload[0] != kIdState) return;
  const uint8_t* at = payload + 1;
  const uint16_t sequence = (uint16_t)Unsigned(&at), ahead = (uint16_t)(sequence - client->last_state);
  if (client->has_state && (ahead == 0 || ahead >= 0x8000)) return;
  client->has_state = true;
  client->last_state = sequence;
  Command(client, now_ns, at);
}

/* ------------------------------------------------------------------------------------------- interface */

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  TiltproofClient* client = calloc(1, sizeof *client);
  if (client != NULL) client->host = host;
  return client;
}

void tiltproof_client_destroy(TiltproofClient* client) { free(client); }

int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  uint8_t payload[1 + kCheckBytes] = {kIdStart};
  Send(client, now_ns, payload, 1);
  return client->next_ns = now_ns + kStartAgainNs;
}

int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  *client = (TiltproofClient){.host = client->host};
  return tiltproof_client_start(client, now_ns);
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  if (uart != TILTPROOF_UART_MAIN) return;
  for (size_t i = 0; i < count; ++i) {
    if (bytes[i] == 0) {
      if (client->content_count <= kContentBytesMax) TakeFrame(client, now_ns);
      client->content_count = 0;
    } else if (client->content_count < kContentBytesMax) {
      client->content[client->content_count++] = bytes[i];
    } else {
      client->content_count = kContentBytesMax + 1;
    }
  }
}

/* The stream's messages wake it. Until the first one, `start` may have been lost. */
int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  if (client->has_state) return TILTPROOF_NEVER;
  return now_ns >= client->next_ns ? tiltproof_client_start(client, now_ns) : client->next_ns;
}
