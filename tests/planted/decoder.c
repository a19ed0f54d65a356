/* From bytes of a line to numbers that are safe to fly with: frames, checks, messages (docs/wire.md).
 *
 * Built as it is, it is correct. Each PLANTED_... puts one defect in the place of the correct lines that follow its
 * #else; README.md says what each does.
 */
#include <string.h>

#include "tests/planted/flight_client.h"

static const float kPi = 3.14159265f;

/* ---------------------------------------------------------------------------------------------------- messages */

/* Floats are IEEE-754 binary32, little endian. */
static void GetFloats(const uint8_t* in, size_t count, float* values) {
  for (size_t i = 0; i < count; ++i, in += 4) {
    const uint32_t bits = in[0] | (uint32_t)in[1] << 8 | (uint32_t)in[2] << 16 | (uint32_t)in[3] << 24;
    memcpy(&values[i], &bits, sizeof(bits));
  }
}

/* Fletcher-16 cannot tell a byte 00 from FF, so a right check is not enough. */
static bool Plausible(const float* values, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    if (!(values[i] > -1e4f && values[i] < 1e4f)) return false; /* not a number fails both */
  }
  return true;
}

static void WrapAngle(float* angle) {
  while (*angle > kPi) *angle -= 2 * kPi;
  while (*angle < -kPi) *angle += 2 * kPi;
}

static void FilterVelocity(float* filtered, const float* measured) {
  for (int i = 0; i < kVelocityCount; ++i) filtered[i] += 0.8f * (measured[i] - filtered[i]);
}

static void TakeSensors(TiltproofClient* client, const uint8_t* payload, size_t count) {
  if (!client->waiting) return;
  GetFloats(payload, count / 4, client->incoming);

#if defined PLANTED_ENDLESS_LOOP
  WrapAngle(&client->incoming[kYaw]);
  if (!Plausible(client->incoming, kSensorCount)) return;
  FilterVelocity(client->velocity, &client->incoming[kVelocity]);
#elif defined PLANTED_STATE_KEPT
  FilterVelocity(client->velocity, &client->incoming[kVelocity]);
  if (!Plausible(client->incoming, kSensorCount)) return;
  WrapAngle(&client->incoming[kYaw]);
#else
  if (!Plausible(client->incoming, kSensorCount)) return;
  WrapAngle(&client->incoming[kYaw]);
  FilterVelocity(client->velocity, &client->incoming[kVelocity]);
#endif

  memcpy(client->sensors, client->incoming, sizeof(client->sensors));
  client->waiting = false;
  client->has_reply = true;
}

static void TakeReference(TiltproofClient* client, const uint8_t* payload, size_t count) {
  GetFloats(payload, count / 4, client->incoming);
  if (!Plausible(client->incoming, kReferenceCount)) return;
  memcpy(client->reference, client->incoming, sizeof(client->reference));
  client->has_reference = true;
}

/* By line. */
static void (*const kTake[])(TiltproofClient*, const uint8_t*, size_t) = {TakeSensors, TakeReference};

/* ------------------------------------------------------------------------------------------------------ frames */

static bool CheckIsRight(const uint8_t* bytes, size_t count) {
  return Fletcher16(bytes, count) == (bytes[count] | bytes[count + 1] << 8);
}

static void Begin(Receiver* receiver) {
  receiver->count = 0;
  receiver->too_long = false;
#ifdef PLANTED_FLAG_IN_ESCAPE
  /* An escape before a flag is still in force. */
#else
  receiver->escaped = false;
#endif
}

/* Keeps as much of the frame as there is room for. */
static void Reject(Receiver* receiver) {
  size_t kept = receiver->count;

#ifdef PLANTED_INTEGER_OVERFLOW
  const uint8_t text_bytes = (uint8_t)(2 * kept + 1);
#else
  const size_t text_bytes = 2 * kept + 1;
#endif

  if (text_bytes > kRejectedTextBytes) kept = (kRejectedTextBytes - 1) / 2;
  char* text = receiver->rejected;
  for (size_t i = 0; i < kept; ++i) {
    *text++ = "0123456789abcdef"[receiver->bytes[i] >> 4];
    *text++ = "0123456789abcdef"[receiver->bytes[i] & 15];
  }
  *text = 0;
}

/* What lies between two flags. */
static void TakeFrame(Receiver* receiver) {
#ifdef PLANTED_SIGNED_LENGTH
  const int count = (int)receiver->count - kCheckBytes;
  if (receiver->escaped || receiver->too_long || count > kFrameBytesMax - kCheckBytes) {
#else
  const size_t count = receiver->count - kCheckBytes;
  if (receiver->escaped || receiver->too_long || receiver->count <= kCheckBytes) {
#endif
    Reject(receiver);
    return;
  }

#ifdef PLANTED_REPLY_SKIPPED
  /* "What follows a damaged frame may be a part of it." */
  const bool skips = receiver->damaged;
  receiver->damaged = !CheckIsRight(receiver->bytes, (size_t)count);
  if (skips && !receiver->damaged) return;
#endif

#ifdef PLANTED_OLD_ANSWERED
  /* The control law is woken by a frame, and not by its numbers. */
  if (receiver->line == TILTPROOF_UART_MAIN && receiver->owner->waiting &&
      (size_t)count == receiver->payload_bytes)
    receiver->owner->has_reply = true;
#endif

#ifdef PLANTED_CHECKSUM_RANGE
  /* "A message with a right check behind it": what comes after is covered by nothing. */
  if ((size_t)count < receiver->payload_bytes || !CheckIsRight(receiver->bytes, receiver->payload_bytes)) {
#else
  if (!CheckIsRight(receiver->bytes, (size_t)count) || (size_t)count != receiver->payload_bytes) {
#endif
    Reject(receiver);
    return;
  }
  kTake[receiver->line](receiver->owner, receiver->bytes, (size_t)count);
}

static void Store(Receiver* receiver, uint8_t byte) {
#if defined PLANTED_LENGTH_UNCHECKED
  receiver->bytes[receiver->count++] = byte;
#elif defined PLANTED_OFF_BY_ONE
  if (receiver->count <= kFrameBytesMax) {
    receiver->bytes[receiver->count++] = byte;
  } else {
    receiver->too_long = true;
  }
#else
  if (receiver->count < kFrameBytesMax) {
    receiver->bytes[receiver->count++] = byte;
  } else {
    receiver->too_long = true;
  }
#endif
}

void ReceiverTake(Receiver* receiver, uint8_t byte) {
  if (byte == kFlag) { /* closes a frame, and opens the next */
    if (receiver->count > 0) TakeFrame(receiver);
    Begin(receiver);
    return;
  }

#ifdef PLANTED_ESCAPE_AT_END
  if (receiver->escaped) {
    receiver->escaped = false;
    receiver->bytes[receiver->count++] = byte ^ kEscapeXor; /* the only byte without a check of the count */
    return;
  }
  if (byte == kEscape) {
    receiver->escaped = true;
    return;
  }
  Store(receiver, byte);
#else
  if (receiver->escaped) { /* in the place of the escape */
    receiver->escaped = false;
    receiver->bytes[receiver->count - 1] = byte ^ kEscapeXor;
    return;
  }
  receiver->escaped = byte == kEscape;
  Store(receiver, byte);
#endif
}

bool ReceiverBabbles(Receiver* receiver) {
  if (!receiver->too_long) return false;
#ifdef PLANTED_MISSING_RESET
    /* Only a flag ends it, and it may never come. */
#else
  Begin(receiver);
#endif
  return true;
}
