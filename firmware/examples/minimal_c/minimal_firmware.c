/* A firmware of one file in C11, to start your own from: nothing of tiltproof but the C interface in
 * firmware/tiltproof_client.h.
 *
 * It flies the design tilt-rotor (plant/models/tiltrotor.sdf) with cascaded position, attitude and servo
 * loops, over its own implementation of the serial protocol (dialect `paper`). Four parts, bottom up: frames,
 * controller, protocol client, C interface.
 *
 * Units are SI, angles in rad. World z up; attitude as Z-Y-X Euler angles; servo angle positive tilts the
 * thrust forward.
 */
#include "firmware/tiltproof_client.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* -------------------------------------------------------------------------------------------------------------
 * frames 0x7E | escaped(payload, check_lo, check_hi) | 0x7E, check = Fletcher-16 modulo 255 over the payload.
 */

enum {
  kFlag = 0x7E,
  kEscape = 0x7D,
  kEscapeXor = 0x20,
  kCheckBytes = 2,
  kPayloadBytesMax = 64, /* the longest message received: 16 floats */
  kSendBytesMax = 20,    /* the longest message sent: service id and 4 floats */
  kWireBytesMax = 2 * (kSendBytesMax + kCheckBytes) + 2
};

static uint16_t Fletcher16(const uint8_t* bytes, size_t count) {
  unsigned sum1 = 0;
  unsigned sum2 = 0;
  for (size_t i = 0; i < count; ++i) {
    sum1 = (sum1 + bytes[i]) % 255u;
    sum2 = (sum2 + sum1) % 255u;
  }
  return (uint16_t)(sum2 << 8 | sum1);
}

static uint8_t* PutEscaped(uint8_t* out, uint8_t byte) {
  if (byte == kFlag || byte == kEscape) {
    *out++ = kEscape;
    byte ^= kEscapeXor;
  }
  *out++ = byte;
  return out;
}

/* Returns the frame's length; `wire` has room for kWireBytesMax. */
static size_t EncodeFrame(const uint8_t* payload, size_t count, uint8_t* wire) {
  const uint16_t check = Fletcher16(payload, count);
  uint8_t* out = wire;
  *out++ = kFlag;
  for (size_t i = 0; i < count; ++i) out = PutEscaped(out, payload[i]);
  out = PutEscaped(out, (uint8_t)(check & 0xFFu));
  out = PutEscaped(out, (uint8_t)(check >> 8));
  *out++ = kFlag;
  return (size_t)(out - wire);
}

typedef struct {
  uint8_t bytes[kPayloadBytesMax + kCheckBytes];
  size_t count;
  bool escaped;
  bool in_frame; /* false: a frame that is none, or no flag seen yet; wait for the next flag */
} Decoder;

/* Takes one byte. Returns the payload's length when it closes a frame with a right check, the payload then
 * being the first of decoder->bytes; otherwise 0. A flag both closes a frame and opens the next. */
static size_t DecodeByte(Decoder* decoder, uint8_t byte) {
  if (byte == kFlag) {
    const bool whole = decoder->in_frame && !decoder->escaped && decoder->count > kCheckBytes;
    const size_t payload_bytes = whole ? decoder->count - kCheckBytes : 0;
    decoder->count = 0;
    decoder->escaped = false;
    decoder->in_frame = true;
    if (!whole) return 0;
    const uint8_t* check = decoder->bytes + payload_bytes;
    return Fletcher16(decoder->bytes, payload_bytes) == (check[0] | check[1] << 8) ? payload_bytes : 0;
  }
  if (byte == kEscape) {
    decoder->escaped = true;
    return 0;
  }
  if (decoder->escaped) {
    byte ^= kEscapeXor;
    decoder->escaped = false;
  }
  if (decoder->count == sizeof(decoder->bytes)) decoder->in_frame = false;
  if (decoder->in_frame) decoder->bytes[decoder->count++] = byte;
  return 0;
}

/* Floats are IEEE-754 binary32, little endian. */
static uint8_t* PutFloat(uint8_t* out, float value) {
  uint32_t bits;
  memcpy(&bits, &value, sizeof(bits));
  for (int shift = 0; shift < 32; shift += 8) *out++ = (uint8_t)(bits >> shift & 0xFFu);
  return out;
}

static void GetFloats(const uint8_t* in, size_t count, float* values) {
  for (size_t i = 0; i < count; ++i, in += 4) {
    const uint32_t bits = in[0] | (uint32_t)in[1] << 8 | (uint32_t)in[2] << 16 | (uint32_t)in[3] << 24;
    memcpy(&values[i], &bits, sizeof(bits));
  }
}

/* ---------------------------------------------------------------------------------------------------------
 * controller position error -> acceleration -> tilt -> angular acceleration -> thrust difference (roll),
 * servo angles (pitch, yaw)
 * -> servo torques. Every loop is a PD; the position loop also integrates. */

/* In the order of the message. */
typedef struct {
  float x, y, z, roll, pitch, yaw, alpha_r, alpha_l;
  float vx, vy, vz, wx, wy, wz, alpha_r_dot, alpha_l_dot;
} Sensors;
typedef struct {
  float f_r, f_l, tau_r, tau_l;
} Actuators;
typedef struct {
  float x, y, z, yaw, vx, vy, vz;
} Reference;

enum { kSensorCount = 16, kActuatorCount = 4, kReferenceCount = 7 };
_Static_assert(sizeof(Sensors) == 4 * kSensorCount, "16 floats without gaps");
_Static_assert(sizeof(Actuators) == 4 * kActuatorCount, "4 floats without gaps");
_Static_assert(sizeof(Reference) == 4 * kReferenceCount, "7 floats without gaps");

/* The vehicle: mass, inertias about its centre of mass, thrusters 0.278 m to the sides and 0.069 m above that
 * centre. */
static const float kPeriod = 0.012f;
static const float kGravity = 9.81f;
static const float kMass = 2.087f;
static const float kInertiaX = 0.0847f;
static const float kInertiaY = 0.0107f;
static const float kInertiaZ = 0.0789f;
static const float kArm = 0.2776f;
static const float kHeight = 0.0686f;
static const float kTrimPitch =
    -0.0117f; /* hover: the body leans back, the thrusters forward, thrust straight up */
static const float kTrimAlpha = 0.0116f;

/* Closed loops: position 1.3 rad/s, attitude 5 rad/s (yaw 2.5), servos 24 rad/s, each with a damping ratio
 * near 0.9. */
static const float kPositionP = 1.7f, kPositionD = 2.3f, kPositionI = 0.5f;
static const float kTiltP = 25.0f, kTiltD = 9.0f;
static const float kYawP = 6.0f, kYawD = 4.5f;
static const float kServoP = 0.06f, kServoD = 0.004f;

/* Limits of each loop's output, so that a large error in one does not upset the loops below. */
static const float kAccelerationMax = 3.0f;        /* m/s^2 */
static const float kIntegralMax = 1.0f;            /* m/s^2 */
static const float kTiltMax = 0.35f;               /* rad */
static const float kAngularAccelerationMax = 30.f; /* rad/s^2 */
static const float kServoMax = 0.6f;               /* rad */
static const float kForceMax = 25.0f;              /* N, of one thruster */
static const float kTorqueMax = 1.0f;              /* N m */

static float Clamp(float value, float limit) {
  if (value > limit) return limit;
  if (value < -limit) return -limit;
  return value;
}

/* The same angle within half a turn: the heading that is measured jumps at pi, and a reference may count turns. */
static float ShortWay(float angle) {
  const float kTurn = 6.28318531f;
  const float turns = angle / kTurn;
  return angle - kTurn * (float)(int)(turns + (turns < 0 ? -0.5f : 0.5f));
}

/* Sine for |angle| <= pi, error below 2e-4. The C library's may differ in the last bit from one machine to
 * another, and then a replayed flight would too. */
static float Sine(float angle) {
  const float kPi = 3.14159265f;
  if (angle > 0.5f * kPi) angle = kPi - angle;
  if (angle < -0.5f * kPi) angle = -kPi - angle;
  const float square = angle * angle;
  return angle * (1.0f - square / 6.0f * (1.0f - square / 20.0f * (1.0f - square / 42.0f)));
}

static float Cosine(float angle) { return Sine(1.57079633f - (angle < 0 ? -angle : angle)); }

/* `integral` is the controller's memory: the accelerations (m/s^2) that the position loop has integrated
 * along x, y, z. */
static Actuators Control(float integral[3], const Sensors* s, const Reference* r) {
  const float position_error[3] = {r->x - s->x, r->y - s->y, r->z - s->z};
  const float velocity_error[3] = {r->vx - s->vx, r->vy - s->vy, r->vz - s->vz};
  float acceleration[3];
  for (int i = 0; i < 3; ++i) {
    integral[i] = Clamp(integral[i] + kPositionI * kPeriod * position_error[i], kIntegralMax);
    acceleration[i] = Clamp(kPositionP * position_error[i] + kPositionD * velocity_error[i] + integral[i],
                            kAccelerationMax);
  }

  /* From the world to the body's heading: forward and left. */
  const float cos_yaw = Cosine(s->yaw);
  const float sin_yaw = Sine(s->yaw);
  const float forward = cos_yaw * acceleration[0] + sin_yaw * acceleration[1];
  const float left = -sin_yaw * acceleration[0] + cos_yaw * acceleration[1];
  const float roll_rate = cos_yaw * s->wx + sin_yaw * s->wy;
  const float pitch_rate = -sin_yaw * s->wx + cos_yaw * s->wy;

  const float roll_wanted = Clamp(-left / kGravity, kTiltMax);
  const float pitch_wanted = kTrimPitch + Clamp(forward / kGravity, kTiltMax);
  const float roll_acceleration =
      Clamp(kTiltP * (roll_wanted - s->roll) - kTiltD * roll_rate, kAngularAccelerationMax);
  const float pitch_acceleration =
      Clamp(kTiltP * (pitch_wanted - s->pitch) - kTiltD * pitch_rate, kAngularAccelerationMax);
  const float yaw_acceleration =
      Clamp(kYawP * ShortWay(r->yaw - s->yaw) - kYawD * s->wz, kAngularAccelerationMax);

  /* Thrust: weight and climb, more when tilted (1/cos to second order); the difference of the two rolls. */
  const float tilt_square = Clamp(s->roll * s->roll + s->pitch * s->pitch, 0.5f);
  const float thrust = kMass * (kGravity + acceleration[2]) * (1.0f + 0.5f * tilt_square);
  const float half_difference = 0.5f * kInertiaX * roll_acceleration / kArm;

  /* Both thrusters forward pitch up, right forward and left back yaws to the left. */
  const float pitch_angle = kInertiaY * pitch_acceleration / (kHeight * thrust);
  const float yaw_angle = kInertiaZ * yaw_acceleration / (kArm * thrust);
  const float alpha_r_wanted = kTrimAlpha + Clamp(pitch_angle + yaw_angle, kServoMax);
  const float alpha_l_wanted = kTrimAlpha + Clamp(pitch_angle - yaw_angle, kServoMax);

  return (Actuators){
      .f_r = Clamp(0.5f * thrust - half_difference, kForceMax),
      .f_l = Clamp(0.5f * thrust + half_difference, kForceMax),
      .tau_r = Clamp(kServoP * (alpha_r_wanted - s->alpha_r) - kServoD * s->alpha_r_dot, kTorqueMax),
      .tau_l = Clamp(kServoP * (alpha_l_wanted - s->alpha_l) - kServoD * s->alpha_l_dot, kTorqueMax),
  };
}

/* True for finite numbers of a size that a small aircraft's state can have: Fletcher-16 cannot tell a byte 00
 * from FF, so a right check is not enough. */
static bool Plausible(const float* values, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    if (!(values[i] > -1e4f && values[i] < 1e4f)) return false; /* NaN fails both */
  }
  return true;
}

/* -----------------------------------------------------------------------------------------------------
 * protocol client `start`, then a request every 12 ms; each reply is answered with actuators. */

static const float kServiceStart = 1.0f;
static const float kServiceSensors = 2.0f;
static const float kServiceActuators = 3.0f;
static const int64_t kPeriodNs = 12000000;

struct TiltproofClient {
  const TiltproofHost* host;
  Decoder main_line;
  Decoder reference_line;
  int64_t next_request_ns;
  bool waiting; /* for the reply to the last request */
  bool has_reply;
  bool has_reference;
  Sensors sensors;
  Reference reference;
  float integral[3];
};

/* Sends a service id and `count` floats; returns when the last bit has left. */
static int64_t Send(TiltproofClient* client, int64_t now_ns, float service, const float* values,
                    size_t count) {
  uint8_t payload[kSendBytesMax];
  uint8_t wire[kWireBytesMax];
  uint8_t* end = PutFloat(payload, service);
  for (size_t i = 0; i < count; ++i) end = PutFloat(end, values[i]);
  const size_t wire_bytes = EncodeFrame(payload, (size_t)(end - payload), wire);
  return client->host->transmit(client->host->context, TILTPROOF_UART_MAIN, now_ns, wire, wire_bytes);
}

static void AcceptSensors(TiltproofClient* client, const uint8_t* payload, size_t count) {
  float values[kSensorCount];
  if (!client->waiting || count != sizeof(values)) return;
  GetFloats(payload, kSensorCount, values);
  if (!Plausible(values, kSensorCount)) return;
  memcpy(&client->sensors, values, sizeof(values));
  client->waiting = false;
  client->has_reply = true;
}

static void AcceptReference(TiltproofClient* client, const uint8_t* payload, size_t count) {
  float values[kReferenceCount];
  if (count != sizeof(values)) return;
  GetFloats(payload, kReferenceCount, values);
  if (!Plausible(values, kReferenceCount)) return;
  memcpy(&client->reference, values, sizeof(values));
  client->has_reference = true;
}

static void RunControl(TiltproofClient* client, int64_t now_ns) {
  const Sensors* s = &client->sensors;
  if (!client->has_reference) { /* stay where the flight began */
    client->reference = (Reference){.x = s->x, .y = s->y, .z = s->z, .yaw = s->yaw};
    client->has_reference = true;
  }
  const Actuators u = Control(client->integral, s, &client->reference);
  const float values[kActuatorCount] = {u.f_r, u.f_l, u.tau_r, u.tau_l};
  Send(client, now_ns, kServiceActuators, values, kActuatorCount);
}

/* --------------------------------------------------------------------------------------------------------- C
 * interface */

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  if (host->abi_version != TILTPROOF_CLIENT_ABI_VERSION || strcmp(host->dialect, "paper") != 0) return NULL;
  TiltproofClient* client = calloc(1, sizeof(*client));
  if (client != NULL) client->host = host;
  return client;
}

void tiltproof_client_destroy(TiltproofClient* client) { free(client); }

int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  if (client->host->log != NULL) client->host->log(client->host->context, now_ns, "minimal_c: start");
  /* The first request leaves when `start` has left: at once on a line without byte time. */
  client->next_request_ns = Send(client, now_ns, kServiceStart, NULL, 0);
  return tiltproof_client_grant(client, now_ns);
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  (void)now_ns;
  Decoder* decoder = uart == TILTPROOF_UART_MAIN ? &client->main_line : &client->reference_line;
  for (size_t i = 0; i < count; ++i) {
    const size_t payload_bytes = DecodeByte(decoder, bytes[i]);
    if (payload_bytes == 0) continue;
    if (uart == TILTPROOF_UART_MAIN) {
      AcceptSensors(client, decoder->bytes, payload_bytes);
    } else {
      AcceptReference(client, decoder->bytes, payload_bytes);
    }
  }
}

int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  if (client->has_reply) {
    client->has_reply = false;
    RunControl(client, now_ns);
  }
  if (now_ns >= client->next_request_ns) {
    client->main_line.in_frame = false; /* A reply that is not whole by now answers the request before. */
    client->waiting = true;
    client->next_request_ns += kPeriodNs;
    Send(client, now_ns, kServiceSensors, NULL, 0);
  }
  return client->next_request_ns;
}

int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  *client = (TiltproofClient){.host = client->host};
  return tiltproof_client_start(client, now_ns);
}
