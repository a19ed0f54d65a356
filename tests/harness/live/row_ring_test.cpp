#include "harness/live/row_ring.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <random>
#include <string>
#include <thread>
#include <vector>

namespace tiltproof::harness {
namespace {

// Every number of a row says which row it is, so that a torn row shows.
std::vector<double> Row(std::uint64_t i, std::size_t columns) {
  return std::vector<double>(columns, static_cast<double>(i));
}

void CheckWhole(const RowRing::Update& update, double& last) {
  for (std::size_t at = 0; at < update.values.size(); at += update.column_count) {
    const double first = update.values[at];
    ASSERT_GT(first, last);
    last = first;
    for (std::size_t c = 1; c < update.column_count; ++c) ASSERT_EQ(update.values[at + c], first);
  }
}

TEST(RowRing, ReaderGetsEveryRowWhileItKeepsUp) {
  RowRing ring;
  RowRing::Cursor cursor;
  EXPECT_TRUE(ring.Take(cursor).values.empty());
  ASSERT_TRUE(ring.Begin(7, 3));
  std::uint64_t count = 0;
  for (int turn = 0; turn < 20; ++turn) {
    std::vector<double> expected;
    for (int i = 0; i < turn; ++i) {
      const auto row = Row(count++, 3);
      ring.Append(row);
      expected.insert(expected.end(), row.begin(), row.end());
    }
    const RowRing::Update update = ring.Take(cursor);
    EXPECT_EQ(update.begun, turn == 0);
    EXPECT_EQ(update.flight, 7U);
    EXPECT_EQ(update.values, expected);
  }
}

TEST(RowRing, SlowReaderGetsTheNewestRowsWhole) {
  constexpr std::size_t kColumns = RowRing::kNumbersMax / 100;
  RowRing ring;
  ASSERT_TRUE(ring.Begin(0, kColumns));
  for (std::uint64_t i = 0; i < 1000; ++i) ring.Append(Row(i, kColumns));
  RowRing::Cursor cursor;
  double last = -1;
  const RowRing::Update update = ring.Take(cursor);
  CheckWhole(update, last);
  EXPECT_EQ(last, 999.0);
  EXPECT_GE(update.values.size() / kColumns, 98U);
}

TEST(RowRing, NoRowIsTornWhileItIsWritten) {
  // So few rows fit that the writer overtakes the reader again and again.
  constexpr std::size_t kColumns = RowRing::kNumbersMax / 8;
  constexpr std::uint64_t kRows = 300;
  RowRing ring;
  ASSERT_TRUE(ring.Begin(0, kColumns));
  std::atomic<bool> done = false;
  std::thread writer([&] {
    for (std::uint64_t i = 0; i < kRows; ++i) ring.Append(Row(i, kColumns));
    done = true;
  });
  RowRing::Cursor cursor;
  double last = -1;
  while (!done) CheckWhole(ring.Take(cursor), last);
  writer.join();
  CheckWhole(ring.Take(cursor), last);
  EXPECT_EQ(last, static_cast<double>(kRows - 1));
}

TEST(RowRing, OneFlightAtATimeEvenWhenItsProcessDies) {
  RowRing ring;
  // A worker begins a flight and dies.
  const pid_t child = fork();
  if (child == 0) _exit(ring.Begin(4, 5) ? 0 : 1);
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  EXPECT_FALSE(ring.Begin(5, 5));
  ring.Release(3);
  EXPECT_FALSE(ring.Begin(5, 5));
  ring.Release(4);
  EXPECT_TRUE(ring.Begin(5, 5));
  // The same worker goes on.
  EXPECT_TRUE(ring.Begin(6, 4));
  RowRing::Cursor cursor;
  EXPECT_EQ(ring.Take(cursor).flight, 6U);
  EXPECT_FALSE(ring.Begin(7, 0));
  EXPECT_FALSE(ring.Begin(7, RowRing::kNumbersMax));
}

// The memory of the ring that was made last: shared, without a file.
std::uint64_t* MemoryOfNewestRing() {
  std::ifstream maps("/proc/self/maps");
  std::uint64_t* memory = nullptr;
  for (std::string line; std::getline(maps, line);) {
    std::uintptr_t begin = 0, end = 0;
    if (std::sscanf(line.c_str(), "%" SCNxPTR "-%" SCNxPTR " rw-s", &begin, &end) == 2 &&
        line.find("/dev/zero") != std::string::npos && end - begin >= RowRing::kNumbersMax * sizeof(double))
      memory = reinterpret_cast<std::uint64_t*>(begin);
  }
  return memory;
}

TEST(RowRing, WhateverAFirmwareWritesIntoItTheReaderGoesOn) {
  RowRing ring;
  std::uint64_t* const words = MemoryOfNewestRing();
  ASSERT_NE(words, nullptr);
  std::mt19937_64 random(1);
  const std::array<std::uint64_t, 6> odd = {
      0, 1, 2, RowRing::kNumbersMax / 2, RowRing::kNumbersMax, ~std::uint64_t{0}};
  RowRing::Cursor cursor;
  for (int i = 0; i < 2000; ++i) {
    // Owner, turn, flight, number of columns, rows written.
    for (std::size_t word = 0; word < 5; ++word)
      words[word] = random() % 2 == 0 ? odd[random() % odd.size()] : random();
    if (i % 2 == 0) words[3] = random() % 200;
    const RowRing::Update update = ring.Take(cursor);
    EXPECT_TRUE(update.values.empty() || update.values.size() % update.column_count == 0);
    EXPECT_LE(update.values.size(), RowRing::kNumbersMax);
  }
}

}  // namespace
}  // namespace tiltproof::harness
