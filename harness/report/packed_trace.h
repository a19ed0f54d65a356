// trace.packed: the trace to the bit, in about a ninth of the bytes of trace.csv.
//
//   const std::string file = PackTrace(trace);
//   const TracePart again = UnpackTrace(file);
//   if (!again.trouble.empty()) Tell(again.trouble);      // the rows before the damage are there
//
// Little endian. A head, blocks of rows, and a block of no rows as the end: a file that is cut short is noticed, and
// keeps its whole blocks.
//
// - Head: the 8 bytes "TPTRACE1", uint32 size of the names, uint32 CRC-32 of these 12 bytes and the names, then the
//   names of the columns, each ended by a newline.
// - Block: uint32 rows, uint32 size of what follows the block's head, uint32 CRC-32 of these 8 bytes and what follows,
//   then one frame of Zstandard with the columns.
// - Columns of n rows: for each column uint8 kind, uint8 order, uint8 planes and its first `order` integers of 8 bytes.
//   Then for plane 0, 1, ... 7, of each column with more planes than that, this byte of each of its n - order residuals.
//
// A value is an integer: its bits as binary64 (kind 0) or binary32 (1), mapped so that integers are in the order of
// the numbers, or the number itself (2), or the number times 1e9 (3). Residuals are differences of that order, modulo
// 2^64, with the sign as the lowest bit. Their bytes beyond the column's planes are 0.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "harness/run/trace.h"

namespace tiltproof::harness {

// Limits of a reader, more than any flight has: a damaged or hostile file gets no more memory.
inline constexpr std::size_t kTraceColumnsMax = 1 << 14;
inline constexpr std::size_t kTraceNamesBytesMax = 1 << 22;
inline constexpr std::size_t kTraceValuesMax = std::size_t{1} << 29;

std::string PackTrace(const Trace& trace);

// The rows before the first damage.
struct TracePart {
  Trace trace;
  std::string
      trouble;  // the damage, with its place in the file; empty: there is none, and this is the whole trace
};
TracePart UnpackTrace(std::string_view file);

// Number of values that the file says it has, without unpacking them.
std::uint64_t PackedValuesCount(std::string_view file);

}  // namespace tiltproof::harness
