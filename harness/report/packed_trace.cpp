#include "harness/report/packed_trace.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "harness/report/zstd_bytes.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr std::string_view kMagic = "TPTRACE1";
constexpr std::size_t kHeadBytes = 16, kBlockHeadBytes = 12;
constexpr std::size_t kBlockRowsMax = 1024;  // 12 s of flight
constexpr std::size_t kOrderMax = 4, kPlanesMax = 8;

enum class ColumnKind : std::uint8_t { kBinary64, kBinary32, kCount, kNanoseconds };
constexpr std::uint8_t kKindsCount = 4;

template <class Unsigned>
Unsigned InOrder(Unsigned bits) {
  constexpr Unsigned kSign = Unsigned{1} << (8 * sizeof(Unsigned) - 1);
  return (bits & kSign) != 0 ? ~bits : bits | kSign;
}
template <class Unsigned>
Unsigned FromOrder(Unsigned ordered) {
  constexpr Unsigned kSign = Unsigned{1} << (8 * sizeof(Unsigned) - 1);
  return (ordered & kSign) != 0 ? ordered & ~kSign : ~ordered;
}

std::uint64_t IntegerOf(ColumnKind kind, double value) {
  constexpr double kExact = 9007199254740992.0;  // 2^53
  switch (kind) {
    case ColumnKind::kBinary64:
      return InOrder(std::bit_cast<std::uint64_t>(value));
    case ColumnKind::kBinary32:
      return InOrder(std::bit_cast<std::uint32_t>(static_cast<float>(value)));
    case ColumnKind::kCount:
    case ColumnKind::kNanoseconds: {
      const double scaled = std::round(kind == ColumnKind::kCount ? value : value * 1e9);
      return std::abs(scaled) <= kExact ? static_cast<std::uint64_t>(static_cast<std::int64_t>(scaled)) : 0;
    }
  }
  return 0;
}

double ValueOf(ColumnKind kind, std::uint64_t integer) {
  switch (kind) {
    case ColumnKind::kBinary64:
      return std::bit_cast<double>(FromOrder(integer));
    case ColumnKind::kBinary32:
      return static_cast<double>(std::bit_cast<float>(FromOrder(static_cast<std::uint32_t>(integer))));
    case ColumnKind::kCount:
      return static_cast<double>(static_cast<std::int64_t>(integer));
    case ColumnKind::kNanoseconds:
      return static_cast<double>(static_cast<std::int64_t>(integer)) / 1e9;
  }
  return 0;
}

bool Holds(ColumnKind kind, std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [kind](double value) {
    return std::bit_cast<std::uint64_t>(ValueOf(kind, IntegerOf(kind, value))) ==
           std::bit_cast<std::uint64_t>(value);
  });
}

struct Column {
  ColumnKind kind = ColumnKind::kBinary64;
  std::uint8_t order = 0, planes = 0;
  std::array<std::uint64_t, kOrderMax> first{};
  std::vector<std::uint64_t> residuals;
};

std::uint64_t SignLowest(std::uint64_t difference) { return (difference << 1) ^ (0 - (difference >> 63)); }
std::uint64_t SignHighest(std::uint64_t residual) { return (residual >> 1) ^ (0 - (residual & 1)); }

Column EncodeColumn(std::span<const double> values) {
  Column column;
  for (const ColumnKind kind : {ColumnKind::kCount, ColumnKind::kNanoseconds, ColumnKind::kBinary32}) {
    if (!Holds(kind, values)) continue;
    column.kind = kind;
    break;
  }
  std::vector<std::uint64_t> differences;
  for (const double value : values) differences.push_back(IntegerOf(column.kind, value));
  std::copy_n(differences.begin(), std::min(kOrderMax, differences.size()), column.first.begin());
  // As often as the residuals get smaller.
  std::uint64_t least_bits = std::numeric_limits<std::uint64_t>::max();
  for (std::size_t order = 0; order <= kOrderMax && order < differences.size(); ++order) {
    if (order > 0)
      for (std::size_t i = differences.size(); --i >= order;) differences[i] -= differences[i - 1];
    std::uint64_t bits = 0;
    for (std::size_t i = order; i < differences.size(); ++i)
      bits += static_cast<std::uint64_t>(std::bit_width(SignLowest(differences[i])));
    if (bits >= least_bits) continue;
    least_bits = bits;
    column.order = static_cast<std::uint8_t>(order);
    column.residuals.clear();
    for (std::size_t i = order; i < differences.size(); ++i)
      column.residuals.push_back(SignLowest(differences[i]));
  }
  std::uint64_t all = 0;
  for (const std::uint64_t residual : column.residuals) all |= residual;
  column.planes = static_cast<std::uint8_t>((std::bit_width(all) + 7) / 8);
  return column;
}

// `to` is the place of the first value, the next one is `stride` places behind it.
void DecodeColumn(const Column& column, double* to, std::size_t stride) {
  const auto put = [&](std::uint64_t integer) {
    *to = ValueOf(column.kind, integer);
    to += stride;
  };
  Check(column.order <= kOrderMax, "a column's order was checked when it was read");
  // The last difference of each order below the column's.
  std::array<std::uint64_t, kOrderMax> last{};
  for (std::size_t i = 0; i < column.order; ++i) {
    std::uint64_t difference = column.first[i];
    put(difference);
    for (std::size_t order = 0; order <= i; ++order) {
      const std::uint64_t higher = difference - last[order];
      last[order] = difference;
      difference = higher;
    }
  }
  for (const std::uint64_t residual : column.residuals) {
    std::uint64_t sum = SignHighest(residual);
    for (std::size_t order = column.order; order-- > 0;) sum = last[order] += sum;
    put(sum);
  }
}

void PutNumber(std::string& to, std::uint64_t value, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) to += static_cast<char>(value >> (8 * i));
}
std::uint64_t NumberAt(std::string_view bytes, std::size_t offset, std::size_t size) {
  CheckPart(offset, size, bytes.size(), "a number lies within the bytes of a packed trace");
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i)
    value |= static_cast<std::uint64_t>(static_cast<std::uint8_t>(bytes[offset + i])) << (8 * i);
  return value;
}

std::uint32_t Crc32(std::string_view a, std::string_view b) {
  const auto add = [](uLong crc, std::string_view bytes) {
    return crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  };
  return static_cast<std::uint32_t>(add(add(0, a), b));
}

// Appends `start`, the CRC-32 of both, and `rest`.
void PutChecked(std::string& to, std::string_view start, std::string_view rest) {
  to += start;
  PutNumber(to, Crc32(start, rest), 4);
  to += rest;
}

std::string PackColumns(const std::vector<Column>& columns) {
  std::string bytes;
  for (const Column& column : columns) {
    bytes += static_cast<char>(column.kind);
    bytes += static_cast<char>(column.order);
    bytes += static_cast<char>(column.planes);
    for (std::size_t i = 0; i < column.order; ++i) PutNumber(bytes, column.first[i], 8);
  }
  for (std::size_t plane = 0; plane < kPlanesMax; ++plane)
    for (const Column& column : columns)
      if (plane < column.planes)
        for (const std::uint64_t residual : column.residuals)
          bytes += static_cast<char>(residual >> (8 * plane));
  return bytes;
}

struct TraceDamage : std::runtime_error {
  using std::runtime_error::runtime_error;
};

std::vector<Column> UnpackColumns(std::string_view bytes, std::size_t columns_count, std::size_t rows) {
  std::size_t offset = 0;
  const auto take = [&](std::size_t size) {
    if (bytes.size() - offset < size) throw TraceDamage("its columns end too early");
    return std::exchange(offset, offset + size);
  };
  std::vector<Column> columns(columns_count);
  for (Column& column : columns) {
    const std::size_t at = take(3);
    const auto kind = static_cast<std::uint8_t>(bytes[at]);
    column.order = static_cast<std::uint8_t>(bytes[at + 1]);
    column.planes = static_cast<std::uint8_t>(bytes[at + 2]);
    if (kind >= kKindsCount || column.order > kOrderMax || column.order > rows || column.planes > kPlanesMax)
      throw TraceDamage("a column of no known kind");
    column.kind = static_cast<ColumnKind>(kind);
    for (std::size_t i = 0; i < column.order; ++i) column.first[i] = NumberAt(bytes, take(8), 8);
  }
  for (Column& column : columns) column.residuals.resize(rows - column.order);
  for (std::size_t plane = 0; plane < kPlanesMax; ++plane) {
    for (Column& column : columns) {
      if (plane >= column.planes) continue;
      const std::size_t at = take(column.residuals.size());
      for (std::size_t i = 0; i < column.residuals.size(); ++i)
        column.residuals[i] |= static_cast<std::uint64_t>(static_cast<std::uint8_t>(bytes[at + i]))
                               << (8 * plane);
    }
  }
  if (offset != bytes.size()) throw TraceDamage("bytes after its columns");
  return columns;
}

// The parts of a file, one after the other. Throws TraceDamage without a place; `offset()` is that of the part.
class Parts {
 public:
  explicit Parts(std::string_view file) : file_(file) {}

  std::size_t offset() const { return offset_; }

  std::vector<std::string> Names() {
    if (!file_.starts_with(kMagic)) throw TraceDamage("not a packed trace");
    const std::string_view names = Checked(8, kHeadBytes, "the names of its columns", kTraceNamesBytesMax);
    std::vector<std::string> columns;
    for (std::size_t begin = 0; begin < names.size();) {
      const std::size_t end = names.find('\n', begin);
      if (end == std::string_view::npos || columns.size() == kTraceColumnsMax)
        throw TraceDamage(fmt::format("no names of at most {} columns", kTraceColumnsMax));
      columns.emplace_back(names.substr(begin, end - begin));
      begin = end + 1;
    }
    return columns;
  }

  struct Block {
    std::size_t rows = 0;
    std::string_view frame;
  };
  Block NextBlock() {
    if (file_.size() - offset_ < kBlockHeadBytes)
      throw TraceDamage(offset_ == file_.size() ? "the file was cut: it has no end"
                                                : "the file was cut here");
    const std::size_t rows = NumberAt(file_, offset_, 4);
    if (rows > kBlockRowsMax)
      throw TraceDamage(fmt::format("a block of {} rows; {} at most", rows, kBlockRowsMax));
    const std::string_view frame = Checked(4, kBlockHeadBytes, "a block of rows", file_.size());
    if (rows == 0 && offset_ != file_.size()) throw TraceDamage("bytes after the end");
    return {rows, frame};
  }

 private:
  // A part whose head has a size at `size_at` and ends in the CRC-32 of everything else. Moves behind it.
  std::string_view Checked(std::size_t size_at, std::size_t head_bytes, const char* what,
                           std::size_t size_max) {
    const std::string_view rest = file_.substr(offset_);
    if (rest.size() < head_bytes) throw TraceDamage("the file was cut here");
    const std::size_t size = NumberAt(rest, size_at, 4);
    if (size > size_max) throw TraceDamage(fmt::format("{} of {} bytes; {} at most", what, size, size_max));
    if (size > rest.size() - head_bytes)
      throw TraceDamage(
          fmt::format("the file was cut in {}: {} of {} bytes", what, rest.size() - head_bytes, size));
    const std::string_view content = rest.substr(head_bytes, size);
    if (NumberAt(rest, head_bytes - 4, 4) != Crc32(rest.substr(0, head_bytes - 4), content))
      throw TraceDamage(fmt::format("{} that is damaged: its checksum is wrong", what));
    offset_ += head_bytes + size;
    return content;
  }

  std::string_view file_;
  std::size_t offset_ = 0;
};

void AppendBlock(const Parts::Block& block, Trace& trace) {
  const std::size_t columns_count = trace.columns().size();
  if ((trace.row_count() + block.rows) * columns_count > kTraceValuesMax)
    throw TraceDamage(fmt::format("more than {} values", kTraceValuesMax));
  const std::size_t bytes_max = columns_count * (3 + 8 * kOrderMax + 8 * block.rows);
  const std::vector<Column> columns =
      UnpackColumns(DecompressZstd(block.frame, bytes_max), columns_count, block.rows);
  Check(columns.size() == columns_count, "a block has each column of its trace");
  std::vector<double> rows(block.rows * columns_count);
  for (std::size_t c = 0; c < columns_count; ++c) DecodeColumn(columns[c], rows.data() + c, columns_count);
  trace.AppendRows(std::move(rows));
}

}  // namespace

std::string PackTrace(const Trace& trace) {
  const std::size_t columns_count = trace.columns().size();
  const std::string names = columns_count == 0 ? "" : fmt::format("{}\n", fmt::join(trace.columns(), "\n"));
  std::string file, head(kMagic);
  PutNumber(head, names.size(), 4);
  PutChecked(file, head, names);
  std::vector<double> values;
  for (std::size_t begin = 0; begin < trace.row_count(); begin += kBlockRowsMax) {
    const std::size_t rows = std::min(kBlockRowsMax, trace.row_count() - begin);
    std::vector<Column> columns;
    for (std::size_t c = 0; c < columns_count; ++c) {
      values.clear();
      for (std::size_t r = begin; r < begin + rows; ++r) values.push_back(trace.at(r, c));
      columns.push_back(EncodeColumn(values));
    }
    const std::string frame = CompressZstd(PackColumns(columns));
    std::string block_head;
    PutNumber(block_head, rows, 4);
    PutNumber(block_head, frame.size(), 4);
    PutChecked(file, block_head, frame);
  }
  PutChecked(file, std::string(8, '\0'), "");
  return file;
}

TracePart UnpackTrace(std::string_view file) {
  TracePart part;
  Parts parts(file);
  std::size_t begin = 0;
  try {
    part.trace = Trace(parts.Names());
    for (;;) {
      begin = parts.offset();
      const Parts::Block block = parts.NextBlock();
      if (block.rows == 0) break;
      AppendBlock(block, part.trace);
    }
  } catch (const std::runtime_error& error) {
    part.trouble =
        fmt::format("byte {}: {} ({} rows before it are whole)", begin, error.what(), part.trace.row_count());
  }
  return part;
}

std::uint64_t PackedValuesCount(std::string_view file) {
  Parts parts(file);
  std::uint64_t rows = 0, columns = 0;
  try {
    columns = parts.Names().size();
    while (const std::size_t more = parts.NextBlock().rows) rows += more;
  } catch (const TraceDamage&) {
    // Who reads the values hears of it.
  }
  return rows * columns;
}

}  // namespace tiltproof::harness
