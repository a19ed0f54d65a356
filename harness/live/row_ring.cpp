#include "harness/live/row_ring.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <new>

namespace tiltproof::harness {

RowRing::RowRing() {
  void* memory = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  // Its numbers are zeros already: written, each page would take memory.
  shared_ = static_cast<Shared*>(memory);
}

RowRing::~RowRing() { munmap(shared_, sizeof(Shared)); }

bool RowRing::Begin(std::size_t flight, std::size_t column_count) {
  if (!IsColumnCount(column_count)) return false;
  std::int64_t owner = 0;
  // A worker's next flight follows its last one at once.
  if (!shared_->owner.compare_exchange_strong(owner, getpid()) && owner != getpid()) return false;
  ++shared_->turn;
  shared_->flight = flight;
  shared_->column_count = column_count;
  shared_->rows_written = 0;
  ++shared_->turn;
  return true;
}

void RowRing::Append(std::span<const double> row) {
  const std::uint64_t count = shared_->rows_written.load(std::memory_order_relaxed);
  std::atomic<double>* to = shared_->numbers + count % Capacity(row.size()) * row.size();
  // Who reads one of these numbers knows that the rows before are written: see Take.
  for (const double value : row) (to++)->store(value, std::memory_order_release);
  shared_->rows_written.store(count + 1, std::memory_order_release);
}

void RowRing::Release(std::size_t flight) {
  if (shared_->flight == flight) shared_->owner = 0;
}

RowRing::Update RowRing::Take(Cursor& cursor) const {
  Update update;
  const std::uint64_t turn = shared_->turn;
  if (turn == 0 || turn % 2 != 0) return update;
  update.flight = shared_->flight;
  update.column_count = shared_->column_count;
  // The worker's firmware can write here.
  if (!IsColumnCount(update.column_count)) return {};
  const std::uint64_t written = shared_->rows_written.load(std::memory_order_acquire);
  const std::uint64_t capacity = Capacity(update.column_count);
  std::uint64_t from = cursor.turn == turn ? cursor.rows_read : 0;
  // Beside the row that is being written, one more may be overwritten meanwhile.
  if (written >= capacity) from = std::max(from, written + 1 - capacity);
  update.values.reserve((written - std::min(from, written)) * update.column_count);
  for (std::uint64_t row = from; row < written; ++row) {
    const std::atomic<double>* at = shared_->numbers + row % capacity * update.column_count;
    for (std::uint64_t c = 0; c < update.column_count; ++c)
      update.values.push_back(at[c].load(std::memory_order_acquire));
  }
  if (shared_->turn != turn) return {};  // the next flight has begun: it is shown next time
  const std::uint64_t now = shared_->rows_written.load(std::memory_order_relaxed);
  // Rows that were overwritten while they were copied.
  const std::uint64_t lost = now >= capacity ? now + 1 - capacity : 0;
  if (lost > from)
    update.values.erase(
        update.values.begin(),
        update.values.begin() +
            static_cast<std::ptrdiff_t>(std::min(lost - from, written - from) * update.column_count));
  update.begun = cursor.turn != turn;
  cursor = {turn, written};
  return update;
}

}  // namespace tiltproof::harness
