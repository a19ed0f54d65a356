// The parts of a protocol's C header that do not depend on its messages. In them @p@ is the prefix of functions, and @P@
// that of constants (c_header.cpp replaces them).
#pragma once

#include <string_view>

namespace tiltproof::harness::c_header {

inline constexpr std::string_view kCommon = R"c(
/* @P@_OK, or the first reason in this order for which a payload is no message. */
enum @p@_status { @P@_OK, @P@_BAD_LENGTH, @P@_UNKNOWN_ID, @P@_NOT_FINITE, @P@_OUT_OF_RANGE };

/* The lines: both directions of the main line, and the reference line. */
enum @p@_line { @P@_FROM_CLIENT, @P@_FROM_SERVER, @P@_ON_REFERENCE_LINE };

/* ---- Numbers. They are taken apart by shifts, so that the byte order of the processor does not matter. */

static inline uint32_t @p@_load(const uint8_t* from, size_t count, int is_big) {
  uint32_t bits = 0;
  size_t i;
  for (i = 0; i < count; ++i) bits = bits << 8 | from[is_big ? i : count - 1 - i];
  return bits;
}
static inline void @p@_store(uint8_t* to, size_t count, int is_big, uint32_t bits) {
  size_t i;
  for (i = 0; i < count; ++i) {
    to[is_big ? count - 1 - i : i] = (uint8_t)(bits & 0xFFu);
    bits >>= 8;
  }
}
/* A binary32 and its bits. */
static inline float @p@_float(uint32_t bits) {
#ifdef __cplusplus
  float value;
  __builtin_memcpy(&value, &bits, sizeof(value));
  return value;
#else
  union {
    uint32_t bits;
    float value;
  } both;
  both.bits = bits;
  return both.value;
#endif
}
static inline uint32_t @p@_float_bits(float value) {
#ifdef __cplusplus
  uint32_t bits;
  __builtin_memcpy(&bits, &value, sizeof(bits));
  return bits;
#else
  union {
    float value;
    uint32_t bits;
  } both;
  both.value = value;
  return both.bits;
#endif
}
)c";

inline constexpr std::string_view kDoubles = R"c(
/* A binary64, as two halves of 32 bits. A compiler whose double has fewer bits stops here. */
typedef char @p@_needs_a_double_of_64_bits[sizeof(double) == 8 ? 1 : -1];
static inline double @p@_load_double(const uint8_t* from, int is_big) {
  const uint64_t high = @p@_load(from + (is_big ? 0 : 4), 4, is_big);
  const uint64_t bits = high << 32 | @p@_load(from + (is_big ? 4 : 0), 4, is_big);
#ifdef __cplusplus
  double value;
  __builtin_memcpy(&value, &bits, sizeof(value));
  return value;
#else
  union {
    uint64_t bits;
    double value;
  } both;
  both.bits = bits;
  return both.value;
#endif
}
static inline void @p@_store_double(uint8_t* to, int is_big, double value) {
  uint64_t bits;
#ifdef __cplusplus
  __builtin_memcpy(&bits, &value, sizeof(bits));
#else
  union {
    double value;
    uint64_t bits;
  } both;
  both.value = value;
  bits = both.bits;
#endif
  @p@_store(to + (is_big ? 0 : 4), 4, is_big, (uint32_t)(bits >> 32));
  @p@_store(to + (is_big ? 4 : 0), 4, is_big, (uint32_t)(bits & 0xFFFFFFFFu));
}
)c";

inline constexpr std::string_view kIntegers = R"c(
/* The number in bits that hold it in two's complement; `sign` is the highest of them. */
static inline int32_t @p@_signed(uint32_t bits, uint32_t sign) {
  return bits < sign ? (int32_t)bits : -(int32_t)(sign - 1u - (bits - sign)) - 1;
}
/* The bits of the nearest whole number. Halves are rounded away from zero, and a value beyond the limits becomes a limit. */
static inline uint32_t @p@_nearest(double value, double least, double largest) {
  int64_t whole;
  double rest;
  if (value != value) return 0;
  if (value < least) value = least;
  if (value > largest) value = largest;
  whole = (int64_t)value;
  rest = value - (double)whole;
  if (rest >= 0.5) ++whole;
  if (rest <= -0.5) --whole;
  return (uint32_t)(uint64_t)whole;
}
)c";

inline constexpr std::string_view kNewer = R"c(
/* 1 if a count or a time of that many bits (8, 16, 32) is newer than the last one that was accepted, although it wraps: a
 * message with the same or an older one is a repetition, and is to be dropped. The first message has no predecessor. */
static inline int @p@_is_newer(uint32_t number, uint32_t last, unsigned bits) {
  const uint32_t ahead = (number - last) & (0xFFFFFFFFu >> (32u - bits));
  return ahead != 0 && ahead < (uint32_t)1 << (bits - 1u);
}
)c";

// --- Checks: @p@_check() of any number of bytes.

inline constexpr std::string_view kFletcher16 = R"c(
/* Fletcher-16: two sums modulo 255, the first one in the low byte. */
static inline uint32_t @p@_check(const uint8_t* bytes, size_t count) {
  uint32_t sum1 = 0, sum2 = 0;
  size_t i;
  for (i = 0; i < count; ++i) {
    sum1 = (sum1 + bytes[i]) % 255u;
    sum2 = (sum2 + sum1) % 255u;
  }
  return sum2 << 8 | sum1;
}
)c";
inline constexpr std::string_view kCrc16Ibm3740 = R"c(
/* CRC-16/IBM-3740, the highest bit of a byte first. A table is faster, if you have room for one. */
static inline uint32_t @p@_check(const uint8_t* bytes, size_t count) {
  uint32_t crc = 0xFFFFu;
  size_t i;
  int bit;
  for (i = 0; i < count; ++i) {
    crc ^= (uint32_t)bytes[i] << 8;
    for (bit = 0; bit < 8; ++bit) crc = (crc << 1 ^ ((crc & 0x8000u) != 0 ? 0x1021u : 0u)) & 0xFFFFu;
  }
  return crc;
}
)c";
inline constexpr std::string_view kCrc16IbmSdlc = R"c(
/* CRC-16/IBM-SDLC, the lowest bit of a byte first. A table is faster, if you have room for one. */
static inline uint32_t @p@_check(const uint8_t* bytes, size_t count) {
  uint32_t crc = 0xFFFFu;
  size_t i;
  int bit;
  for (i = 0; i < count; ++i) {
    crc ^= bytes[i];
    for (bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ ((crc & 1u) != 0 ? 0x8408u : 0u);
  }
  return crc ^ 0xFFFFu;
}
)c";
inline constexpr std::string_view kCrc32IsoHdlc = R"c(
/* CRC-32/ISO-HDLC, the one of Ethernet and zip. A table is faster, if you have room for one. */
static inline uint32_t @p@_check(const uint8_t* bytes, size_t count) {
  uint32_t crc = 0xFFFFFFFFu;
  size_t i;
  int bit;
  for (i = 0; i < count; ++i) {
    crc ^= bytes[i];
    for (bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ ((crc & 1u) != 0 ? 0xEDB88320u : 0u);
  }
  return crc ^ 0xFFFFFFFFu;
}
)c";
inline constexpr std::string_view kSum8 = R"c(
/* The sum of the bytes modulo 256. */
static inline uint32_t @p@_check(const uint8_t* bytes, size_t count) {
  uint32_t sum = 0;
  size_t i;
  for (i = 0; i < count; ++i) sum += bytes[i];
  return sum & 0xFFu;
}
)c";

inline constexpr std::string_view kChecked = R"c(
/* The length of the payload in front of its check, or 0 when the check is wrong or the payload empty. */
static inline size_t @p@_checked(const uint8_t* bytes, size_t size) {
  if (size <= @P@_CHECK_BYTES) return 0;
  size -= @P@_CHECK_BYTES;
  return @p@_load(bytes + size, @P@_CHECK_BYTES, @check_is_big@) == @p@_check(bytes, size) ? size : 0;
}
)c";
inline constexpr std::string_view kUnchecked = R"c(
/* The length of the payload, which has no check. */
static inline size_t @p@_checked(const uint8_t* bytes, size_t size) {
  (void)bytes;
  return size;
}
)c";
inline constexpr std::string_view kPutCheck =
    R"c(  @p@_store(check, @P@_CHECK_BYTES, @check_is_big@, @p@_check(payload, payload_bytes));
)c";

// --- Framings: @p@_frame(), @p@_reader, @p@_take(), @p@_reset().

inline constexpr std::string_view kHdlc = R"c(
/* The frame of a payload: flag 7E, payload and check with 7D and 7E escaped, flag. Returns its length; `frame` has room for
 * @P@_FRAME_ROOM(payload_bytes). */
static inline size_t @p@_frame(const uint8_t* payload, size_t payload_bytes, uint8_t* frame) {
  uint8_t check[4] = {0, 0, 0, 0};
  size_t size = 0, i;
@put_check@  frame[size++] = 0x7E;
  for (i = 0; i < payload_bytes + @P@_CHECK_BYTES; ++i) {
    const uint8_t byte = i < payload_bytes ? payload[i] : check[i - payload_bytes];
    if (byte == 0x7E || byte == 0x7D) {
      frame[size++] = 0x7D;
      frame[size++] = (uint8_t)(byte ^ 0x20);
    } else {
      frame[size++] = byte;
    }
  }
  frame[size++] = 0x7E;
  return size;
}

/* The state of a line's receiver. All zero is the start. */
struct @p@_reader {
  uint8_t bytes[@P@_LONGEST_PAYLOAD + @P@_CHECK_BYTES]; /* the payload, and its check behind it */
  size_t size;
  uint8_t state; /* 0: waits for a flag, 1: in a frame, 2: behind an escape */
};

/* Takes the next byte of the line. Returns the length of the payload in reader->bytes when the byte ends a frame whose check
 * is right, else 0. A flag ends a frame and opens the next. */
static inline size_t @p@_take(struct @p@_reader* reader, uint8_t byte) {
  if (byte == 0x7E) {
    const int is_whole = reader->state == 1;
    const size_t size = reader->size;
    reader->state = 1;
    reader->size = 0;
    return is_whole ? @p@_checked(reader->bytes, size) : 0;
  }
  if (reader->state == 0) return 0;
  if (reader->state == 1 && byte == 0x7D) {
    reader->state = 2;
    return 0;
  }
  if (reader->size == sizeof(reader->bytes)) {
    reader->state = 0; /* longer than any message */
    return 0;
  }
  reader->bytes[reader->size++] = (uint8_t)(reader->state == 2 ? byte ^ 0x20 : byte);
  reader->state = 1;
  return 0;
}
)c";

inline constexpr std::string_view kCobs = R"c(
/* The frame of a payload: payload and check with their 00 replaced (COBS), and a 00. Returns its length; `frame` has room for
 * @P@_FRAME_ROOM(payload_bytes). */
static inline size_t @p@_frame(const uint8_t* payload, size_t payload_bytes, uint8_t* frame) {
  uint8_t check[4] = {0, 0, 0, 0};
  size_t code = 0, size = 1, i; /* frame[code] is the distance to the next 00 */
@put_check@  frame[0] = 1;
  for (i = 0; i < payload_bytes + @P@_CHECK_BYTES; ++i) {
    const uint8_t byte = i < payload_bytes ? payload[i] : check[i - payload_bytes];
    if (frame[code] == 0xFF) {
      code = size;
      frame[size++] = 1;
    }
    if (byte != 0) {
      frame[size++] = byte;
      ++frame[code];
    } else {
      code = size;
      frame[size++] = 1;
    }
  }
  frame[size++] = 0;
  return size;
}

/* The state of a line's receiver. All zero is the start. */
struct @p@_reader {
  uint8_t bytes[@P@_LONGEST_PAYLOAD + @P@_CHECK_BYTES]; /* the payload, and its check behind it */
  size_t size;
  uint8_t left;  /* bytes up to the next code */
  uint8_t state; /* 0: waits for a code, 1: in a frame, 2: in a frame behind a code FF, 3: waits for a 00 */
};

/* Takes the next byte of the line. Returns the length of the payload in reader->bytes when the byte ends a frame whose check
 * is right, else 0. */
static inline size_t @p@_take(struct @p@_reader* reader, uint8_t byte) {
  const int is_code = reader->left == 0;
  if (byte == 0) {
    const int is_whole = is_code && (reader->state == 1 || reader->state == 2);
    const size_t size = reader->size;
    reader->size = 0;
    reader->left = 0;
    reader->state = 0;
    return is_whole ? @p@_checked(reader->bytes, size) : 0;
  }
  if (reader->state == 3) return 0;
  if (!is_code || reader->state == 1) {
    if (reader->size == sizeof(reader->bytes)) {
      reader->state = 3; /* longer than any message */
      return 0;
    }
    reader->bytes[reader->size++] = is_code ? 0 : byte;
  }
  if (is_code) {
    reader->left = (uint8_t)(byte - 1);
    reader->state = byte == 0xFF ? 2 : 1;
  } else {
    --reader->left;
  }
  return 0;
}
)c";

inline constexpr std::string_view kLengthPrefixed = R"c(
/* The frame of a payload: @sync_count@ marks, the length of the payload, payload, check. Returns its length; `frame` has room
 * for @P@_FRAME_ROOM(payload_bytes). */
static inline size_t @p@_frame(const uint8_t* payload, size_t payload_bytes, uint8_t* frame) {
  static const uint8_t sync[@sync_count@] = {@sync@};
  uint8_t check[4] = {0, 0, 0, 0};
  size_t size = 0, i;
@put_check@  for (i = 0; i < @sync_count@; ++i) frame[size++] = sync[i];
  @p@_store(frame + size, @length_bytes@, 0, (uint32_t)payload_bytes);
  size += @length_bytes@;
  for (i = 0; i < payload_bytes + @P@_CHECK_BYTES; ++i)
    frame[size++] = i < payload_bytes ? payload[i] : check[i - payload_bytes];
  return size;
}

/* The state of a line's receiver. All zero is the start. */
struct @p@_reader {
  uint8_t bytes[@P@_LONGEST_PAYLOAD + @P@_CHECK_BYTES]; /* the payload, and its check behind it */
  size_t size, left, length;
  uint8_t state; /* 0: in the marks, 1: in the length, 2: behind it */
  uint8_t count; /* of the bytes of marks or length that have come */
};

/* Takes the next byte of the line. Returns the length of the payload in reader->bytes when the byte ends a frame whose check
 * is right, else 0. A frame of another length is skipped. */
static inline size_t @p@_take(struct @p@_reader* reader, uint8_t byte) {
  static const uint8_t sync[@sync_count@] = {@sync@};
  static const uint8_t shorter[@sync_count@] = {@shorter@}; /* the marks that are left when one does not fit */
  if (reader->state == 0) {
    while (reader->count > 0 && sync[reader->count] != byte) reader->count = shorter[reader->count];
    if (sync[reader->count] == byte && ++reader->count == @sync_count@) {
      reader->state = 1;
      reader->count = 0;
      reader->length = 0;
    }
    return 0;
  }
  if (reader->state == 1) {
    reader->length |= (size_t)byte << 8u * reader->count;
    if (++reader->count < @length_bytes@) return 0;
    reader->count = 0;
    reader->size = 0;
    reader->left = reader->length + @P@_CHECK_BYTES;
    reader->state = reader->length > @payload_max@u || reader->left == 0 ? 0 : 2;
    return 0;
  }
  if (reader->size < sizeof(reader->bytes)) reader->bytes[reader->size] = byte;
  ++reader->size;
  if (--reader->left > 0) return 0;
  reader->state = 0;
  return reader->size <= sizeof(reader->bytes) ? @p@_checked(reader->bytes, reader->size) : 0;
}
)c";

inline constexpr std::string_view kReset = R"c(
/* Drops a frame that is not whole. */
static inline void @p@_reset(struct @p@_reader* reader) {
@reset@}
)c";

}  // namespace tiltproof::harness::c_header
