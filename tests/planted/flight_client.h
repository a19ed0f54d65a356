/* A flight client in C as firmware engineers write them, for tests of `tiltproof fuzz`: bytes are decoded one by one as
 * the receive interrupt has them, and all memory is static. decoder.c can be built with one of twelve classic defects
 * (README.md); the order of the members below decides what an overrun meets.
 *
 *   client->lines[uart] = (Receiver){.payload_bytes = 64, .owner = client, .line = uart};
 *   ReceiverTake(&client->lines[uart], byte);   whole, right frames end up in client->sensors or client->reference
 */
#ifndef TILTPROOF_TESTS_PLANTED_FLIGHT_CLIENT_H
#define TILTPROOF_TESTS_PLANTED_FLIGHT_CLIENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "firmware/tiltproof_client.h"

enum {
  kFlag = 0x7E,
  kEscape = 0x7D,
  kEscapeXor = 0x20,
  kCheckBytes = 2,
  kFrameBytesMax = 144, /* the longest message has 64 bytes, and its check; there is some to spare */
  kRejectedTextBytes = 128,

  kSensorCount = 16,
  kYaw = 5,
  kVelocity = 8,
  kVelocityCount = 3,
  kReferenceCount = 7,
  kReferenceYaw = 3,
  kIntegralCount = 4, /* of the errors of x, y, z and yaw */
  kActuatorCount = 4,
};

/* One line's receiver. */
typedef struct {
  size_t payload_bytes;              /* of the only message that comes on this line */
  char rejected[kRejectedTextBytes]; /* the last frame that was refused, in hexadecimal, for a debugger */
  TiltproofClient* owner;
  uint8_t bytes[kFrameBytesMax]; /* payload and check, unescaped */
  uint8_t line;                  /* TILTPROOF_UART_MAIN or TILTPROOF_UART_REFERENCE: who takes its messages */
  bool escaped;                  /* the last of the bytes is an escape: the next byte takes its place */
  bool too_long;
  bool damaged; /* the last frame was: only in the variant with that defect */
  size_t count;
} Receiver;

struct TiltproofClient {
  const TiltproofHost* host;
  Receiver lines[2];
  float sensors[kSensorCount];      /* in the order of the message; SI units, angles in rad */
  float incoming[kSensorCount];     /* the numbers of a message until they are checked */
  float reference[kReferenceCount]; /* x, y, z, yaw, vx, vy, vz */
  float integral[kIntegralCount];
  float velocity[kVelocityCount]; /* filtered, m/s */
  int64_t next_request_ns;
  bool waiting; /* for the reply to the last request */
  bool has_reply;
  bool has_reference;
};

/* decoder.c */
void ReceiverTake(Receiver* receiver, uint8_t byte);
/* True, once, when the frame on the line has become too long: the line babbles. */
bool ReceiverBabbles(Receiver* receiver);

/* flight_client.c: Fletcher-16 modulo 255. */
uint16_t Fletcher16(const uint8_t* bytes, size_t count);

#endif
