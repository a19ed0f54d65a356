/* A flight client with other frames than the paper's, for tests: as a library and, on the example's board, as an image.
 * Its messages are those of the protocol `paper`; its check is CRC-16/IBM-3740 with the high byte first.
 *
 *   FRAMED_COBS     COBS (Cheshire and Baker, 1999); a 00 ends a frame
 *   FRAMED_LENGTH   AA 55, the payload's length in one byte, payload and check
 */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "firmware/tiltproof_client.h"

enum { kCheckBytes = 2, kPayloadBytesMax = 64, kWireBytesMax = kPayloadBytesMax + kCheckBytes + 4 };

typedef struct {
  uint8_t bytes[kWireBytesMax];
  size_t count;  /* of the frame's bytes that are in `bytes` */
  size_t marks;  /* FRAMED_LENGTH: marks that were found */
  size_t length; /* FRAMED_LENGTH: of payload and check */
} Receiver;

struct TiltproofClient {
  const TiltproofHost* host;
  Receiver receivers[2];
  int64_t next_request_ns;
  float height_m, climb_m_s, target_m;
  bool has_reply, has_target;
};

static uint16_t Check(const uint8_t* bytes, size_t count) {
  uint16_t rest = 0xFFFF;
  for (size_t i = 0; i < count; ++i) {
    rest = (uint16_t)(rest ^ bytes[i] << 8);
    for (int bit = 0; bit < 8; ++bit)
      rest = (uint16_t)((rest & 0x8000) != 0 ? rest << 1 ^ 0x1021 : rest << 1);
  }
  return rest;
}

static float Float(const uint8_t* bytes) {
  const uint32_t bits =
      bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
  float value;
  memcpy(&value, &bits, sizeof(value));
  return value;
}

/* ------------------------------------------------------------------------------------------------------ messages */

/* Payload and check. */
static void Take(TiltproofClient* client, int uart, const uint8_t* content, size_t count) {
  if (count < kCheckBytes) return;
  count -= kCheckBytes;
  if (Check(content, count) != (content[count] << 8 | content[count + 1])) return;
  if (uart == TILTPROOF_UART_MAIN && count == 64) {
    client->height_m = Float(content + 8);
    client->climb_m_s = Float(content + 40);
    client->has_reply = true;
  }
  if (uart == TILTPROOF_UART_REFERENCE && count == 28) {
    client->target_m = Float(content + 8);
    client->has_target = true;
  }
}

/* -------------------------------------------------------------------------------------------------------- frames */

#ifdef FRAMED_COBS
static void TakeByte(TiltproofClient* client, int uart, uint8_t byte) {
  Receiver* receiver = &client->receivers[uart];
  if (byte != 0) {
    if (receiver->count < kWireBytesMax) receiver->bytes[receiver->count] = byte;
    ++receiver->count;
    return;
  }
  const size_t size = receiver->count;
  receiver->count = 0;
  if (size > kWireBytesMax) return;
  uint8_t content[kWireBytesMax];
  size_t count = 0;
  for (size_t at = 0; at < size;) {
    const size_t code = receiver->bytes[at];
    if (at + code > size) return;
    for (size_t i = 1; i < code; ++i) content[count++] = receiver->bytes[at + i];
    at += code;
    if (code < 0xFF && at < size) content[count++] = 0;
  }
  Take(client, uart, content, count);
}

/* Frames are shorter than the longest block. */
static size_t Frame(const uint8_t* content, size_t count, uint8_t* wire) {
  size_t size = 1, code = 0;
  wire[0] = 1;
  for (size_t i = 0; i < count; ++i) {
    if (content[i] != 0) {
      wire[size++] = content[i];
      ++wire[code];
    } else {
      code = size;
      wire[size++] = 1;
    }
  }
  wire[size++] = 0;
  return size;
}
#else
static void TakeByte(TiltproofClient* client, int uart, uint8_t byte) {
  Receiver* receiver = &client->receivers[uart];
  if (receiver->marks < 2) {
    const bool is_next = byte == (receiver->marks == 0 ? 0xAA : 0x55);
    receiver->marks = is_next ? receiver->marks + 1 : byte == 0xAA ? 1 : 0;
    receiver->length = receiver->count = 0;
    return;
  }
  if (receiver->length == 0) {
    receiver->length = byte + (size_t)kCheckBytes;
    if (receiver->length > kWireBytesMax) receiver->marks = 0;
    return;
  }
  receiver->bytes[receiver->count++] = byte;
  if (receiver->count < receiver->length) return;
  receiver->marks = 0;
  Take(client, uart, receiver->bytes, receiver->count);
}

static size_t Frame(const uint8_t* content, size_t count, uint8_t* wire) {
  wire[0] = 0xAA;
  wire[1] = 0x55;
  wire[2] = (uint8_t)(count - kCheckBytes);
  memcpy(wire + 3, content, count);
  return 3 + count;
}
#endif

/* Returns when the last bit has left. */
static int64_t Send(TiltproofClient* client, int64_t now_ns, const float* numbers, size_t count) {
  uint8_t content[kPayloadBytesMax + kCheckBytes];
  uint8_t wire[kWireBytesMax];
  size_t size = 0;
  for (size_t i = 0; i < count; ++i) {
    uint32_t bits;
    memcpy(&bits, &numbers[i], sizeof(bits));
    for (int shift = 0; shift < 32; shift += 8) content[size++] = (uint8_t)(bits >> shift);
  }
  const uint16_t check = Check(content, size);
  content[size++] = (uint8_t)(check >> 8);
  content[size++] = (uint8_t)check;
  return client->host->transmit(client->host->context, TILTPROOF_UART_MAIN, now_ns, wire,
                                Frame(content, size, wire));
}

/* ----------------------------------------------------------------------------------------------------------- flight */

static float Thrust(const TiltproofClient* client) {
  const float thrust_n = 10.28f - 8 * (client->height_m - client->target_m) - 6 * client->climb_m_s;
  return thrust_n < 0 ? 0 : thrust_n > 20 ? 20 : thrust_n;
}

uint32_t tiltproof_client_abi_version(void) { return TILTPROOF_CLIENT_ABI_VERSION; }

TiltproofClient* tiltproof_client_create(const TiltproofHost* host) {
  TiltproofClient* client = calloc(1, sizeof(*client));
  if (client != NULL) client->host = host;
  return client;
}

void tiltproof_client_destroy(TiltproofClient* client) { free(client); }

int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns) {
  const float start = 1;
  client->next_request_ns = Send(client, now_ns, &start, 1);
  return client->next_request_ns;
}

void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns, const uint8_t* bytes,
                              size_t count) {
  (void)now_ns;
  for (size_t i = 0; i < count; ++i) TakeByte(client, uart, bytes[i]);
}

int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns) {
  if (client->has_reply) {
    client->has_reply = false;
    if (!client->has_target) client->target_m = client->height_m;
    const float thrust_n = Thrust(client);
    const float message[5] = {3, thrust_n, thrust_n, 0, 0};
    Send(client, now_ns, message, 5);
  }
  if (now_ns >= client->next_request_ns) {
    client->next_request_ns += 12000000;
    const float request = 2;
    Send(client, now_ns, &request, 1);
  }
  return client->next_request_ns;
}

int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns) {
  *client = (TiltproofClient){.host = client->host};
  return tiltproof_client_start(client, now_ns);
}
