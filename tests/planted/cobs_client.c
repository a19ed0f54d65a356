/* A client of a COBS protocol in C (cobs.yaml), for tests of `tiltproof fuzz --protocol FILE`: it holds a vehicle that
 * does not move. Bytes are decoded one by one as the receive interrupt has them, and all memory is static.
 *
 * Built as it is, it is correct. Each PLANTED_... puts one defect in the place of the correct lines that follow its
 * #else; README.md says what each does.
 */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "firmware/tiltproof_client.h"

enum {
  kDelimiter = 0x00,
  kFullBlock = 0xFF, /* the code of 254 bytes that no 00 follows */
  kCheckBytes = 2,
  kContentBytesMax = 300, /* since the last 00; the longest message has 29 bytes: there is much to spare */
  kDecodedBytesMax = 254,
  kReplyBytes = 1 + 3 * 4 + 8 * 2,
  kCommandBytes = 1 + 2 * 2 + 2 * 4,
  kAlphaCount = 2,
  kHandlersCount =
      256, /* an index of one byte names a function or none, and never what lies behind the table */

  kStart = 1,
  kRequest = 2,
  kReply = 3,
  kActuators = 4,
};

static const int64_t kPeriodNs = 12000000;
static const float kWeight = 10.275f; /* N, of each rotor at hover */

/* The order of the members decides what an overrun meets: an index first, so that a crash depends on no address. */
struct TiltproofClient {
  const TiltproofHost* host;
  int64_t next_request_ns;
  bool waiting; /* for the reply to the last request */
  bool has_reply;
  bool too_long;
  bool damaged; /* the last frame was: only in the variant with that defect */
  float thrust_n;
  size_t count; /* of content */
  uint8_t decoded[kDecodedBytesMax];
  uint8_t handler;                   /* in kHandlers */
  uint8_t content[kContentBytesMax]; /* since the last 00 */
  uint8_t answer;                    /* in kAnswers */
  uint8_t log[4096];                 /* what else a firmware holds */
};

/* ------------------------------------------------------------------------------------------------------ frames */

static uint16_t Crc16(const uint8_t* bytes, size_t count) { /* CRC-16/IBM-3740 */
  uint16_t crc = 0xFFFF;
  for (size_t i = 0; i < count; ++i) {
    crc = (uint16_t)(crc ^ bytes[i] << 8);
    for (int bit = 0; bit < 8; ++bit) crc = (uint16_t)(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
  }
  return crc;
}

/* Undoes the stuffing of what stands between two delimiters. Returns the number of bytes; 0: it is no frame. */
static size_t Unstuff(TiltproofClient* client) {
  size_t size = 0;
  for (size_t at = 0; at < client->count;) {
    const size_t code = client->content[at];
#ifdef PLANTED_CODE_BEYOND_END
    /* The sender's codes are trusted. */
#else
    if (at + code > client->count || size + code - 1 > kDecodedBytesMax) return 0;
#endif
    memcpy(&client->decoded[size], &client->content[at + 1], code - 1);
    size += code - 1;
    at += code;
#ifdef PLANTED_FULL_BLOCK
    /* A 00 for each code but the last: also for a full block, and whether there is room or not. */
    if (at < client->count) client->decoded[size++] = 0;
#else
    if (at < client->count && code != kFullBlock) {
      if (size == kDecodedBytesMax) return 0;
      client->decoded[size++] = 0;
    }
#endif
  }
  return size;
}

static size_t Stuff(const uint8_t* bytes, size_t count, uint8_t* wire) {
  size_t code = 0;
  size_t size = 1;
  for (size_t i = 0; i < count; ++i) { /* shorter than a full block */
    if (bytes[i] == 0) {
      wire[code] = (uint8_t)(size - code);
      code = size++;
    } else {
      wire[size++] = bytes[i];
    }
  }
  wire[code] = (uint8_t)(size - code);
  wire[size++] = kDelimiter;
  return size;
}

static int64_t Send(TiltproofClient* client, int64_t now_ns, const uint8_t* message, size_t count) {
  uint8_t bytes[kCommandBytes + kCheckBytes];
  uint8_t wire[sizeof(bytes) + 2];
  memcpy(bytes, message, count);
  const uint16_t crc = Crc16(bytes, count);
  bytes[count] = (uint8_t)(crc >> 8);
  bytes[count + 1] = (uint8_t)crc;
  return client->host->transmit(client->host->context, TILTPROOF_UART_MAIN, now_ns, wire,
                                Stuff(bytes, count + kCheckBytes, wire));
}

/* ---------------------------------------------------------------------------------------------------- messages */

static int16_t Int16(const uint8_t* in) { return (int16_t)(in[0] | in[1] << 8); }

static float Float32(const uint8_t* in) {
  const uint32_t bits = in[0] | (uint32_t)in[1] << 8 | (uint32_t)in[2] << 16 | (uint32_t)in[3] << 24;
  float value;
  memcpy(&value, &bits, sizeof(value));
  return value;
}

static void TakeReply(TiltproofClient* client, const uint8_t* payload, size_t count) {
  if (count != kReplyBytes || payload[0] != kReply || !client->waiting) return;
  for (int i = 0; i < 3; ++i) {
    const float position_m = Float32(&payload[1 + 4 * i]);
    if (!(position_m >= -1e4f && position_m <= 1e4f)) return; /* not a number fails both */
  }
  float lift = 0; /* share of the thrust that lifts */
  for (int i = 0; i < kAlphaCount; ++i) {
    const float alpha_rad = 0.001f * Int16(&payload[kReplyBytes - 2 * kAlphaCount + 2 * i]);
#ifdef PLANTED_RANGE_UNCHECKED
    /* A hinge cannot turn further: no other angle comes. */
#else
    if (alpha_rad < -1.0f || alpha_rad > 1.0f) return;
#endif
    lift += 0.5f * cosf(alpha_rad);
  }
  client->thrust_n = kWeight / lift;
  client->has_reply = true;
  client->waiting = false;
}

static void (*const kHandlers[kHandlersCount])(TiltproofClient*, const uint8_t*, size_t) = {[1] = TakeReply};

static void TakeFrame(TiltproofClient* client) {
  if (client->too_long || client->count == 0) return;
  const size_t size = Unstuff(client);

#ifdef PLANTED_STATE_KEPT
  /* "Behind a damaged frame the line is out of step": for ever. */
  if (client->damaged) return;
  client->damaged = size <= kCheckBytes;
#endif

  if (size <= kCheckBytes) return;
  const size_t count = size - kCheckBytes;
  const uint16_t crc = (uint16_t)(client->decoded[count] << 8 | client->decoded[count + 1]);
#ifdef PLANTED_CHECK_IGNORED
  (void)crc; /* computed for the log alone */
#else
  if (crc != Crc16(client->decoded, count)) return;
#endif
  kHandlers[client->handler](client, client->decoded, count);
}

static void ReceiverTake(TiltproofClient* client, uint8_t byte) {
  if (byte == kDelimiter) {
    TakeFrame(client);
    client->count = 0;
#ifdef PLANTED_RESET_MISSING
    /* A frame that was too long is remembered. */
#else
    client->too_long = false;
#endif
    return;
  }
#ifdef PLANTED_LENGTH_UNCHECKED
  client->content[client->count++] = byte;
#else
  if (client->count < kContentBytesMax) {
    client->content[client->count++] = byte;
  } else {
    client->too_long = true;
  }
#endif
}

/* ------------------------------------------------------------------------------------------------- C interface */

static void Answer(TiltproofClient* client, int64_t now_ns) {
  uint8_t message[kCommandBytes] = {kActuators};
  const uint16_t thrust = (uint16_t)(client->thrust_n * 1000);
  for (int i = 0; i < 2; ++i) {
    message[1 + 2 * i] = (uint8_t)thrust;
    message[2 + 2 * i] = (uint8_t)(thrust >> 8);
  }
  Send(client, now_ns, message, sizeof(message)); /* torques of 0 are zeros */
}

static void (*const kAnswers[kHandlersCount])(TiltproofClient*, int64_t) = {[1] = Answer};

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  if (host->abi_version != TILTPROOF_CLIENT_ABI_VERSION || strcmp(host->dialect, "planted_cobs") != 0)
    return NULL;
  TiltproofClient* client = calloc(1, sizeof(*client));
  if (client != NULL) client->host = host;
  return client;
}

void tiltproof_client_destroy(TiltproofClient* client) { free(client); }

int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  client->handler = 1;
  client->answer = 1;
  const uint8_t start = kStart;
  client->next_request_ns = Send(client, now_ns, &start, 1);
  return tiltproof_client_grant(client, now_ns);
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  (void)now_ns;
  if (uart != TILTPROOF_UART_MAIN) return;
  for (size_t i = 0; i < count; ++i) ReceiverTake(client, bytes[i]);
}

int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  if (client->has_reply) {
    client->has_reply = false;
    kAnswers[client->answer](client, now_ns);
  }
  if (now_ns >= client->next_request_ns) {
    client->next_request_ns += kPeriodNs;
    client->waiting = true;
    const uint8_t request = kRequest;
    Send(client, now_ns, &request, 1);
  }
  return client->next_request_ns;
}

int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  *client = (TiltproofClient){.host = client->host};
  return tiltproof_client_start(client, now_ns);
}
