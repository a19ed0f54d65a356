// trace.packed: every bit of a trace comes back, and damage is named with its place, whatever the bytes are.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

// After gtest.
#include <rapidcheck/gtest.h>

#include <bit>
#include <cmath>
#include <filesystem>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "harness/report/files.h"
#include "harness/report/packed_trace.h"
#include "harness/report/trace_csv.h"
#include "harness/report/trace_file.h"
#include "harness/report/zstd_bytes.h"
#include "tests/harness/report/test_folder.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::vector<std::uint64_t> BitsOf(const Trace& trace) {
  std::vector<std::uint64_t> bits;
  for (std::size_t r = 0; r < trace.row_count(); ++r)
    for (const double value : trace.row(r)) bits.push_back(std::bit_cast<std::uint64_t>(value));
  return bits;
}

void ExpectSame(const Trace& a, const Trace& b) {
  EXPECT_EQ(a.columns(), b.columns());
  EXPECT_EQ(BitsOf(a), BitsOf(b));
}

Trace TraceOf(std::size_t columns, const std::vector<double>& values) {
  std::vector<std::string> names;
  for (std::size_t c = 0; c < columns; ++c) names.push_back("column_" + std::to_string(c));
  Trace trace(std::move(names));
  trace.AppendRows(std::vector(values));
  return trace;
}

// A kind of column that flights have: a time, a count, a smooth signal, one that a message rounded, noise, a
// constant, and bits of any pattern, all NaN among them.
double SignalValue(std::size_t kind, std::size_t row, std::mt19937_64& bits) {
  const double t_s = static_cast<double>(row) * 0.012;
  switch (kind % 8) {
    case 0:
      return static_cast<double>(row * 12'000'000) / 1e9;
    case 1:
      return static_cast<double>(row / 7) - 50;
    case 2:
      return 5 * std::sin(t_s) - 1e-3;
    case 3:
      return static_cast<double>(static_cast<float>(std::cos(t_s)));
    case 4:
      return static_cast<double>(bits()) * 1e-19;
    case 5:
      return -0.0;
    case 6:
      return row % 100 == 0 ? std::numeric_limits<double>::quiet_NaN() : std::exp(10 * std::sin(t_s));
    default:
      return std::bit_cast<double>(bits());
  }
}

Trace FlightLikeTrace(std::size_t columns, std::size_t rows, std::uint64_t seed) {
  std::mt19937_64 bits(seed);
  std::vector<double> values;
  for (std::size_t r = 0; r < rows; ++r)
    for (std::size_t c = 0; c < columns; ++c) values.push_back(SignalValue(c, r, bits));
  return TraceOf(columns, values);
}

TEST(PackedTrace, KeepsEveryBitOfNumbersThatAreNone) {
  const double inf = std::numeric_limits<double>::infinity();
  const std::vector<double> odd = {0.0,
                                   -0.0,
                                   inf,
                                   -inf,
                                   std::numeric_limits<double>::quiet_NaN(),
                                   -std::numeric_limits<double>::quiet_NaN(),
                                   std::numeric_limits<double>::signaling_NaN(),
                                   std::bit_cast<double>(0x7ff8dead'beef0001U),
                                   std::numeric_limits<double>::denorm_min(),
                                   -std::numeric_limits<double>::max(),
                                   0x1p53,
                                   0x1p53 + 2,
                                   -0x1p63,
                                   0x1p64,
                                   1e300,
                                   0.1 + 0.2};
  for (std::size_t columns : {1U, 2U, 4U, 16U}) {
    const Trace trace = TraceOf(columns, odd);
    const TracePart again = UnpackTrace(PackTrace(trace));
    EXPECT_EQ(again.trouble, "");
    ExpectSame(again.trace, trace);
  }
  // Each alone, and each in a column of numbers of every kind.
  for (const double value : odd) {
    for (std::size_t kind = 0; kind < 8; ++kind) {
      std::mt19937_64 bits(kind);
      std::vector<double> values;
      for (std::size_t r = 0; r < 20; ++r) values.push_back(r == 11 ? value : SignalValue(kind, r, bits));
      const Trace trace = TraceOf(1, values);
      ExpectSame(UnpackTrace(PackTrace(trace)).trace, trace);
    }
  }
}

RC_GTEST_PROP(PackedTrace, GivesBackTheSameTraceAndText, ()) {
  const auto columns = *rc::gen::inRange<std::size_t>(1, 24);
  const auto rows =
      *rc::gen::elementOf(std::vector<std::size_t>{0, 1, 2, 3, 4, 5, 100, 1023, 1024, 1025, 2500});
  const Trace trace = FlightLikeTrace(columns, rows, *rc::gen::arbitrary<std::uint64_t>());
  const TracePart again = UnpackTrace(PackTrace(trace));
  RC_ASSERT(again.trouble.empty());
  RC_ASSERT(again.trace.columns() == trace.columns());
  RC_ASSERT(BitsOf(again.trace) == BitsOf(trace));
  // By way of the text: what it says comes back byte by byte.
  const std::string csv = WriteTraceCsv(trace);
  RC_ASSERT(WriteTraceCsv(UnpackTrace(PackTrace(ReadTraceCsv(csv))).trace) == csv);
  RC_ASSERT(PackedValuesCount(PackTrace(trace)) == rows * columns);
}

TEST(PackedTrace, ATraceWithoutColumnsHasNoRows) {
  const TracePart again = UnpackTrace(PackTrace(Trace()));
  EXPECT_EQ(again.trouble, "");
  EXPECT_TRUE(again.trace.columns().empty());
}

TEST(PackedTrace, SmoothSignalsAndTimesGetSmall) {
  const std::size_t rows = 5000;
  std::vector<double> values;
  for (std::size_t r = 0; r < rows; ++r)
    for (const std::size_t kind : {0U, 1U, 5U}) {
      std::mt19937_64 none(0);
      values.push_back(SignalValue(kind, r, none));
    }
  // Three columns that one line can describe.
  EXPECT_LT(PackTrace(TraceOf(3, values)).size(), 2000U);
}

TEST(PackedTrace, ACutFileKeepsItsWholeBlocksAndSaysWhere) {
  const Trace trace = FlightLikeTrace(8, 2500, 1);
  const std::string file = PackTrace(trace);
  std::size_t rows_before = 0;
  for (std::size_t size = 0; size < file.size(); size += size < 400 ? 1 : 997) {
    const TracePart part = UnpackTrace(std::string_view(file).substr(0, size));
    ASSERT_THAT(part.trouble, StartsWith("byte ")) << size;
    const std::size_t rows = part.trace.row_count();
    ASSERT_TRUE(rows == 0 || rows == 1024 || rows == 2048 || rows == 2500) << rows;
    ASSERT_GE(rows, rows_before);
    rows_before = rows;
    for (std::size_t r = 0; r < rows; ++r)
      for (std::size_t c = 0; c < 8; ++c)
        ASSERT_EQ(std::bit_cast<std::uint64_t>(part.trace.at(r, c)),
                  std::bit_cast<std::uint64_t>(trace.at(r, c)));
  }
  EXPECT_THAT(UnpackTrace(std::string_view(file).substr(0, file.size() - 12)).trouble,
              HasSubstr("the file was cut: it has no end (2500 rows before it are whole)"));
  EXPECT_THAT(UnpackTrace(file + "x").trouble, HasSubstr("bytes after the end"));
  EXPECT_THAT(UnpackTrace("t_s,x_m\n0,1\n").trouble, StartsWith("byte 0: not a packed trace"));
}

// A checksum notices each; nothing of a damaged block is believed.
TEST(PackedTrace, EveryFlippedByteIsNoticed) {
  const Trace trace = FlightLikeTrace(8, 1500, 2);
  const std::string file = PackTrace(trace);
  std::mt19937_64 draw(3);
  for (int flip = 0; flip < 3000; ++flip) {
    std::string damaged = file;
    const std::size_t at = flip < 600 ? static_cast<std::size_t>(flip) : draw() % file.size();
    damaged[at] = static_cast<char>(damaged[at] ^ static_cast<char>(1 + draw() % 255));
    const TracePart part = UnpackTrace(damaged);
    ASSERT_THAT(part.trouble, StartsWith("byte ")) << at;
    ASSERT_LE(part.trace.row_count(), 1500U);
  }
}

// With right checksums: what the limits and checks behind them see. The file's own functions make them.
TEST(PackedTrace, HostileBlocksGetNoMemory) {
  const Trace trace = FlightLikeTrace(8, 300, 4);
  const std::string file = PackTrace(trace);
  const auto number = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 4; i-- > 0;) value = value << 8 | static_cast<std::uint8_t>(file[at + i]);
    return value;
  };
  const std::size_t block = 16 + number(8);
  const std::string columns =
      DecompressZstd(std::string_view(file).substr(block + 12, number(block + 4)), 1 << 20);
  const auto with_block = [&](std::uint32_t rows, const std::string& frame) {
    // The CRC-32 of zlib, bit by bit.
    const auto crc_of = [](const std::string& bytes) {
      std::uint32_t crc = 0xffffffff;
      for (const char c : bytes) {
        crc ^= static_cast<std::uint8_t>(c);
        for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xedb88320U : 0U);
      }
      return ~crc;
    };
    const auto bytes_of = [](std::uint32_t value) {
      std::string bytes;
      for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i));
      return bytes;
    };
    const std::string head = bytes_of(rows) + bytes_of(static_cast<std::uint32_t>(frame.size()));
    return file.substr(0, block) + head + bytes_of(crc_of(head + frame)) + frame +
           file.substr(file.size() - 12);
  };
  ExpectSame(UnpackTrace(with_block(300, CompressZstd(columns))).trace, trace);
  const std::string place = "byte " + std::to_string(block) + ": ";
  const auto trouble = [&](std::uint32_t rows, const std::string& frame) {
    const TracePart part = UnpackTrace(with_block(rows, frame));
    EXPECT_EQ(part.trace.row_count(), 0U);
    EXPECT_THAT(part.trouble, StartsWith(place));
    return part.trouble;
  };
  EXPECT_THAT(trouble(301, CompressZstd(columns)), HasSubstr("its columns end too early"));
  EXPECT_THAT(trouble(299, CompressZstd(columns)), HasSubstr("bytes after its columns"));
  EXPECT_THAT(trouble(0xffffffff, CompressZstd(columns)),
              HasSubstr("a block of 4294967295 rows; 1024 at most"));
  EXPECT_THAT(trouble(300, "not compressed"), HasSubstr("not compressed by Zstandard"));
  EXPECT_THAT(trouble(300, CompressZstd(std::string(100'000'000, 'x'))), HasSubstr("holds 100000000"));
  for (std::size_t i = 0; i < 3; ++i) {
    std::string odd = columns;
    odd[i] = '\x09';
    EXPECT_THAT(trouble(300, CompressZstd(odd)), HasSubstr("a column of no known kind"));
  }
  // Any bytes at all.
  std::mt19937_64 draw(5);
  for (int i = 0; i < 2000; ++i) {
    std::string odd = columns;
    for (std::size_t n = 1 + draw() % 4; n > 0; --n)
      odd[draw() % (i % 2 == 0 ? 280 : odd.size())] = static_cast<char>(draw());
    const TracePart part = UnpackTrace(with_block(300, CompressZstd(odd)));
    ASSERT_TRUE(part.trouble.empty() ? part.trace.row_count() == 300U : part.trace.row_count() == 0U);
  }
}

class TraceFile : public FolderTest {};

TEST_F(TraceFile, IsReadWhicheverIsThere) {
  const Trace trace = FlightLikeTrace(4, 50, 6);
  for (const TraceFormat format : {TraceFormat::kCsv, TraceFormat::kPacked}) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    WriteTrace(folder_, trace, format);
    EXPECT_EQ(FindTrace(folder_).filename(), format == TraceFormat::kCsv ? "trace.csv" : "trace.packed");
    ExpectSame(ReadTrace(folder_), trace);
  }
}

TEST_F(TraceFile, IsMissedAndNotGuessed) {
  EXPECT_THAT(ErrorOf([&] { ReadTrace(folder_); }), HasSubstr("no trace.csv or trace.packed in "));
  WriteTrace(folder_, TraceOf(1, {1}), TraceFormat::kNone);
  EXPECT_TRUE(fs::is_empty(folder_));
  WriteTrace(folder_, TraceOf(1, {1}), TraceFormat::kCsv);
  WriteTrace(folder_, TraceOf(1, {2}), TraceFormat::kPacked);
  EXPECT_THAT(ErrorOf([&] { ReadTrace(folder_); }), HasSubstr("has both trace.csv and trace.packed"));
}

TEST_F(TraceFile, DamageIsNamedWithFileAndPlace) {
  const std::string file = PackTrace(FlightLikeTrace(4, 1100, 7));
  WriteFile(folder_ / "trace.packed", std::string_view(file).substr(0, file.size() - 20));
  EXPECT_THAT(ErrorOf([&] { ReadTrace(folder_); }), HasSubstr("trace.packed: byte "));
  EXPECT_EQ(ReadTracePart(folder_).trace.row_count(), 1024U);
  fs::remove(folder_ / "trace.packed");
  WriteFile(folder_ / "trace.csv", "t_s,x_m\n0,1\n0.012,2\n0.024");
  EXPECT_THAT(ErrorOf([&] { ReadTrace(folder_); }), HasSubstr("trace.csv: line 4: cut"));
  EXPECT_EQ(ReadTracePart(folder_).trace.row_count(), 2U);
}

}  // namespace
}  // namespace tiltproof::harness
