/* One interface to the C headers of many protocols, so that one test can compare each with the harness. The values of a
 * message are doubles here, one for each field. */
#ifndef HEADER_GLUE_H
#define HEADER_GLUE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
  const char* protocol;
  size_t frame_bytes_max; /* of the longest message */
  /* `type` and `line` are indices: of the protocol's messages, of link::Direction. */
  size_t (*send)(int type, const double* values, uint8_t* frame);
  void (*reset)(void);
  size_t (*take)(uint8_t byte, const uint8_t** payload);
  /* Returns a link::MessageStatus; sets `type` and `values` when it is kOk. */
  int (*decode)(int line, const uint8_t* payload, size_t payload_bytes, int* type, double* values);
} HeaderGlue;

/* The same headers in both languages; a null protocol ends each. */
extern const HeaderGlue kHeadersInC[], kHeadersInCpp[];

#ifdef __cplusplus
}
#endif

#endif
