/* A firmware of one file in C11, to start your own from: nothing of tiltproof but the C interface in
 * firmware/tiltproof_client.h.
 *
 * It flies the design tilt-rotor (plant/models/tiltrotor.sdf) with cascaded position, attitude and servo
 * loops, and any other vehicle with the gain that the harness passes as parameters. It has its own implementation of
 * the serial protocol (dialect `paper`). Five parts, bottom up: frames, controller, controller with a gain, protocol
 * client, C interface.
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
  kSignalsMax = 28, /* of a reply: 12, and 2 for each of up to 8 hinges */
  kInputsMax = 16,  /* up to 8 rotors and 8 hinges */
  kPayloadBytesMax = 4 * kSignalsMax,
  kSendBytesMax = 4 * (1 + kInputsMax), /* a service id and the inputs */
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

/* ---------------------------------------------------------------------------------------------------------
 * controller with a gain: u = u_hover - K (x - x_ref) for any vehicle, with the numbers of TiltproofHost.parameters. */

typedef struct {
  size_t signals, inputs; /* 0 inputs: the cascaded loops above fly */
  bool rates_in_world;
  float hover_state[kSignalsMax];
  float hover_input[kInputsMax], input_min[kInputsMax], input_max[kInputsMax];
  float gain[kInputsMax][kSignalsMax + 4];
  float integral[4], last_error[4]; /* of x, y, z and yaw */
} Regulator;

/* The text behind `"key":`, or NULL. */
static const char* After(const char* text, const char* key) {
  const size_t length = strlen(key);
  for (; text != NULL && (text = strchr(text, '"')) != NULL; ++text) {
    if (strncmp(text + 1, key, length) == 0 && text[1 + length] == '"' && text[2 + length] == ':')
      return text + length + 3;
  }
  return NULL;
}

/* Reads a number, and moves `*text` behind it. */
static double Number(const char** text) {
  const char* at = *text;
  while (*at == ' ' || *at == '[' || *at == ',') ++at;
  const double sign = *at == '-' ? -1 : 1;
  if (*at == '-') ++at;
  double value = 0;
  int exponent = 0;
  for (; *at >= '0' && *at <= '9'; ++at) value = 10 * value + (*at - '0');
  if (*at == '.')
    for (++at; *at >= '0' && *at <= '9'; ++at, --exponent) value = 10 * value + (*at - '0');
  if (*at == 'e' || *at == 'E') {
    const bool negative = *++at == '-';
    int power = 0;
    if (*at == '-' || *at == '+') ++at;
    for (; *at >= '0' && *at <= '9'; ++at) power = 10 * power + (*at - '0');
    exponent += negative ? -power : power;
  }
  for (; exponent > 0; --exponent) value *= 10;
  for (; exponent < 0; ++exponent) value /= 10;
  *text = at;
  return sign * value;
}

/* The numbers behind each `"key":` before `end`. Returns how many there are, at most `max`. */
static size_t Members(const char* text, const char* end, const char* key, float* values, size_t max) {
  size_t count = 0;
  while (count < max && (text = After(text, key)) != NULL && text < end)
    values[count++] = (float)Number(&text);
  return count;
}

/* False when the text lacks something; see firmware/tiltproof_client.h. */
static bool ReadParameters(const char* text, Regulator* r) {
  const char* signals = After(text, "signals");
  const char* inputs = After(text, "inputs");
  const char* gain = After(text, "gain");
  const char* rates = After(text, "angular_rates");
  if (signals == NULL || inputs == NULL || gain == NULL || rates == NULL || inputs > gain ||
      strchr(gain, '[') == NULL)
    return false;
  r->rates_in_world = strncmp(rates, " \"world\"", 8) == 0;
  r->signals = Members(signals, inputs, "hover", r->hover_state, kSignalsMax);
  r->inputs = Members(inputs, gain, "hover", r->hover_input, kInputsMax);
  if (r->signals < 12 || Members(inputs, gain, "min", r->input_min, kInputsMax) != r->inputs ||
      Members(inputs, gain, "max", r->input_max, kInputsMax) != r->inputs)
    return false;
  for (size_t row = 0; row < r->inputs; ++row, gain = strchr(gain, ']') + 1)
    for (size_t column = 0; column < r->signals + 4; ++column) r->gain[row][column] = (float)Number(&gain);
  return true;
}

/* `s`: r->signals numbers; `u`: r->inputs. */
static void Regulate(Regulator* r, const float* s, const Reference* reference, float* u) {
  const size_t n = r->signals / 2; /* x y z roll pitch yaw and hinges; then their rates */
  const float yaw = ShortWay(s[5]), cos_yaw = Cosine(yaw), sin_yaw = Sine(yaw);
  const float error[4] = {Clamp(s[0] - reference->x, 1.0f), Clamp(s[1] - reference->y, 1.0f),
                          Clamp(s[2] - reference->z, 1.0f), Clamp(ShortWay(s[5] - reference->yaw), 0.5f)};
  for (int i = 0; i < 4; ++i) {
    r->integral[i] += 0.5f * kPeriod * (error[i] + r->last_error[i]);
    r->last_error[i] = error[i];
  }
  float x[kSignalsMax + 4];
  for (size_t i = 0; i < r->signals; ++i) x[i] = s[i] - r->hover_state[i];
  const float velocity[2] = {s[n] - reference->vx, s[n + 1] - reference->vy};
  /* The gain holds for a heading of 0: everything level turns from the world to the heading. */
  x[0] = cos_yaw * error[0] + sin_yaw * error[1];
  x[1] = cos_yaw * error[1] - sin_yaw * error[0];
  x[2] = error[2];
  x[5] = error[3];
  x[n] = cos_yaw * velocity[0] + sin_yaw * velocity[1];
  x[n + 1] = cos_yaw * velocity[1] - sin_yaw * velocity[0];
  x[n + 2] = s[n + 2] - reference->vz;
  if (r->rates_in_world) {
    x[n + 3] = cos_yaw * s[n + 3] + sin_yaw * s[n + 4];
    x[n + 4] = cos_yaw * s[n + 4] - sin_yaw * s[n + 3];
  }
  x[r->signals] = cos_yaw * r->integral[0] + sin_yaw * r->integral[1];
  x[r->signals + 1] = cos_yaw * r->integral[1] - sin_yaw * r->integral[0];
  x[r->signals + 2] = r->integral[2];
  x[r->signals + 3] = r->integral[3];
  for (size_t row = 0; row < r->inputs; ++row) {
    u[row] = r->hover_input[row];
    for (size_t column = 0; column < r->signals + 4; ++column) u[row] -= r->gain[row][column] * x[column];
    if (u[row] < r->input_min[row]) u[row] = r->input_min[row];
    if (u[row] > r->input_max[row]) u[row] = r->input_max[row];
  }
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
  float sensors[kSignalsMax];
  Reference reference;
  float integral[3];
  Regulator regulator;
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
  float values[kSignalsMax];
  const size_t signals = client->regulator.inputs != 0 ? client->regulator.signals : kSensorCount;
  if (!client->waiting || count != 4 * signals) return;
  GetFloats(payload, signals, values);
  if (!Plausible(values, signals)) return;
  memcpy(client->sensors, values, 4 * signals);
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
  const float* s = client->sensors;
  if (!client->has_reference) { /* stay where the flight began */
    client->reference = (Reference){.x = s[0], .y = s[1], .z = s[2], .yaw = s[5]};
    client->has_reference = true;
  }
  if (client->regulator.inputs != 0) {
    float u[kInputsMax];
    Regulate(&client->regulator, s, &client->reference, u);
    Send(client, now_ns, kServiceActuators, u, client->regulator.inputs);
    return;
  }
  Sensors sensors;
  memcpy(&sensors, s, sizeof(sensors));
  const Actuators u = Control(client->integral, &sensors, &client->reference);
  const float values[kActuatorCount] = {u.f_r, u.f_l, u.tau_r, u.tau_l};
  Send(client, now_ns, kServiceActuators, values, kActuatorCount);
}

/* --------------------------------------------------------------------------------------------------------- C
 * interface */

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  if (host->abi_version != TILTPROOF_CLIENT_ABI_VERSION || strcmp(host->dialect, "paper") != 0) return NULL;
  TiltproofClient* client = calloc(1, sizeof(*client));
  if (client == NULL) return NULL;
  client->host = host;
  /* The loops above are tuned for the shipped tilt-rotor and its variants: tiltrotor, tiltrotor_drag, ... */
  static const char kTuned[] = "\"tiltrotor";
  const char* model = host->parameters == NULL ? NULL : After(host->parameters, "model");
  while (model != NULL && *model == ' ') ++model;
  const bool tuned = model == NULL || strncmp(model, kTuned, sizeof(kTuned) - 1) == 0;
  if (!tuned && !ReadParameters(host->parameters, &client->regulator)) {
    free(client);
    return NULL;
  }
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
  const TiltproofHost* host = client->host;
  Regulator regulator = client->regulator;
  memset(regulator.integral, 0, sizeof(regulator.integral));
  memset(regulator.last_error, 0, sizeof(regulator.last_error));
  *client = (TiltproofClient){.host = host, .regulator = regulator};
  return tiltproof_client_start(client, now_ns);
}
