// Rows of the lockstep flight that flies now, from its worker process to the process that shows them. The worker
// only copies: it never waits, whatever its reader does. A slow reader misses rows.
//
//   RowRing ring;                               // before the processes are forked
//   if (ring.Begin(flight, columns)) ring.Append(row);   // in the worker
//   const RowRing::Update update = ring.Take(cursor);        // in the reader
//   ring.Release(flight);
//
// The ring holds the flight that began first, of those that fly at the same time.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tiltproof::harness {

class RowRing {
 public:
  // Four minutes of a flight with 100 columns; a page of memory is taken when it is first written.
  static constexpr std::size_t kNumbersMax = std::size_t{1} << 21;

  // Throws std::bad_alloc.
  RowRing();
  ~RowRing();
  RowRing(const RowRing&) = delete;
  RowRing& operator=(const RowRing&) = delete;

  // A flight of this number begins, with rows of `column_count` numbers. False: another one is shown, or its rows are
  // too long.
  bool Begin(std::size_t flight, std::size_t column_count);
  void Append(std::span<const double> row);
  // The flight of this number is over, whatever became of its process.
  void Release(std::size_t flight);

  // A reader's position.
  struct Cursor {
    std::uint64_t turn = 0;
    std::uint64_t rows_read = 0;
  };
  struct Update {
    bool begun = false;  // a flight that the reader has not seen
    std::size_t flight = 0;
    std::size_t column_count = 0;
    std::vector<double> values;  // whole rows
  };
  // Rows since the last call; at most those that are still there. Whatever a firmware has written into the shared
  // memory, the rows are whole and within it.
  Update Take(Cursor& cursor) const;

 private:
  struct Shared {
    std::atomic<std::int64_t> owner{0};  // process; 0: free
    std::atomic<std::uint64_t> turn{0};  // odd while a flight begins
    std::atomic<std::uint64_t> flight{0}, column_count{1}, rows_written{0};
    std::atomic<double> numbers[kNumbersMax];
  };
  static_assert(std::atomic<double>::is_always_lock_free);
  static bool IsColumnCount(std::uint64_t count) { return count > 0 && count <= kNumbersMax / 2; }
  static std::uint64_t Capacity(std::uint64_t column_count) { return kNumbersMax / column_count; }

  Shared* shared_;
};

}  // namespace tiltproof::harness
