/* The client around the decoder: encoder, control law, protocol `paper`, and the C interface. */
#include "tests/planted/flight_client.h"

#include <stdlib.h>
#include <string.h>

/* ------------------------------------------------------------------------------------------------------ frames */

enum { kSendBytesMax = 20, kWireBytesMax = 2 * (kSendBytesMax + kCheckBytes) + 2 };

uint16_t Fletcher16(const uint8_t* bytes, size_t count) {
  unsigned sum1 = 0;
  unsigned sum2 = 0;
  for (size_t i = 0; i < count; ++i) {
    sum1 = (sum1 + bytes[i]) % 255u;
    sum2 = (sum2 + sum1) % 255u;
  }
  return (uint16_t)(sum2 << 8 | sum1);
}

/* Sends a message's id and `count` numbers; returns when the last bit has left. */
static int64_t Send(TiltproofClient* client, int64_t now_ns, float id, const float* values, size_t count) {
  uint8_t message[kSendBytesMax + kCheckBytes];
  uint8_t wire[kWireBytesMax];
  size_t size = 0;
  for (size_t i = 0; i <= count; ++i) {
    uint32_t bits;
    memcpy(&bits, i == 0 ? &id : &values[i - 1], sizeof(bits));
    for (int shift = 0; shift < 32; shift += 8) message[size++] = (uint8_t)(bits >> shift);
  }
  const uint16_t check = Fletcher16(message, size);
  message[size++] = (uint8_t)check;
  message[size++] = (uint8_t)(check >> 8);
  size_t wire_bytes = 0;
  wire[wire_bytes++] = kFlag;
  for (size_t i = 0; i < size; ++i) {
    const bool special = message[i] == kFlag || message[i] == kEscape;
    if (special) wire[wire_bytes++] = kEscape;
    wire[wire_bytes++] = special ? message[i] ^ kEscapeXor : message[i];
  }
  wire[wire_bytes++] = kFlag;
  return client->host->transmit(client->host->context, TILTPROOF_UART_MAIN, now_ns, wire, wire_bytes);
}

/* ------------------------------------------------------------------------------------------------- control law */

enum { kStateCount = kSensorCount + kIntegralCount };
static const float kPeriod = 0.012f;
static const float kForceMax = 25.0f; /* N, of one thruster */
static const float kTorqueMax = 1.0f; /* N m */
static const float kIntegralMax = 5.0f;
static const float kFeedForward[kActuatorCount] = {10.2751f, 10.2799f, 0, 0}; /* hover: N, N, N m, N m */

/* tiltproof design-lqr plant/models/tiltrotor.sdf: rows f_r, f_l, tau_r, tau_l; columns sensors and integrals. */
static const float kGain[kActuatorCount][kStateCount] = {
    {-0.0005f, 1.381f,  2.045f,  -4.100f, 0.0025f,  0.0652f, -0.0120f, 0.0122f, -0.0002f, 0.977f,
     2.068f,   -1.071f, 0.0040f, 0.0488f, -0.0002f, 0.0002f, -0.0003f, 0.932f,  0.988f,   0.0296f},
    {0.0005f, -1.380f, 2.047f,  4.097f,   0.0065f, -0.0652f, 0.0120f, -0.0122f, 0.0006f, -0.977f,
     2.069f,  1.070f,  0.0051f, -0.0488f, 0.0002f, -0.0002f, 0.0002f, -0.932f,  0.989f,  -0.0296f},
    {0.1475f, -0.0447f, 0,       0.1001f, 0.1862f, 0.0449f, 0.2184f, 0.0369f,  0.0704f, -0.0284f,
     0,       0.0178f,  0.0259f, 0.0310f, 0.0072f, 0.0007f, 0.1405f, -0.0325f, 0,       0.0213f},
    {0.1475f, 0.0447f,  0,       -0.0999f, 0.1862f, -0.0449f, 0.0369f, 0.2184f, 0.0704f, 0.0284f,
     0,       -0.0177f, 0.0259f, -0.0310f, 0.0007f, 0.0072f,  0.1405f, 0.0326f, 0,       -0.0213f},
};

static float Clamp(float value, float limit) {
  if (value > limit) return limit;
  if (value < -limit) return -limit;
  return value;
}

static void Control(TiltproofClient* client, float command[kActuatorCount]) {
  static const int kRegulated[kIntegralCount] = {0, 1, 2, kYaw};
  const float* target = client->reference;
  float error[kStateCount];
  memcpy(error, client->sensors, sizeof(client->sensors));
  memcpy(&error[kVelocity], client->velocity, sizeof(client->velocity));
  for (int i = 0; i < 3; ++i) {
    error[i] -= target[i];
    error[kVelocity + i] -= target[kReferenceYaw + 1 + i];
  }
  error[kYaw] -= target[kReferenceYaw];
  for (int i = 0; i < kIntegralCount; ++i) {
    client->integral[i] = Clamp(client->integral[i] + kPeriod * error[kRegulated[i]], kIntegralMax);
    error[kSensorCount + i] = client->integral[i];
  }
  for (int row = 0; row < kActuatorCount; ++row) {
    float value = kFeedForward[row];
    for (int column = 0; column < kStateCount; ++column) value -= kGain[row][column] * error[column];
    command[row] = Clamp(value, row < 2 ? kForceMax : kTorqueMax);
  }
}

/* ---------------------------------------------------------------------------------------------------- protocol */

static const float kStart = 1.0f;
static const float kReadSensors = 2.0f;
static const float kActuators = 3.0f;
static const int64_t kPeriodNs = 12000000;

static void Reply(TiltproofClient* client, int64_t now_ns) {
  if (!client->has_reference) { /* stay where the flight began */
    memcpy(client->reference, client->sensors, 3 * sizeof(float));
    client->reference[kReferenceYaw] = client->sensors[kYaw];
    client->has_reference = true;
  }
  float command[kActuatorCount];
  Control(client, command);
  Send(client, now_ns, kActuators, command, kActuatorCount);
}

/* ------------------------------------------------------------------------------------------------- C interface */

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  if (host->abi_version != TILTPROOF_CLIENT_ABI_VERSION || strcmp(host->dialect, "paper") != 0) return NULL;
  TiltproofClient* client = calloc(1, sizeof(*client));
  if (client != NULL) client->host = host;
  return client;
}

void tiltproof_client_destroy(TiltproofClient* client) { free(client); }

int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  client->lines[0] =
      (Receiver){.payload_bytes = 4 * kSensorCount, .owner = client, .line = TILTPROOF_UART_MAIN};
  client->lines[1] =
      (Receiver){.payload_bytes = 4 * kReferenceCount, .owner = client, .line = TILTPROOF_UART_REFERENCE};
  client->next_request_ns = Send(client, now_ns, kStart, NULL, 0);
  return tiltproof_client_grant(client, now_ns);
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  (void)now_ns;
  for (size_t i = 0; i < count; ++i) ReceiverTake(&client->lines[uart], bytes[i]);
}

int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  if (client->has_reply) {
    client->has_reply = false;
    Reply(client, now_ns);
  }
  if (now_ns >= client->next_request_ns) {
    client->next_request_ns += kPeriodNs;
    /* The line babbles: this client stays off it for a period. */
    client->waiting = !ReceiverBabbles(&client->lines[TILTPROOF_UART_MAIN]);
    if (client->waiting) Send(client, now_ns, kReadSensors, NULL, 0);
  }
  return client->next_request_ns;
}

int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  *client = (TiltproofClient){.host = client->host};
  return tiltproof_client_start(client, now_ns);
}
